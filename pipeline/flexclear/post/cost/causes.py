"""Error of a scene as it is, by cause, each from two runs that differ in that cause alone; and their table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.post.cost.statistics import relative_error
from flexclear.post.cost.study import Point, comparable_until, relative
from flexclear.post.plotting.table import Table
from flexclear.scene.quantity import Quantity

#: causes in the order of their stages, each with its refinement
CAUSES = {
    "mesh": "more elements",
    "beam theory": "another theory, or a solid",
    "modal truncation": "more modes, or another mode set",
    "time integration": "a tighter tolerance",
    "event location": "(bounded by the root finder)",
    "sampling of the output": "a shorter output interval",
    "ensemble spread": "more members",
}
#: words for an infinite error
OTHER = "another number of impacts"


def with_causes(study: xr.Dataset, split: Mapping[str, Mapping[str, float]]) -> xr.Dataset:
    """Return a study's dataset with ``error_by_cause(quantity, cause)``, NaN where a scene lacks the cause."""
    names = [str(name) for name in study["quantity"].values]
    values = np.array([[split[name].get(cause, np.nan) for cause in CAUSES] for name in names])
    attributes = {"units": "1", "long_name": "error of the scene as it is, as a fraction of the quantity's size"}
    return study.assign_coords(cause=list(CAUSES)).assign(error_by_cause=(("quantity", "cause"), values, attributes))


def table(split: Mapping[str, Mapping[str, float]], title: str) -> Table:
    """Tabulate errors, causes as rows, quantities as columns; '–' where the scene lacks a cause."""
    quantities = list(split)
    rows = []
    for cause, remedy in CAUSES.items():
        values = [split[q].get(cause, np.nan) for q in quantities]
        if not np.isnan(values).all():
            rows.append((cause, *(_cell(v) for v in values), remedy))
    largest = ("dominated by", *(dominant(split[q]) for q in quantities), "")
    spread = any(row[0] == "ensemble spread" for row in rows)
    notes = ("The spread of the ensemble is that of the whole run, all other errors are those up to the horizon.",)
    return Table(title, ("cause", *quantities, "to refine"), (*rows, largest), notes if spread else ())


def _cell(error: float) -> str:
    return "–" if np.isnan(error) else "0" if error == 0.0 else f"{error:.1e}" if np.isfinite(error) else OTHER


def dominant(causes: Mapping[str, float]) -> str:
    """Return the cause with the largest error; one that changes the number of impacts is larger than any other."""
    known = {cause: error for cause, error in causes.items() if not np.isnan(error)}
    return max(known, key=lambda cause: known[cause]) if known else "–"


#: half the width of a normal distribution's 95 % interval, in standard deviations
NORMAL_95 = 1.96


def causes_of(
    quantity: Quantity,
    points: Sequence[Point],
    runs: Mapping[str, xr.Dataset],
    located: float,
    ensemble: xr.Dataset | None = None,
) -> dict[str, float]:
    """Return the relative error by cause (names of `causes.CAUSES`); NaN where the scene lacks the cause.

    located: fraction of the clearance to which contact events are located.  ensemble: at the tightest tolerance, of a
    scene that has one; its spread is that of the whole run, all other errors are those up to the horizon.
    """
    accepted = [p for p in points if "refused" not in runs[p.key].attrs]
    asis = next((runs[p.key] for p in accepted if p.group == "sampling" and p.key == "as it is"), None)
    reference = next(runs[p.key] for p in accepted if p.group == "reference")
    growth = 0.0 if asis is None else float(asis.attrs.get("growth", 0.0))
    until = comparable_until(accepted, runs)
    size = quantities.scale(reference, quantity)

    def between(a: xr.Dataset | None, b: xr.Dataset | None) -> float:
        if a is None or b is None:
            return np.nan
        return relative(quantities.error(a, b, quantity, until), size)

    models = _models([p for p in accepted if p.group == "model"])
    model = {cause: runs[point.key] for cause, point in models.items() if point is not None}
    return {
        **{of: between(model.get("own"), model.get(of)) for of in ("mesh", "beam theory", "modal truncation")},
        "time integration": between(asis, reference),
        "event location": _location(quantity, reference, located, size, growth),
        "sampling of the output": _sampling(quantity, asis, accepted, runs, size),
        "ensemble spread": _half_interval(quantity, ensemble, size),
    }


def _models(points: Sequence[Point]) -> dict[str, Point | None]:
    """Return the scene's own run, and by cause the run that differs from it in that cause alone, or None.

    For modes it is the largest statically complete set, for meshes the finest one, for theories shear-flexible beams,
    which assume the least.
    """
    own = next((p for p in points if p.factors.get("own")), None)
    if own is None:
        return {}
    same = [p for p in points if all(p.factors[f] == own.factors[f] for f in ("theory", "elements"))]
    complete = [p for p in same if p.factors["mode_set"] == "craig-bampton"] or same
    finer = [p for p in points if p.factors["elements"] > own.factors["elements"]]
    sheared = [p for p in points if p.factors["theory"] == "timoshenko" != own.factors["theory"]]
    return {
        "own": own,
        "mesh": max(finer, key=lambda p: p.factors["elements"], default=None),
        "beam theory": next(iter(sheared), None),
        "modal truncation": max(complete, key=lambda p: p.factors["modes"]),
    }


def _location(quantity: Quantity, reference: xr.Dataset, located: float, size: float, growth: float) -> float:
    """Return a bound from the root finder's tolerance: a displacement of that size, grown as the perturbed run's is."""
    if "clearance" not in reference.attrs:
        return np.nan
    displacement = located * float(reference.attrs["clearance"])
    if quantity.kind == "velocity":
        return growth * located
    if quantity.kind == "impact_times":
        speed = reference["event_approach_speed"].values[reference["event_kind"].values == "closing"]
        hard = speed[speed > quantities.IMPACT]
        return relative(displacement / float(hard.min()), size) if len(hard) else np.nan
    return np.nan


def _sampling(
    quantity: Quantity, asis: xr.Dataset | None, points: Sequence[Point], runs: Mapping[str, xr.Dataset], size: float
) -> float:
    """Return the change of the largest value with denser output; events are located, not sampled."""
    denser = next((runs[p.key] for p in points if p.key == "denser output"), None)
    if asis is None or denser is None or not quantity.over_time:
        return np.nan
    return relative(abs(quantities.scale(denser, quantity) - quantities.scale(asis, quantity)), size)


def _half_interval(quantity: Quantity, ensemble: xr.Dataset | None, size: float) -> float:
    """Return half the 95 % interval of the members' mean: by bootstrap of peaks, 1.96 standard errors of series."""
    if ensemble is None:
        return np.nan
    if quantity.kind == "peak_force":
        return relative_error(ensemble["peak_force"].sel(contact=quantity.owner).values.astype(float))
    if quantity.name in ensemble["quantity"].values:
        return relative(NORMAL_95 * float(ensemble["standard_error"].sel(quantity=quantity.name)), size)
    return np.nan
