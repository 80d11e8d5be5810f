"""Cost of accuracy in words: a paragraph on one scene, and a page with advice on several scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.post.cost.study import methods, recording, resolved
from flexclear.post.overview.curves import size_of
from flexclear.post.plotting.table import Table


def sentences(study: xr.Dataset) -> str:
    """Return the answer in words; study: of `stages.cost_study`."""
    return " ".join(filter(None, (_own(study), _digit(study), *undone(study))))


def _worst(study: xr.Dataset) -> tuple[str, float]:
    """Return quantity and size that the largest error refers to, in words, and that error."""
    errors = study["own_error"].values
    k = int(np.argmax(errors))
    return f"{size_of(str(study['unit'].values[k]))} of {study['quantity'].values[k]}", float(errors[k])


def _own(study: xr.Dataset) -> str:
    of, error = _worst(study)
    setting = (
        f"rtol {study.attrs['own_rtol']:g}" if "own_rtol" in study.attrs else f"steps of {study.attrs['own_step']:g} s"
    )
    took = (
        f"With {study.attrs['own_integrator']} at {setting} the integration takes {study.attrs['own_seconds']:.2g} s "
        f"of processor time ({study.attrs['own_evaluations']:.0f} evaluations)."
    )
    horizon = study.attrs["horizon"]
    whole = horizon == "none" or horizon >= study.attrs["end"]
    until = "" if whole else f" up to the horizon, t = {horizon:.3g} s,"
    if not np.isfinite(error):
        return f"{took} The integration's error is unknown: other runs{until} have another number of impacts."
    return f"{took} The integration errs at the outputs{until} by {error:.1e} of the {of} at most."


def _digit(study: xr.Dataset) -> str:
    """Return a sentence on the cost of one more digit."""
    _, error = _worst(study)
    better = cheapest(study, 0.1 * error) if np.isfinite(error) else None
    if better is None:
        return "One more digit was not reached within the budget." if np.isfinite(error) else ""
    return f"One more digit costs {better.seconds / study.attrs['own_seconds']:.2g} times as much ({better.name})."


def undone(study: xr.Dataset) -> list[str]:
    """Return a sentence on runs that were skipped, if any."""
    return [f"Not run within the budget: {study.attrs['undone']}."] if study.attrs.get("undone") else []


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
    """Section of the page on a scene: `advice` (`sentences`), tables (Markdown), pictures by title."""

    scene: str
    advice: str
    tables: tuple[str, ...]
    pictures: Mapping[str, str]


def markdown(scenes: tuple[Studied, ...], page: str) -> str:
    """Return the whole page."""
    names = " ".join(s.scene for s in scenes)
    return "\n".join([INTRODUCTION.format(scenes=names, page=page), sections(scenes)])


def sections(scenes: tuple[Studied, ...]) -> str:
    """Return the advice on each scene, and then each scene's pictures and tables."""
    parts = ["## What to choose\n", *(f"- **{s.scene}**: {s.advice}\n" for s in scenes)]
    for s in scenes:
        parts.append(f"\n## {s.scene}\n")
        parts += [f"![{title} of {s.scene}]({path})\n" for title, path in s.pictures.items()]
        parts += [table.rstrip() + "\n" for table in s.tables]
    return "\n".join(parts)


TARGETS = (1e-3, 1e-6, 1e-9)
#: a best error within this multiple of the reference's uncertainty, which it contains, is rounding
ROUNDED = 3.0
COLUMNS = ("relative accuracy", "you need", "evaluations", "CPU (s)", "its error", "limited by")


def price_list(study: xr.Dataset, title: str, notes: tuple[str, ...] = ()) -> Table:
    """Tabulate settings, cost and error for 1e-3, 1e-6 and 1e-9, by the worst of all quantities.

    notes: further notes of the table.
    """
    rows = []
    for target in TARGETS:
        choice = cheapest(study, target)
        if choice is None:
            best = min(choices(study), key=lambda c: c.error, default=NOTHING)
            rows.append((f"{target:g}", _absent(study), "–", "–", f"{best.error:.1e} at best", best.worst))
        else:
            seconds = f"{choice.seconds:.3f}"
            rows.append(
                (f"{target:g}", choice.name, f"{choice.evaluations:.0f}", seconds, f"{choice.error:.1e}", choice.worst)
            )
    return Table(title, COLUMNS, tuple(rows), (*_notes(study), *notes))


def _absent(study: xr.Dataset) -> str:
    """Return the words for an accuracy that no run of a study has."""
    return "cannot be reached" if study.attrs.get("complete", 1) else "not reached yet"


@dataclass(frozen=True, slots=True)
class Choice:
    """One way to integrate: its name, cost, largest relative error and the quantity that has it.

    error: distance from the reference plus the reference's uncertainty: never below what can be determined.
    """

    name: str
    evaluations: float
    seconds: float
    error: float
    worst: str


#: times within this factor are alike: times of repeated runs differ by some per cent
AS_FAST = 1.1
#: substitute where no run of a study can be compared
NOTHING = Choice("–", np.nan, np.nan, np.inf, "no run")


def cheapest(study: xr.Dataset, target: float) -> Choice | None:
    """Return the choice with the least processor time whose largest error is at most `target`; None without one.

    Among choices with nearly the same time (AS_FAST) the one with the fewest evaluations is returned.
    """
    good = [choice for choice in choices(study) if choice.error <= target]
    least = min((choice.seconds for choice in good), default=np.nan)
    fast = [choice for choice in good if not choice.seconds > AS_FAST * least]
    return min(fast, key=lambda choice: choice.evaluations, default=None)


def choices(study: xr.Dataset) -> list[Choice]:
    """Return all ways to integrate whose error is known."""
    choices = []
    uncertain = study["reference_uncertainty"].fillna(0.0)
    for group, method, setting, mine in methods(study):
        for s in study[setting].values:
            one = mine.sel({setting: s})
            error = one[f"error_by_{group}"] + uncertain
            if not np.isfinite(error).all():
                continue
            worst = str(study["quantity"].values[int(np.argmax(error.values))])
            evaluations, seconds = float(one[f"evaluations_by_{group}"]), float(one[f"cpu_seconds_by_{group}"])
            unit = " s" if setting == "step" else ""
            choices.append(Choice(f"{method}, {setting} {s:g}{unit}", evaluations, seconds, float(error.max()), worst))
    return choices


def _notes(study: xr.Dataset) -> list[str]:
    recorded = recording(study)
    notes = [
        "The error is the largest of all quantities: "
        + ", ".join(str(q) for q in study["quantity"].values)
        + "; each as a fraction of its own size (of positions and angles the largest change from the start, of others "
        "the largest value), the reference's uncertainty included.",
        _confirmed(study),
    ]
    if recorded == recorded:
        notes.append(
            f"CPU is that of the integration; the record of a run takes {recorded:.2g} s more with every integrator."
        )
    missing = [f"{target:g}" for target in TARGETS if cheapest(study, target) is None]
    if missing:
        notes.append(f"{' and '.join(missing)} {_absent(study)}: {_why_not(study)}.")
    hidden = sum(int((~resolved(one, g) & np.isfinite(one[f"error_by_{g}"])).sum()) for g, _, _, one in methods(study))
    if hidden:
        notes.append(
            f"{hidden} errors are less than 10 times the reference's own uncertainty and are not drawn; "
            "the figure shows that bound."
        )
    if study.attrs["horizon"] != "none":
        notes.append(f"Pointwise errors count up to the predictability horizon, t = {study.attrs['horizon']:.4g} s.")
    if study.attrs["refused"]:
        notes.append(f"Refused: {study.attrs['refused']}.")
    return notes


def _confirmed(study: xr.Dataset) -> str:
    uncertain, by = study["reference_uncertainty"].values, study.attrs["confirmation"]
    reference = f"Reference: {study.attrs['reference']}. "
    if not by:
        return f"{reference}Not confirmed: there is no second run."
    if np.isnan(uncertain).any():
        return f"{reference}Not confirmed: {by} was refused."
    if np.isinf(uncertain).any():
        return f"{reference}Not confirmed: {by} has another number of impacts."
    worst = str(study["quantity"].values[int(np.argmax(uncertain))])
    return f"{reference}Confirmed by {by}, which differs by at most {uncertain.max():.1e} ({worst})."


def _why_not(study: xr.Dataset) -> str:
    """Return why an accuracy cannot be had: the tried settings end too early, or rounding decides."""
    uncertain = study["reference_uncertainty"].fillna(0.0)
    best = min(choices(study), key=lambda c: c.error, default=NOTHING)
    if np.isinf(uncertain).any():
        return "the reference and its confirmation do not agree on the number of impacts"
    if best is NOTHING:
        return "every run is refused, or has another number of impacts than the reference"
    if best.error <= ROUNDED * float(uncertain.sel(quantity=best.worst)):
        agree = f"the reference and its confirmation, the tightest runs, differ as much ({best.worst})"
        if not study.attrs.get("complete", 1):
            return f"{agree}; a larger budget allows tighter ones"
        return f"{agree}; rounding errors, which the motion magnifies, limit the accuracy of every method"
    return f"the best setting tested reaches {best.error:.1e} ({best.worst})"
