"""Dataset of a cost study: error and cost over the factors, and uncertainty of the reference.

Errors are pointwise up to the horizon of the scene's run; beyond it only statistics mean anything.
They are relative to the size of each quantity (`quantities.scale`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.post.overview.curves import size_of
from flexclear.post.plotting.table import Table
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.output import Schema, table
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import SolverError, of_trial

#: name of the scene's own run among those of a study
OWN = "as it is"
#: the reference must agree with its independent confirmation this many times better than an error it measures
MARGIN = 10.0
#: costs of a run
COSTS: Schema = table("""
cpu_seconds | | s | processor time of the integration of a warm run, median of the repeats
cpu_spread | | s | largest minus smallest processor time of the repeats
recording_seconds | | s | processor time of its record: rows and dataset
evaluations | | 1 | right-hand sides evaluated
peak_memory | | B | largest resident memory of the process of the run
compile_seconds | | s | time to build and fetch or compile the kernels, not part of the run
""")
#: other variables of a run in a study, by quantity
KINDS: Schema = table("""
error | | 1 | largest error up to the horizon, as a fraction of the quantity's size
distance | | 1 | largest distance from the scene's own run up to the horizon, as a fraction of the quantity's size
""")


@dataclass(frozen=True, slots=True)
class MeasuredRun:
    """One run of a study: its integrator, and its tolerance or its fixed step [s]; the other one is None."""

    key: str
    integrator: str
    rtol: float | None = None
    step: float | None = None


def reference_and_confirmation(
    points: Sequence[MeasuredRun], runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]
) -> tuple[str, str]:
    """Return the names of the reference and of the run that confirms it; the latter is empty where there is none.

    The reference is the run at the tightest tolerance. The confirmation is the run that agrees best with it among those
    by other methods: its own error, which is not below the reference's, is part of their distance. Without another
    method, it is the best agreeing run by the same one. Raises SolverError where every run was refused.
    """
    accepted = [(p.rtol, p) for p in points if p.rtol is not None and "refused" not in runs[p.key].attrs]
    if not accepted:
        reasons = "; ".join(dict.fromkeys(_reason(runs[p.key]) for p in points if "refused" in runs[p.key].attrs))
        raise SolverError(f"no run with adaptive steps succeeded, so that no reference exists: {reasons}")
    _, best = min(accepted, key=lambda one: (one[0], -INTEGRATORS[one[1].integrator].order))
    others = [p for _, p in accepted if p.integrator != best.integrator]
    others = others or [p for _, p in accepted if p is not best]
    until, reference = comparable_until(runs), runs[best.key]

    def distance(point: MeasuredRun) -> float:
        return max(relative_errors(runs[point.key], reference, chosen, until), default=0.0)

    return best.key, next((p.key for p in sorted(others, key=distance)), "")


def assemble(points: Sequence[MeasuredRun], runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> xr.Dataset:
    """Return the study's dataset over (run, quantity); `runs` holds the result of each point, by key, and OWN.

    A run that was refused has no values: its entry is NaN and its reason is in `refused`. Raises SolverError where
    every run was refused.
    """
    best, confirmation = reference_and_confirmation(points, runs, chosen)
    reference, asis, until = runs[best], runs.get(OWN), comparable_until(runs)
    floor = np.full(len(chosen), np.nan)
    if confirmation:
        floor = relative_errors(runs[confirmation], reference, chosen, until)
    made = [(k, runs[p.key]) for k, p in enumerate(points) if "refused" not in runs[p.key].attrs]
    data = {name: np.full((len(points), *[len(chosen)] * (name in KINDS)), np.nan) for name in (*KINDS, *COSTS)}
    for k, run in made:
        data["error"][k] = relative_errors(run, reference, chosen, until)
        if asis is not None:
            data["distance"][k] = relative_errors(run, asis, chosen, until)
        for name in COSTS:
            data[name][k] = cost_of_run(run, name)
    described = {name: {"units": one.units, "long_name": one.long_name} for name, one in (COSTS | KINDS).items()}
    variables = {
        name: (("run", "quantity")[: values.ndim], values, described[name]) for name, values in data.items()
    } | {
        "scale": (("quantity",), [quantities.scale(reference, q) for q in chosen]),
        "reference_uncertainty": (("quantity",), floor, {"units": "1", "long_name": "uncertainty of the reference"}),
    }
    attributes = {
        "reference": best,
        "confirmation": confirmation,
        "horizon": until if np.isfinite(until) else "none",
        "end": float(reference["time"].values[-1]),
        "refused": "; ".join(f"{p.key}: {_reason(runs[p.key])}" for p in points if "refused" in runs[p.key].attrs),
        "Conventions": "CF-1.11",
    }
    if asis is not None:
        error = _with_uncertainty(relative_errors(asis, reference, chosen, until), floor)
        words = "error of the scene's own run, the reference's uncertainty included, as a fraction of the size"
        variables["own_error"] = (("quantity",), error, {"units": "1", "long_name": words})
        attributes |= {
            "own_seconds": cost_of_run(asis, "cpu_seconds"),
            "own_evaluations": cost_of_run(asis, "evaluations"),
        }
    coordinates = {
        "run": [p.key for p in points],
        "integrator": ("run", [p.integrator for p in points]),
        "rtol": ("run", [np.nan if p.rtol is None else p.rtol for p in points]),
        "step": ("run", [np.nan if p.step is None else p.step for p in points], {"units": "s"}),
        "quantity": [q.name for q in chosen],
        "unit": ("quantity", [quantities.unit(reference, q) for q in chosen]),
    }
    return xr.Dataset(variables, coordinates, attributes)


def methods(study: xr.Dataset) -> Iterator[tuple[str, str, xr.Dataset]]:
    """Yield integrator, name of its setting, and its runs, the loosest first, for each integrator."""
    for setting in ("rtol", "step"):
        mine = study.isel(run=np.isfinite(study[setting].values)).sortby(setting, ascending=False)
        for name in dict.fromkeys(mine["integrator"].values.tolist()):
            yield name, setting, mine.isel(run=mine["integrator"].values == name)


def is_resolved(study: xr.Dataset) -> xr.DataArray:
    """Return True where the reference can measure an error, over (run, quantity)."""
    return study["error"] >= MARGIN * study["reference_uncertainty"].fillna(0.0)


def _reason(refused: xr.Dataset) -> str:
    """Return why a run was refused, without the other warnings and remedies."""
    return of_trial(str(refused.attrs["refused"]).partition(";")[0])


def cost_of_run(run: xr.Dataset, name: str) -> float:
    """Return one of COSTS of a point's run."""
    seconds = run["cpu_repeat"].values
    if name == "cpu_seconds":
        return float(np.median(seconds))
    if name == "cpu_spread":
        return float(seconds.max() - seconds.min())
    return float(run.attrs[name])


def relative_errors(run: xr.Dataset, reference: xr.Dataset, chosen: Sequence[Quantity], until: float) -> np.ndarray:
    """Return the largest errors up to a time [s] as fractions of the quantities' sizes; as they are for a size of
    zero."""
    scales = [quantities.scale(reference, q) for q in chosen]
    errors = [quantities.largest_distance(run, reference, q, until) for q in chosen]
    return np.array([error / scale if scale > 0.0 else error for error, scale in zip(errors, scales, strict=True)])


def _with_uncertainty(error: np.ndarray, uncertain: np.ndarray) -> np.ndarray:
    """Return errors next to the reference with its uncertainty; nan for the reference that no run confirms."""
    return np.where(np.isnan(uncertain) & (error == 0.0), np.nan, error + np.nan_to_num(uncertain))


def comparable_until(runs: Mapping[str, xr.Dataset]) -> float:
    """Return the time up to which pointwise errors mean something [s]: the least horizon of the runs.

    Infinite where no run has a horizon.
    """
    return min((float(run["horizon"]) for run in runs.values() if "horizon" in run), default=np.inf)


def sentences(study: xr.Dataset) -> str:
    """Return the answer in words; study: of `stages.studies`."""
    return " ".join(filter(None, (_own_method_sentence(study), _digit(study), *skipped_sentence(study))))


def _worst_own_error(study: xr.Dataset) -> tuple[str, float]:
    """Return quantity and size that the largest error refers to, in words, and that error."""
    errors = study["own_error"].values
    k = int(np.argmax(errors))
    return f"{size_of(str(study['unit'].values[k]))} of {study['quantity'].values[k]}", float(errors[k])


def _own_method_sentence(study: xr.Dataset) -> str:
    of, error = _worst_own_error(study)
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
        why = f"other runs{until} have another number of impacts"
        why = why if study.attrs["confirmation"] else "no other run is known"
        return f"{took} The integration's error is unknown: {why}."
    return f"{took} The integration errs at the outputs{until} by {error:.1e} of the {of} at most."


def _digit(study: xr.Dataset) -> str:
    """Return a sentence on the cost of one more digit."""
    _, error = _worst_own_error(study)
    better = cheapest(study, 0.1 * error) if np.isfinite(error) else None
    if better is None:
        return "One more digit was not reached within the budget." if np.isfinite(error) else ""
    return f"One more digit costs {better.seconds / study.attrs['own_seconds']:.2g} times as much ({better.name})."


def skipped_sentence(study: xr.Dataset) -> list[str]:
    """Return a sentence on runs that were skipped, if any."""
    return [f"Not run within the budget: {study.attrs['undone']}."] if study.attrs.get("undone") else []


TARGETS = (1e-3, 1e-6, 1e-9)
COLUMNS = ("relative accuracy", "you need", "evaluations", "CPU (s)", "its error", "limited by")


def price_list(study: xr.Dataset, title: str) -> Table:
    """Tabulate settings, cost and error for 1e-3, 1e-6 and 1e-9, by the worst of all quantities."""
    rows = []
    for target in TARGETS:
        choice = cheapest(study, target)
        if choice is None:
            best = min(choices(study), key=lambda c: c.error, default=NOTHING)
            rows.append((f"{target:g}", _unreached_text(study), "–", "–", f"{best.error:.1e} at best", best.worst))
        else:
            seconds = f"{choice.seconds:.3f}"
            rows.append(
                (f"{target:g}", choice.name, f"{choice.evaluations:.0f}", seconds, f"{choice.error:.1e}", choice.worst)
            )
    return Table(title, COLUMNS, tuple(rows), tuple(_notes(study)))


def _unreached_text(study: xr.Dataset) -> str:
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
    errors = _with_uncertainty(study["error"].values, study["reference_uncertainty"].values)
    return [
        Choice(
            str(study["run"].values[k]),
            float(study["evaluations"][k]),
            float(study["cpu_seconds"][k]),
            float(errors[k].max()),
            str(study["quantity"].values[int(np.argmax(errors[k]))]),
        )
        for k in np.flatnonzero(np.isfinite(errors).all(axis=1))
    ]


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
    return notes + skipped_sentence(study)


def _confirmation_sentence(study: xr.Dataset) -> str:
    uncertain, by = study["reference_uncertainty"].values, study.attrs["confirmation"]
    reference = f"Reference: {study.attrs['reference']}. "
    if not np.isfinite(uncertain).all():
        why = f"{by} has another number of impacts" if by else "there is no second run"
        return f"{reference}Not confirmed: {why}."
    worst = str(study["quantity"].values[int(np.argmax(uncertain))])
    return f"{reference}Confirmed by {by}, which differs by at most {uncertain.max():.1e} ({worst})."
