"""The price list: the cheapest way to three accuracies, and what each cause contributes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.pipeline.post.cost.study import GROUPS, recording, resolved
from flexclear.pipeline.post.plotting.table import Table

TARGETS = (1e-3, 1e-6, 1e-9)
#: groups that say how a run is integrated, and the factor that is a setting
INTEGRATION = {"tolerance": "rtol", "step": "step"}
#: a best error of so many times the reference's uncertainty, which it contains, is rounding
ROUNDED = 3.0
COLUMNS = ("relative accuracy", "you need", "evaluations", "CPU (s)", "its error", "limited by")


def price_list(study: xr.Dataset, title: str, notes: tuple[str, ...] = ()) -> Table:
    """'for 1e-3 / 1e-6 / 1e-9 you need ... and it takes ...', the worst of all quantities counting.

    notes: what else is to be said.
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


def by_quantity(study: xr.Dataset, title: str) -> Table:
    """The same for each quantity by itself, where the worst of all does not decide."""
    rows = []
    for name in study["quantity"].values:
        one = study.sel(quantity=[name])
        best = min(choices(one), key=lambda c: c.error, default=NOTHING)
        cells = (_cell(cheapest(one, target), _absent(study)) for target in TARGETS)
        rows.append((str(name), *cells, f"{best.error:.1e}"))
    heads = ("quantity", *(f"for {target:g}" for target in TARGETS), "at best")
    return Table(title, heads, tuple(rows), ("In brackets: processor time of the integration of one run.",))


def _absent(study: xr.Dataset) -> str:
    """What is said of an accuracy that no run of a study has."""
    return "cannot be had" if study.attrs.get("complete", 1) else "not reached yet"


def _cell(choice: Choice | None, absent: str) -> str:
    return absent if choice is None else f"{choice.name} ({choice.seconds:.2g} s)"


@dataclass(frozen=True, slots=True)
class Choice:
    """One way to integrate: its name, cost, largest relative error and the quantity that has it.

    error: distance to the reference and the reference's own uncertainty, so that it is not less than can be determined.
    """

    name: str
    evaluations: float
    seconds: float
    error: float
    worst: str


#: where no run of a study can be compared
NOTHING = Choice("–", np.nan, np.nan, np.inf, "no run")


def cheapest(study: xr.Dataset, target: float) -> Choice | None:
    """The choice with the fewest evaluations whose largest error is at most `target`; None if there is none."""
    good = [choice for choice in choices(study) if choice.error <= target]
    return min(good, key=lambda choice: choice.evaluations, default=None)


def choices(study: xr.Dataset) -> list[Choice]:
    """All ways to integrate whose error is known."""
    choices = []
    unsure = study["reference_uncertainty"].fillna(0.0)
    for group, word in INTEGRATION.items():
        if f"error_by_{group}" not in study:
            continue
        method, setting = GROUPS[group]
        for m in study[method].values:
            for s in study[setting].values:
                one = study.sel({method: m, setting: s})
                error = one[f"error_by_{group}"] + unsure
                if not np.isfinite(error).all():
                    continue
                worst = str(study["quantity"].values[int(np.argmax(error.values))])
                evaluations, seconds = float(one[f"evaluations_by_{group}"]), float(one[f"cpu_seconds_by_{group}"])
                unit = " s" if word == "step" else ""
                choices.append(Choice(f"{m}, {word} {s:g}{unit}", evaluations, seconds, float(error.max()), worst))
    return choices


def _notes(study: xr.Dataset) -> list[str]:
    recorded = recording(study)
    notes = [
        "The error is the largest of all quantities: "
        + ", ".join(str(q) for q in study["quantity"].values)
        + "; each as a fraction of its own size, the reference's uncertainty included.",
        _confirmed(study),
    ]
    if recorded == recorded:
        notes.append(
            f"CPU is that of the integration; the record of a run takes {recorded:.2g} s more, whatever the way."
        )
    missing = [f"{target:g}" for target in TARGETS if cheapest(study, target) is None]
    if missing:
        notes.append(f"{' and '.join(missing)} {_absent(study)}: {_why_not(study)}.")
    hidden = sum(int((~resolved(study, g) & np.isfinite(study[f"error_by_{g}"])).sum()) for g in _present(study))
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
    unsure, by = study["reference_uncertainty"].values, study.attrs["confirmation"]
    said = f"Reference: {study.attrs['reference']}. "
    if not by:
        return f"{said}Not confirmed: no other run was made."
    if np.isnan(unsure).any():
        return f"{said}Not confirmed: {by} was refused."
    if np.isinf(unsure).any():
        return f"{said}Not confirmed: {by} finds another number of impacts."
    worst = str(study["quantity"].values[int(np.argmax(unsure))])
    return f"{said}Confirmed by {by}, which differs by at most {unsure.max():.1e} ({worst})."


def _why_not(study: xr.Dataset) -> str:
    """Whether the settings that were tried end too early, or rounding decides."""
    unsure = study["reference_uncertainty"].fillna(0.0)
    best = min(choices(study), key=lambda c: c.error, default=NOTHING)
    if np.isinf(unsure).any():
        return "the reference and its confirmation do not agree on the number of impacts"
    if best is NOTHING:
        return "every run is refused, or has another number of impacts than the reference"
    if best.error <= ROUNDED * float(unsure.sel(quantity=best.worst)):
        agree = f"the reference and its confirmation, the tightest runs that were made, differ as much ({best.worst})"
        if not study.attrs.get("complete", 1):
            return f"{agree}; a larger budget allows tighter ones"
        return f"{agree}; rounding errors, which the motion itself magnifies, decide there, and no method helps"
    return f"the best setting that was tried reaches {best.error:.1e} ({best.worst})"


def _present(study: xr.Dataset) -> list[str]:
    return [group for group in INTEGRATION if f"error_by_{group}" in study]
