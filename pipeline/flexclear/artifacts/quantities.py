"""Quantities of interest (`scene.quantity`) read from a run, and compared between two runs.

Series are compared at the regular output times that both runs have, never interpolated.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.artifacts.coordinates import ROTATION
from flexclear.numerics.rotations import rotation_between
from flexclear.scene.expression import fold
from flexclear.scene.quantity import COMPONENTS, KINDS, Quantity, as_written, parse
from flexclear.scene.run_schema import RUN
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled
    from flexclear.scene.output import Output
    from flexclear.scene.schema import TimeSpan

#: two output times are the same when they differ by less than this fraction of the latest: by rounding only. Times of
#: events are outputs, too. In two accurate runs they are so close that a coarser measure would identify them, and count
#: the motion in between as an error
SAME_TIME = 1e-13
#: closings with an approach above this count as impacts [m/s]
IMPACT = 1e-4
#: fraction of its clearance by which the perturbed run moves each contact at the start: of the order of the offset in
#: ensembles, and far above the error of an integration at the default tolerance
PERTURBATION = 2e-5
#: fraction of the largest motion by which visibly separated neighbouring runs differ
SEPARATED = 1e-3
#: fraction by which diverged runs differ: between 0.01 and 0.05 its value changes the horizon of none of 40 scenes, and
#: the least ends perturbed runs first
DIVERGED = 0.01
#: fraction of the run for which a separation must last to count; an impact that occurs slightly earlier in one of two
#: runs separates them only for its duration
LASTING = 1.0 / 36.0


def indices_of_lasting(time: np.ndarray, separated: np.ndarray, least: float) -> np.ndarray:
    """Return the indices of the times from which `separated` holds for at least `least` [s] or to the last time.

    time [s], separated: shape (n,).
    """
    joined = np.flatnonzero(~separated)
    until = np.append(time[joined], np.inf)[np.searchsorted(joined, np.arange(len(time)))]
    return np.flatnonzero(separated & (until > time + least))


def index_of_divergence(time: np.ndarray, separation: np.ndarray, span: float) -> int | None:
    """Return the index of the first time at which two runs diverge, assumed to be final; None where they do not.

    time [s], separation (fraction of the largest motion): shape (n,). span: duration of the whole run [s].
    """
    return next(iter(indices_of_lasting(time, separation > DIVERGED, LASTING * span).tolist()), None)


def index_of_separation(time: np.ndarray, separation: np.ndarray, span: float) -> int | None:
    """Return the index of the time from which two runs are visibly separated; None where they stay close.

    From there on they are separated most of the time, until they diverge or end: damped motions forget an impact after
    some others, and such a temporary difference does not count. Arguments: as in `index_of_divergence`.
    """
    diverged = index_of_divergence(time, separation, span)
    if diverged is not None:
        time, separation = time[: diverged + 1], separation[: diverged + 1]
    visible = separation > SEPARATED
    left = np.cumsum(visible[::-1])[::-1]  # number of visibly separated outputs from each time on
    starts = indices_of_lasting(time, visible, LASTING * span)
    return next(iter(starts[2 * left[starts] > len(time) - starts].tolist()), None)


def series(run: Labelled, quantity: Quantity) -> np.ndarray:
    """Return values over time [SI], shape (time, components), of a quantity that has a value at every time."""
    return (
        evaluate_postfix(quantity.steps, lambda one: _of_part(run, one)) if quantity.steps else _of_part(run, quantity)
    )


def evaluate_postfix(steps: Sequence[Any], read: Callable[[Any], np.ndarray]) -> np.ndarray:
    """Return the values of an expression in postfix order from those of its quantities, (n, components)."""
    return fold(
        steps,
        lambda step: np.full((1, 1), step[0]) if isinstance(step, tuple) else read(step),
        lambda operator, operands: _OPERATORS[operator](*operands),
    )


_OPERATORS: dict[str, Callable[..., np.ndarray]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
    "minus": np.negative,
    "norm": lambda a: np.linalg.norm(a, axis=1, keepdims=True),
    "max": np.maximum,
    "min": np.minimum,
    "step": lambda a: np.heaviside(a, 1.0),
    **{name: getattr(np, name) for name in ("abs", "sqrt", "sin", "cos", "tan", "exp", "log", "tanh", "sign")},
}


def _of_part(run: Labelled, quantity: Quantity) -> np.ndarray:
    kind = KINDS[quantity.kind]
    if kind.variable not in run:
        raise InputError(f"quantity '{quantity.name}'", f"the run has no variable '{kind.variable}'")
    values: np.ndarray = run[kind.variable].values
    if kind.owner == "section":  # at each time the section of the body with the largest value
        of_body = values[:, run["section_body"].values == quantity.owner].reshape(len(values), -1, 3 if kind.dim else 1)
        largest = np.argmax(np.linalg.norm(of_body, axis=2), axis=1)
        values = np.take_along_axis(of_body, largest[:, None, None], axis=1)
    elif kind.owner:
        values = values[:, run[kind.owner].values.tolist().index(quantity.owner)]
    values = values.reshape(len(values), -1)
    return values[:, [COMPONENTS.index(quantity.component)]] if quantity.component else values


def evaluate(run: xr.Dataset, text: str) -> xr.DataArray:
    """Return a quantity of a run by its name, over time, with its unit; for contacts of each event, or of the run.

    text: as in `[view] watch` (`scene.quantity`). Raises InputError for a quantity that the run lacks.
    """
    import xarray as xr  # here, since a run needs none of it

    try:
        quantity = parse(text, owners(run))
    except ValueError as error:
        raise InputError(f"quantity '{text}'", str(error)) from None
    attributes = {"units": unit(run, quantity), "long_name": quantity.name}
    if not quantity.over_time:
        return xr.DataArray(np.squeeze(contact_values(run, quantity)), name=quantity.name, attrs=attributes)
    values, dim = series(run, quantity), quantity.dim
    shown, dims = (values, ("time", dim)) if dim else (values[:, 0], ("time",))
    return xr.DataArray(shown, {name: run[name].variable for name in dims}, dims, quantity.name, attributes)


def owners(run: xr.Dataset) -> dict[str, dict[str, bool]]:
    """Return names of a run's components by kind, and whether each acts about an axis, as `parse` takes them."""
    known: dict[str, dict[str, bool]] = {"": {}}
    for dim in {kind.owner for kind in KINDS.values()} - {""}:
        names = "section_body" if dim == "section" else dim
        if names in run.coords:
            turns = (
                run[f"{dim}_motion"].values == ROTATION if f"{dim}_motion" in run.coords else [False] * run.sizes[dim]
            )
            known[dim] = dict(zip(map(str, run[names].values), map(bool, turns), strict=True))
    known[""] = {key: False for key, kind in KINDS.items() if not kind.owner and kind.variable in run}
    return known


def has_quantity(run: xr.Dataset, quantity: Quantity) -> bool:
    """Return True when a run holds this quantity."""
    known = owners(run)
    return quantity.is_there(known) and all(KINDS[term.kind].variable in run for term in quantity.terms())


#: variable whose units say whether a component exerts a force or a torque, where it is not the quantity's own
PUSHES = {"peak_force": "contact_normal_force"}


def unit(run: xr.Dataset, quantity: Quantity) -> str:
    """Return the SI unit of a quantity in a run: for components that act along a rotation that of a torque."""
    kind = KINDS[quantity.kind]
    name = PUSHES.get(quantity.kind, kind.variable)
    if f"{name}_units" in run.coords:
        return as_written(str(run[f"{name}_units"].sel({kind.owner: quantity.owner}).values))
    turns = (
        kind.units[0] != kind.units[1] and name in run and run[name].attrs.get("units") == RUN[kind.variable].turning
    )
    return kind.units[1] if turns else quantity.unit


def contact_values(run: Labelled, quantity: Quantity, until: float = np.inf) -> np.ndarray:
    """Return impact times [s], or the largest contact force [N], of contacts that begin up to `until` [s], shape (n,).

    For `impulse` return the total normal impulse of the run [N s].
    """
    if quantity.kind == "impulse":
        return series(run, quantity)[-1]
    selected = (run["event_contact"].values == quantity.owner) & (run["event_kind"].values == "closing")
    selected &= run["event_time"].values <= until
    if quantity.kind == "peak_force":
        return np.array([run["event_peak_force"].values[selected].max(initial=0.0)])
    impact = selected & (run["event_approach_speed"].values > IMPACT)
    times: np.ndarray = run["event_time"].values[impact]
    return times


def running_extremes(run: Labelled, quantity: Quantity, rows: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the largest force of the contacts that began up to each row's time [N], or the impulse [N s], (row,).

    time: of all rows [s].
    """
    if quantity.kind == "impulse":
        return series(run, quantity)[rows].ravel()
    mine = (run["event_contact"].values == quantity.owner) & (run["event_kind"].values == "closing")
    begun, peak = run["event_time"].values[mine], run["event_peak_force"].values[mine]
    order = np.argsort(begun, kind="stable")
    largest = np.maximum.accumulate(np.append(0.0, peak[order]))
    return np.asarray(largest[np.searchsorted(begun[order], time[rows], side="right")])


def common_times(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return indices into a and into b of the times that both contain, ascending, each time once."""
    unit = SAME_TIME * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0)) or 1.0
    _, first, second = np.intersect1d(np.round(a / unit), np.round(b / unit), return_indices=True)
    return first, second


def deviation(run: Labelled, reference: Labelled, quantity: Quantity) -> tuple[np.ndarray, np.ndarray]:
    """Return common times [s] and the distance of two runs at each, shape (n,), of a quantity over time."""
    i, j = common_times(run["time"].values, reference["time"].values)
    a, b = series(run, quantity)[i], series(reference, quantity)[j]
    distance = rotation_between(a, b) if quantity.kind == "orientation" else np.linalg.norm(a - b, axis=1)
    return run["time"].values[i], distance


def largest_distance(run: Labelled, reference: Labelled, quantity: Quantity, until: float = np.inf) -> float:
    """Return the largest distance between two runs up to a time [s], in the quantity's unit.

    The error is infinite when the runs differ in the number of impacts before `until`.
    """
    if quantity.over_time:
        time, distance = deviation(run, reference, quantity)
        return float(distance[time <= until].max(initial=0.0))
    if quantity.kind == "impulse":
        i, j = common_times(run["time"].values, reference["time"].values)
        last = max(int(np.searchsorted(run["time"].values[i], until, side="right")) - 1, 0)
        return float(np.abs(series(run, quantity)[i[last]] - series(reference, quantity)[j[last]]).max())
    a, b = contact_values(run, quantity, until), contact_values(reference, quantity, until)
    return float(np.abs(a - b).max(initial=0.0)) if len(a) == len(b) else np.inf


def scale(run: Labelled, quantity: Quantity) -> float:
    """Return the reference of relative errors: the largest change from the start; for forces the largest value.

    For impact times it is the time from the start to the last impact.
    """
    if quantity.kind == "impact_times":
        times = contact_values(run, quantity)
        return float(times[-1] - run["time"].values[0]) if len(times) else 0.0
    if not quantity.over_time:
        return float(np.abs(contact_values(run, quantity)).max(initial=0.0))
    values = series(run, quantity)
    if quantity.kind == "orientation":
        return float(rotation_between(values[:1], values).max())
    start = values[:1] if quantity.of_place else 0.0
    return float(np.linalg.norm(values - start, axis=1).max())


def natural_size(run: Labelled, unit: str) -> float:
    """Return the size that a mechanism's motion gives a length, speed, force or torque [SI]; 0 for other units.

    Length: the extent of all frames and centres of mass. Speed: the largest of a centre of mass, or of a point at that
    distance. Force: the kinetic energy over the extent; torque: the kinetic energy. Tiny fractions of it are rounding.
    """
    points = np.concatenate([run["frame_position"].values, run["position"].values], axis=1).reshape(-1, 3)
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    if unit == "m":
        return extent
    if unit == "m/s":
        turning, speed = (np.abs(run[name].values).max(initial=0.0) for name in ("angular_velocity", "velocity"))
        return float(max(speed, turning * extent))
    energy = float(run["kinetic"].values.max())
    return energy if unit == "N m" else energy / extent if unit == "N" and extent > 0.0 else 0.0


def select_variables(run: xr.Dataset, chosen: Collection[Quantity]) -> xr.Dataset:
    """Return the part of a run that `largest_distance` and `scale` need for these quantities."""
    recorded: dict[str, xr.DataArray] = {}
    terms = [term for quantity in chosen for term in quantity.terms()]
    for kind in {KINDS[term.kind] for term in terms if term.kind not in ("peak_force", "impact_times")}:
        names = sorted({term.owner for term in terms if KINDS[term.kind].owner == kind.owner})
        whole = kind.owner in ("", "section")
        recorded[kind.variable] = run[kind.variable] if whole else run[kind.variable].sel({kind.owner: names})
    if any(not term.over_time for term in terms):
        recorded |= {str(name): run[name] for name in run.data_vars if str(name).startswith("event_")}
    if "horizon" in run:
        recorded["horizon"] = run["horizon"]
    import xarray as xr  # here, since a run needs none of it

    return xr.Dataset(recorded)


def reduce_series(time: np.ndarray, values: np.ndarray, reduction: str) -> np.ndarray:
    """Return the recorded value of a series (`scene.quantity`), shape () or (components,).

    time: shape (n,), increasing; its steps are the weights of means. values: shape (n, components).
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
    """Return the number of impacts, or the time of the first or last, NaN without impacts. times: ascending [s]."""
    if reduction == "count":
        return float(len(times))
    return float(times[0 if reduction == "first" else -1]) if len(times) else np.nan


def regular_times(time: TimeSpan, output: Output) -> np.ndarray:
    """Return the regular output times of a run, without breaks and events, shape (n,) [s]."""
    count = int(np.floor((time.end - time.start) / output.interval * (1 + 1e-12))) + 1
    return np.asarray(time.start + output.interval * np.arange(count))
