"""Dataset of a cost study: error and cost over the factors, and uncertainty of the reference.

Errors are pointwise up to the horizon of the scene's run; beyond it only statistics mean anything.
They are relative to the size of each quantity (`quantities.scale`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.post.overview.curves import size_of
from flexclear.post.plotting.table import Table
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.output import Schema, Variable, table
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import SolverError, of_trial

#: groups of points and the factors that span each
GROUPS: dict[str, tuple[str, ...]] = {
    "tolerance": ("adaptive_integrator", "rtol"),
    "step": ("fixed_integrator", "step"),
}
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
#: other variables of a run in a study
KINDS: Schema = COSTS | table("""
error | | 1 | largest error up to the horizon, as a fraction of the quantity's size
distance | | 1 | largest distance from the scene's own run up to the horizon, as a fraction of the quantity's size
own_error | | 1 | error of the scene's own run, the reference's uncertainty included, as a fraction of the size
""")


@dataclass(frozen=True, slots=True)
class Point:
    """One run of a study. group: of GROUPS, or 'own', 'reference' or 'confirmation'; factors: their values."""

    key: str
    group: str
    factors: Mapping[str, Any]


def with_reference(points: Sequence[Point], runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> list[Point]:
    """Return the points, and the reference and its confirmation as further points of groups of these names.

    The reference is the run at the tightest tolerance. The confirmation is the run that agrees best with it among those
    by other methods: its own error, which is not below the reference's, is part of their distance. Without another
    method, it is the best agreeing run by the same one. Raises SolverError where every run was refused.
    """
    accepted = [p for p in points if p.group == "tolerance" and "refused" not in runs[p.key].attrs]
    if not accepted:
        reasons = "; ".join(dict.fromkeys(_reason(runs[p.key]) for p in points if "refused" in runs[p.key].attrs))
        raise SolverError(f"no run with adaptive steps succeeded, so that no reference exists: {reasons}")
    best = min(accepted, key=lambda p: (p.factors["rtol"], -INTEGRATORS[p.factors["adaptive_integrator"]].order))
    others = [p for p in accepted if p.factors["adaptive_integrator"] != best.factors["adaptive_integrator"]]
    others = others or [p for p in accepted if p is not best]
    until, reference = comparable_until(points, runs), runs[best.key]

    def distance(point: Point) -> float:
        return max(relative_errors(runs[point.key], reference, chosen, until).values(), default=0.0)

    result = [*points, Point(best.key, "reference", {})]
    return result + [Point(p.key, "confirmation", {}) for p in sorted(others, key=distance)[:1]]


def assemble(points: Sequence[Point], runs: Mapping[str, xr.Dataset], chosen: Sequence[Quantity]) -> xr.Dataset:
    """Return the study's dataset; `runs` holds the result of each point, by key.

    A run that was refused has no values: its entry is NaN and its reason is in `refused`. Raises SolverError when the
    reference was refused.
    """
    reference = runs[next(p.key for p in points if p.group == "reference")]
    if "refused" in reference.attrs:
        raise SolverError(
            f"no comparison: the reference ({_keys_of(points, 'reference')}) is refused: {reference.attrs['refused']}"
        )
    until = comparable_until(points, runs)
    scales = {q: quantities.scale(reference, q) for q in chosen}
    data: dict[str, Any] = {"scale": (("quantity",), np.array([scales[q] for q in chosen]))}
    coordinates: dict[str, Any] = {
        "quantity": [q.name for q in chosen],
        "unit": ("quantity", [quantities.unit(reference, q) for q in chosen]),
    }

    def errors(run: xr.Dataset, other: xr.Dataset = reference) -> np.ndarray:
        return np.array(list(relative_errors(run, other, chosen, until).values()))

    asis = next((runs[p.key] for p in points if p.key == "as it is"), None)
    confirmations = [runs[p.key] for p in points if p.group == "confirmation"]
    confirmed = [errors(run) for run in confirmations if "refused" not in run.attrs]
    floor = np.max(confirmed, axis=0) if confirmed else np.full(len(chosen), np.nan)
    data["reference_uncertainty"] = (("quantity",), floor)
    for group, factors in GROUPS.items():
        mine = [p for p in points if p.group == group]
        if not mine:
            continue
        every = {factor: {p.factors[factor] for p in mine} for factor in factors}
        values = {name: sorted(of, reverse=all(isinstance(v, float) for v in of)) for name, of in every.items()}
        coordinates |= values
        over, each = partial(_over_factors, values, mine, runs), (len(chosen),)
        distance = over(lambda run: np.nan if asis is None else errors(run, asis), each)
        data[f"error_by_{group}"] = ((*factors, "quantity"), over(errors, each))
        data[f"distance_by_{group}"] = ((*factors, "quantity"), distance)
        data |= {f"{name}_by_{group}": (factors, over(partial(cost_of_run, name=name))) for name in COSTS}
    if asis is not None and "refused" not in asis.attrs:
        data["own_error"] = (("quantity",), errors(asis) + np.nan_to_num(floor))
    attributes = {
        "reference": _keys_of(points, "reference"),
        "confirmation": _keys_of(points, "confirmation"),
        "horizon": until if np.isfinite(until) else "none",
        "end": float(reference["time"].values[-1]),
        "refused": "; ".join(f"{p.key}: {_reason(runs[p.key])}" for p in points if "refused" in runs[p.key].attrs),
        "Conventions": "CF-1.11",
    }
    result = xr.Dataset(data, coords=coordinates, attrs=attributes)
    for name in result.data_vars:
        kind = str(name).rpartition("_by_")[0] or str(name)
        one = KINDS.get(kind, Variable((), "1", kind.replace("_", " ")))
        result[name].attrs = {"units": one.units, "long_name": one.long_name}
    return result


def methods(study: xr.Dataset) -> Iterator[tuple[str, str, str, xr.Dataset]]:
    """Yield group, integrator, name of its setting, and the study of that integrator alone, for each integrator."""
    for group, (method, setting) in GROUPS.items():
        for name in study[method].values if f"error_by_{group}" in study else ():
            yield group, str(name), setting, study.sel({method: name})


def is_resolved(study: xr.Dataset, group: str) -> xr.DataArray:
    """Return True where the reference can measure an error; same shape as ``error_by_<group>``."""
    return study[f"error_by_{group}"] >= MARGIN * study["reference_uncertainty"].fillna(0.0)


def _reason(refused: xr.Dataset) -> str:
    """Return why a run was refused, without the other warnings and remedies."""
    return of_trial(str(refused.attrs["refused"]).partition(";")[0])


def _over_factors(
    values: Mapping[str, list[Any]],
    points: Sequence[Point],
    runs: Mapping[str, xr.Dataset],
    of: Callable[[xr.Dataset], Any],
    inner: tuple[int, ...] = (),
) -> np.ndarray:
    """Return `of` each run (shape inner) over the values of the factors; NaN for a missing or refused run."""
    result = np.full((*map(len, values.values()), *inner), np.nan)
    for point in points:
        if "refused" not in runs[point.key].attrs:
            index = tuple(known.index(point.factors[factor]) for factor, known in values.items())
            result[index] = of(runs[point.key])
    return result


def cost_of_run(run: xr.Dataset, name: str) -> float:
    """Return one of COSTS of a point's run."""
    seconds = run["cpu_repeat"].values
    if name == "cpu_seconds":
        return float(np.median(seconds))
    if name == "cpu_spread":
        return float(seconds.max() - seconds.min())
    return float(run.attrs[name])


def median_recording_time(study: xr.Dataset) -> float:
    """Return processor time of the record of one run [s]: the same for each integration's rows, so one median."""
    times = [study[f"recording_seconds_by_{group}"].values.ravel() for group in GROUPS
             if f"recording_seconds_by_{group}" in study]  # fmt: skip
    values = np.concatenate([*times, [np.nan]])
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")


def relative_errors(
    run: xr.Dataset, reference: xr.Dataset, chosen: Sequence[Quantity], until: float
) -> dict[str, float]:
    """Return the largest errors up to a time [s] as fractions of the quantities' sizes, by name."""
    return {
        q.name: relative_error(quantities.largest_distance(run, reference, q, until), quantities.scale(reference, q))
        for q in chosen
    }


def comparable_until(points: Sequence[Point], runs: Mapping[str, xr.Dataset]) -> float:
    """Return the time up to which pointwise errors mean something [s]: the least horizon of the runs.

    Infinite where no run has a horizon.
    """
    return min((float(runs[p.key]["horizon"]) for p in points if "horizon" in runs[p.key]), default=np.inf)


def relative_error(error: float, scale: float) -> float:
    """Return an error as a fraction of a size; the error itself for a size of zero."""
    return error / scale if scale > 0.0 else error


def _keys_of(points: Sequence[Point], group: str) -> str:
    return "; ".join(p.key for p in points if p.group == group)


def sentences(study: xr.Dataset) -> str:
    """Return the answer in words; study: of `stages.cost_study`."""
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
        return f"{took} The integration's error is unknown: other runs{until} have another number of impacts."
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


def price_list(study: xr.Dataset, title: str, notes: tuple[str, ...] = ()) -> Table:
    """Tabulate settings, cost and error for 1e-3, 1e-6 and 1e-9, by the worst of all quantities.

    notes: further notes of the table.
    """
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
    return Table(title, COLUMNS, tuple(rows), (*_notes(study), *notes))


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
