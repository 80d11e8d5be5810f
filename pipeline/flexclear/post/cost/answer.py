"""Cost of accuracy in words: a paragraph and a price list of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.post.cost.study import methods
from flexclear.post.overview.curves import size_of
from flexclear.post.plotting.table import Table


def sentences(study: xr.Dataset) -> str:
    """Return the answer in words; study: of `stages.cost_study`."""
    return " ".join(filter(None, (_own_method_sentence(study), _digit(study), *skipped_sentence(study))))


def _worst(study: xr.Dataset) -> tuple[str, float]:
    """Return quantity and size that the largest error refers to, in words, and that error."""
    errors = study["own_error"].values
    k = int(np.argmax(errors))
    return f"{size_of(str(study['unit'].values[k]))} of {study['quantity'].values[k]}", float(errors[k])


def _own_method_sentence(study: xr.Dataset) -> str:
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


def skipped_sentence(study: xr.Dataset) -> list[str]:
    """Return a sentence on runs that were skipped, if any."""
    return [f"Not run within the budget: {study.attrs['undone']}."] if study.attrs.get("undone") else []


TARGETS = (1e-3, 1e-6, 1e-9)
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
    names = ", ".join(str(q) for q in study["quantity"].values)
    notes = [
        f"The error is the largest of all quantities: {names}; each as a fraction of its own size (of positions and "
        "angles the largest change from the start, of others the largest value), the reference's uncertainty included.",
        _confirmation_sentence(study),
    ]
    if study.attrs["horizon"] != "none":
        notes.append(f"Pointwise errors count up to the predictability horizon, t = {study.attrs['horizon']:.4g} s.")
    if study.attrs["refused"]:
        notes.append(f"Refused: {study.attrs['refused']}.")
    return notes


def _confirmation_sentence(study: xr.Dataset) -> str:
    uncertain, by = study["reference_uncertainty"].values, study.attrs["confirmation"]
    reference = f"Reference: {study.attrs['reference']}. "
    if not np.isfinite(uncertain).all():
        why = "was refused" if np.isnan(uncertain).any() else "has another number of impacts"
        return f"{reference}Not confirmed: {f'{by} {why}' if by else 'there is no second run'}."
    worst = str(study["quantity"].values[int(np.argmax(uncertain))])
    return f"{reference}Confirmed by {by}, which differs by at most {uncertain.max():.1e} ({worst})."
