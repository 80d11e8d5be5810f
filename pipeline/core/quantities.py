"""Quantities of interest (`pipeline.core.scene.requested_accuracy`) read from a run, and compared between two runs.

Series are compared at the regular output times that both runs have, never interpolated.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.algebra import rotation_between
from flexclear.pipeline.core.scene.requested_accuracy import KINDS, Quantity

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.output import Output
    from flexclear.pipeline.core.scene.schema import TimeSpan

#: two output times are the same when they differ by less than this fraction of the latest: rounding of sums and
#: products only. Times of events are outputs, too, and those of two accurate runs are so near that a coarser measure
#: would take them for one, and the motion in between for an error
SAME_TIME = 1e-13
#: closings with an approach above this count as impacts [m/s]
IMPACT = 1e-4
#: fraction of its clearance by which the perturbed run moves each contact at the start: the order of the offset in
#: ensembles, and far above what an integration at the default tolerance errs by
PERTURBATION = 2e-5
#: neighbouring runs are visibly separated where they differ by this fraction of the largest motion
SEPARATED = 1e-3
#: a separation that lasts for this fraction of the run ends its predictability horizon; an impact that comes a little
#: earlier in one of two runs separates them for its duration only
LASTING = 1.0 / 36.0


def lasting(time: np.ndarray, separated: np.ndarray, least: float) -> int | None:
    """Index of the first time from which on `separated` holds for `least` [s] or to the last time; None without one.

    time [s], separated: shape (n,).
    """
    joined = np.flatnonzero(~separated)
    until = np.append(time[joined], np.inf)[np.searchsorted(joined, np.arange(len(time)))]
    first = np.flatnonzero(separated & (until > time + least))
    return int(first[0]) if len(first) else None


def series(run: xr.Dataset, quantity: Quantity) -> np.ndarray:
    """Values over time, shape (time, components); only of quantities that have a value at every time."""
    kind = KINDS[quantity.kind]
    values: np.ndarray = run[kind.variable].sel({kind.owner: quantity.owner}).values
    return values.reshape(len(values), -1)


#: where a run says of each part whether it pushes or turns, where that is not the quantity's own variable
PUSHES = {"peak_force": "contact_normal_force"}


def unit(run: xr.Dataset, quantity: Quantity) -> str:
    """The SI unit of a quantity in a run: of drives and contacts along a rotation that of a torque or its impulse."""
    kind = KINDS[quantity.kind]
    name = PUSHES.get(quantity.kind, kind.variable)
    if kind.owner not in ("drive", "contact") or quantity.kind == "impact_times" or name not in run:
        return quantity.unit
    if f"{name}_units" in run.coords:
        return str(run[f"{name}_units"].sel({kind.owner: quantity.owner}).values)
    return str(run[name].attrs.get("units") or quantity.unit)


def events(run: xr.Dataset, quantity: Quantity, until: float = np.inf) -> np.ndarray:
    """Impact times [s] or the largest contact force [N] of contacts that begin up to a time [s], shape (n,).

    Or the total normal impulse of the run [N s].
    """
    if quantity.kind == "impulse":
        return series(run, quantity)[-1]
    mine = (run["event_contact"].values == quantity.owner) & (run["event_kind"].values == "closing")
    mine &= run["event_time"].values <= until
    if quantity.kind == "peak_force":
        return np.array([run["event_peak_force"].values[mine].max(initial=0.0)])
    impact = mine & (run["event_approach_speed"].values > IMPACT)
    times: np.ndarray = run["event_time"].values[impact]
    return times


def is_series(quantity: Quantity) -> bool:
    """Whether it has a value at every time."""
    return KINDS[quantity.kind].owner != "contact"


def common_times(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices into a and into b of the times that both have, ascending, each time once."""
    unit = SAME_TIME * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0)) or 1.0
    _, first, second = np.intersect1d(np.round(a / unit), np.round(b / unit), return_indices=True)
    return first, second


def deviation(run: xr.Dataset, reference: xr.Dataset, quantity: Quantity) -> tuple[np.ndarray, np.ndarray]:
    """Common times [s] and the distance of the two runs at each, shape (n,); of a series."""
    i, j = common_times(run["time"].values, reference["time"].values)
    a, b = series(run, quantity)[i], series(reference, quantity)[j]
    distance = rotation_between(a, b) if quantity.kind == "orientation" else np.linalg.norm(a - b, axis=1)
    return run["time"].values[i], distance


def error(run: xr.Dataset, reference: xr.Dataset, quantity: Quantity, until: float = np.inf) -> float:
    """Largest distance between two runs up to a time [s], in the quantity's unit.

    Infinite when the runs differ in the number of impacts before `until`.
    """
    if is_series(quantity):
        time, distance = deviation(run, reference, quantity)
        return float(distance[time <= until].max(initial=0.0))
    if quantity.kind == "impulse":
        i, j = common_times(run["time"].values, reference["time"].values)
        last = max(int(np.searchsorted(run["time"].values[i], until, side="right")) - 1, 0)
        return float(np.abs(series(run, quantity)[i[last]] - series(reference, quantity)[j[last]]).max())
    a, b = events(run, quantity, until), events(reference, quantity, until)
    return float(np.abs(a - b).max(initial=0.0)) if len(a) == len(b) else np.inf


def standard_error(ensemble: xr.Dataset, quantity: Quantity) -> float | None:
    """Largest standard error over time of the mean of the members' values, in the quantity's unit.

    None where an ensemble does not say: events, orientations, and owners that it does not keep.
    """
    kind = KINDS[quantity.kind]
    if kind.variable not in ensemble or quantity.kind == "orientation" or "time" not in ensemble[kind.variable].dims:
        return None
    if quantity.owner not in ensemble[kind.owner].values:
        return None
    values = ensemble[kind.variable].sel({kind.owner: quantity.owner}).transpose("member", "time", ...).values
    spread = np.sqrt(values.var(axis=0, ddof=1).reshape(values.shape[1], -1).sum(axis=1))
    return float(spread.max() / np.sqrt(len(values)))


def scale(run: xr.Dataset, quantity: Quantity) -> float:
    """What a relative error is relative to: the largest change from the start; of forces the largest value.

    For impact times it is the time from the start to the last one.
    """
    if quantity.kind == "impact_times":
        times = events(run, quantity)
        return float(times[-1] - run["time"].values[0]) if len(times) else 0.0
    if not is_series(quantity):
        return float(np.abs(events(run, quantity)).max(initial=0.0))
    values = series(run, quantity)
    if quantity.kind == "orientation":
        return float(rotation_between(values[:1], values).max())
    start = values[:1] if quantity.kind == "position" else 0.0
    return float(np.linalg.norm(values - start, axis=1).max())


def keep(run: xr.Dataset, chosen: Collection[Quantity]) -> xr.Dataset:
    """The part of a run that `error` and `scale` need for these quantities."""
    recorded: dict[str, xr.DataArray] = {}
    for owner in ("body", "joint", "drive"):
        mine = [q for q in chosen if KINDS[q.kind].owner == owner]
        names = sorted({q.owner for q in mine})
        recorded |= {KINDS[q.kind].variable: run[KINDS[q.kind].variable].sel({owner: names}) for q in mine}
    if any(KINDS[q.kind].owner == "contact" for q in chosen):
        recorded |= {str(name): run[name] for name in run.data_vars if str(name).startswith("event_")}
        recorded |= {name: run[name] for name in ("contact_impulse",) if name in run}
    if "horizon" in run:
        recorded["horizon"] = run["horizon"]
    import xarray as xr  # here, since a run needs none of it

    return xr.Dataset(recorded)


def reduced(time: np.ndarray, values: np.ndarray, reduction: str) -> np.ndarray:
    """Recorded values of a series (`pipeline.core.scene.output_quantities`); shape () or (components,).

    time: shape (n,), increasing; its steps are the weights of means.  values: shape (n, components).
    """
    if reduction == "final":
        return np.asarray(values[-1])
    sizes = np.linalg.norm(values, axis=1)
    if reduction == "largest":
        return np.asarray(sizes.max())
    span = time[-1] - time[0]
    if reduction == "rms":
        return np.asarray(np.sqrt(np.trapezoid(sizes**2, time) / span))
    return np.asarray(np.trapezoid(values, time, axis=0) / span)


def of_impacts(times: np.ndarray, reduction: str) -> float:
    """Number of impacts, or time of the first or last one, nan where there is none. times: ascending [s]."""
    if reduction == "count":
        return float(len(times))
    return float(times[0 if reduction == "first" else -1]) if len(times) else np.nan


def regular_times(time: TimeSpan, output: Output) -> np.ndarray:
    """The regular output times of a run, those of breaks and events left out, shape (n,) [s]."""
    count = int(np.floor((time.end - time.start) / output.interval * (1 + 1e-12))) + 1
    return np.asarray(time.start + output.interval * np.arange(count))
