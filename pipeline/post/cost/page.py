"""The page on accuracy: what to choose and why, for several scenes, out of their studies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.pipeline.post.cost.causes import CAUSES, dominant
from flexclear.pipeline.post.cost.price import TARGETS, Choice, cheapest

INTRODUCTION = """# What accuracy costs

Made from the datasets `results/cost/<scene>/cost.nc` by

    flexclear cost {scenes} \\
        --page {page}

Nothing on this page is typed in. Errors are the largest differences from a reference
run over the whole run, or up to the horizon beyond which the motion of the scene cannot be predicted point by point;
each is a fraction of the quantity's own size. Times are processor seconds of the integration of warm runs,
without their record, on one core of the machine that made the page: their ratios carry over to others, their values do
not.
"""


@dataclass(frozen=True, slots=True)
class Studied:
    """What the page says of a scene: `advice`, its tables (Markdown), its pictures by title, relative to the page."""

    scene: str
    advice: str
    tables: tuple[str, ...]
    pictures: Mapping[str, str]


def markdown(scenes: tuple[Studied, ...], page: str) -> str:
    """The whole page."""
    names = " ".join(s.scene for s in scenes)
    return "\n".join([INTRODUCTION.format(scenes=names, page=page), sections(scenes)])


def sections(scenes: tuple[Studied, ...]) -> str:
    """What to choose for each scene, and then each with its pictures and tables."""
    parts = ["## What to choose\n", *(f"- **{s.scene}**: {s.advice}\n" for s in scenes)]
    for s in scenes:
        parts.append(f"\n## {s.scene}\n")
        parts += [f"![{title} of {s.scene}]({path})\n" for title, path in s.pictures.items()]
        parts += [table.rstrip() + "\n" for table in s.tables]
    return "\n".join(parts)


def advice(study: xr.Dataset, tables: tuple[str, ...]) -> str:
    """One paragraph: the cheapest way to each accuracy, what a digit costs, how far it holds, what limits the scene."""
    choices = {target: cheapest(study, target) for target in TARGETS}
    had = {target: choice for target, choice in choices.items() if choice is not None}
    text = "; ".join(f"{target:g} takes {c.name} ({c.evaluations:.0f} evaluations)" for target, c in had.items())
    said = [
        f"{text}." if had else "None of the accuracies asked for can be had for all quantities; see the tables below."
    ]
    if had:
        said += [_digits(had)]
    said += [_some(study, target) for target in TARGETS if target not in had]
    said += [_horizon(study, tables), _limits(study)]
    return " ".join(filter(None, said))


def _some(study: xr.Dataset, target: float) -> str:
    """For which quantities an accuracy can be had that cannot be had for all."""
    names = [str(name) for name in study["quantity"].values]
    able = [name for name in names if cheapest(study.sel(quantity=[name]), target) is not None]
    unable = ", ".join(name for name in names if name not in able)
    return f"{target:g} can be had for {', '.join(able)}, not for {unable}." if able else f"{target:g} cannot be had."


def _digits(had: Mapping[float, Choice]) -> str:
    loose, tight = had[max(had)], had[min(had)]
    digits = np.log10(max(had) / min(had))
    if not digits > 0.0 or tight.evaluations <= loose.evaluations:
        return ""
    factor = (tight.evaluations / loose.evaluations) ** (1.0 / digits)
    return f"Each further digit multiplies the evaluations by {factor:.2f}."


def _horizon(study: xr.Dataset, tables: tuple[str, ...]) -> str:
    """What is to be done where a run cannot be predicted to its end."""
    horizon, end = study.attrs["horizon"], study.attrs["end"]
    if horizon == "none" or horizon >= end:
        return ""
    beyond = "the means of an ensemble, below, which more members make better and tighter tolerances do not"
    if not any("Beyond the horizon" in table for table in tables):
        beyond = "an ensemble, which the scene can ask for (`[ensemble]`)"
    return f"All this holds up to t = {horizon:.3g} s of {end:.3g} s; beyond that nothing but {beyond}."


def _limits(study: xr.Dataset) -> str:
    """What to refine in the scene as it is: the causes that dominate, each with its quantities."""
    if "error_by_cause" not in study:
        return ""
    by_cause: dict[str, list[str]] = {}
    for name in study["quantity"].values:
        cause = dominant(
            dict(zip(study["cause"].values, study["error_by_cause"].sel(quantity=name).values, strict=True))
        )
        by_cause.setdefault(cause, []).append(str(name))
    parts = [f"{CAUSES[c]} ({c} limits {', '.join(q)})" for c, q in by_cause.items() if c in CAUSES]
    return f"To refine the scene as it is: {'; '.join(parts)}." if parts else ""
