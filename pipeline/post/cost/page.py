"""The page on accuracy: what to choose and why, for several scenes, out of their studies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.post.cost.price import TARGETS, cheapest

INTRODUCTION = """# What accuracy costs

Made by `flexclear cost {scenes} --page {page}` from the datasets
`results/cost/<scene>/cost.nc`; nothing on this page is typed in. Errors are the largest differences from a reference
run over the whole run, or up to the horizon beyond which the motion of the scene cannot be predicted point by point;
each is a share of the quantity's own size. Times are processor seconds of warm runs on one core of the machine that
made the page: their ratios carry over to others, their values do not.
"""


@dataclass(frozen=True, slots=True)
class Studied:
    """A scene's study and its printed tables (Markdown), and where its pictures are, relative to the page."""

    scene: str
    study: xr.Dataset
    tables: tuple[str, ...]
    pictures: Mapping[str, str]


def markdown(scenes: tuple[Studied, ...], page: str) -> str:
    """The whole page."""
    names = " ".join(s.scene for s in scenes)
    parts = [INTRODUCTION.format(scenes=names, page=page), "## What to choose\n", *(_advice(s) for s in scenes)]
    for s in scenes:
        parts.append(f"\n## {s.scene}\n")
        parts += [f"![{title} of {s.scene}]({path})\n" for title, path in s.pictures.items()]
        parts += [table.rstrip() + "\n" for table in s.tables]
    return "\n".join(parts)


def _advice(scene: Studied) -> str:
    """One paragraph: the cheapest way to each accuracy, what the last digits cost, where the method changes."""
    found = {target: cheapest(scene.study, target) for target in TARGETS}
    had = {target: choice for target, choice in found.items() if choice is not None}
    if not had:
        return f"- **{scene.scene}**: none of the accuracies asked for can be had; see the table below.\n"
    text = "; ".join(f"{target:g} takes {c.name} ({c.evaluations:.0f} evaluations)" for target, c in had.items())
    first, last = had[min(had, key=lambda t: -t)], had[min(had)]
    digits = np.log10(max(had) / min(had)) if len(had) > 1 else 0.0
    grows = ""
    if digits > 0.0 and last.evaluations > first.evaluations:
        factor = (last.evaluations / first.evaluations) ** (1.0 / digits)
        grows = f" Each further digit multiplies the evaluations by {factor:.2f}."
    missing = [f"{t:g}" for t in TARGETS if t not in had]
    lacks = f" {' and '.join(missing)} cannot be had." if missing else ""
    return f"- **{scene.scene}**: {text}.{grows}{lacks}\n"
