"""Dataset of derivatives of recorded quantities with respect to numbers of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.artifacts.quantities import IMPACT, reduce_series
from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.model.merge import find_frame
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import attributes, subject
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon.exponent import growth, start_direction
from flexclear.dynamics.run.horizon.tangents import Differentiated, differentiate
from flexclear.dynamics.run.run import engine_of, observe_run
from flexclear.dynamics.sensitivity.parameters import Family
from flexclear.dynamics.sensitivity.recipes import Varied
from flexclear.dynamics.sensitivity.series import NORMAL_FORCE, Series, derivatives, read_quantities
from flexclear.scene.event_kinds import CLOSING
from flexclear.scene.load import with_numbers
from flexclear.scene.pairs import Corner
from flexclear.scene.quantity import KINDS, Quantity, Recorded, parse, parse_recorded
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

#: reductions without a derivative
WITHOUT = ("count", "sections")


class Requested(NamedTuple):
    """A quantity to differentiate; over time where it has no reduction."""

    name: str
    quantity: Quantity
    recorded: Recorded | None


def requested_of(scene: Scene, names: Sequence[str]) -> list[Requested]:
    """Return the quantities of these names; raise InputError for one that the scene lacks."""
    result = []
    for name in names:
        try:
            recorded = parse_recorded(name, scene.owners())
            quantity = recorded.quantity
        except ValueError as error:
            try:
                recorded, quantity = None, parse(name, scene.owners())
            except ValueError:
                raise InputError(f"of: '{name}'", str(error)) from None
            if not quantity.over_time:
                raise InputError(f"of: '{name}'", str(error)) from None
        if recorded is not None and recorded.reduction in WITHOUT:
            raise InputError(f"of: '{name}'", f"a {recorded.reduction} has no derivative")
        result.append(Requested(name, quantity, recorded))
    return result


def sensitivities(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    of: Sequence[str],
    to: Sequence[str],
    horizon: float = np.inf,
    varied: Mapping[str, Varied] | None = None,
) -> xr.Dataset:
    """Return derivatives of quantities with respect to numbers of the scene (`flexclear.sensitivities`).

    varied: numbers of recipes among `to`, by path.  horizon: time [s] up to which the motion is predictable; values
    beyond are NaN.  Raises InputError for unknown names, SolverError where the motion has no derivative.
    """
    import xarray as xr

    requested = requested_of(scene, of)
    if scene.solver.integrator != "dop853":
        scene = with_numbers(scene, {"solver.integrator": "dop853", "solver.step": None})
    engine = engine_of(scene, bundles, progress)
    for one in requested:
        for term in one.quantity.terms():
            if KINDS[term.kind].owner == "frame":
                find_frame(engine.model.mechanism.frames, term.owner, f"of: '{one.name}'")
    family = Family(_with_poses_of_run(scene, engine), bundles, engine, varied or {})
    parameters = [family.parameter(path) for path in to]
    directions = [family.direction(parameter) for parameter in parameters]
    start = consistent_start(engine)
    run = differentiate(engine, start, [*(one for one, _ in directions), start_direction(engine, start)], progress)
    _require_smooth_faces(engine, run)
    grown = growth(engine, run, len(directions))
    series = {one.quantity.name: one.quantity for one in requested if one.quantity.over_time}
    values = read_quantities(family, engine, run, series.values())
    columns: dict[str, list[np.ndarray]] = {one.name: [] for one in requested}
    for k, parameter in enumerate(parameters):
        progress((k + 1) / len(parameters), f"quantities by {parameter.path}")
        changes = derivatives(family, run, k, parameter, directions[k][1], series.values())
        for one in requested:
            columns[one.name].append(
                _derivative(one, family.engine.model, run, k, values, changes, horizon) / parameter.unit
            )
    time = run.trajectory.time
    variables = {one.name: _variable(one, np.array(columns[one.name])) for one in requested}
    coordinates: dict[str, Any] = {
        "parameter": list(to),
        "parameter_value": ("parameter", [p.value for p in parameters]),
    }
    if any(one.recorded is None for one in requested):
        coordinates["time"] = ("time", time, {"units": "s", "long_name": "time"})
    facts: dict[str, Any] = attributes(scene) | {"title": f"Sensitivities of {subject(scene)}", "method": METHOD}
    if varied:
        facts["method"] += f"; by differences of reduced bodies for {', '.join(varied)}"
    facts["evaluations"] = run.trajectory.counters["evaluations"]
    facts |= {"exponent": grown.exponent, "exponent_error": grown.error, "tangent_horizon": grown.horizon}
    if np.isfinite(horizon):
        facts |= {"horizon": horizon, "validity": f"up to the predictability horizon, {horizon:.6g} s; beyond it NaN"}
    return xr.Dataset(variables, coordinates, facts)


def _require_smooth_faces(engine: Engine, run: Differentiated) -> None:
    """Raise SolverError where a contact goes from a bounded face to its end, below the edge: its force jumps there."""
    corners = [(c, one.joint) for c, one in enumerate(engine.model.contacts) if isinstance(one.joint, Corner)]
    ended = [(c, corner) for c, corner in corners if corner.end]
    if not ended:
        return
    sites, t = observe_run(engine, run.trajectory).sites, run.trajectory.time
    closed = recording.record(run.trajectory.rows, run.trajectory.contacts).modes == 1
    for c, corner in ended:
        outer, inner = (sites[:, engine.model.arrays.table(m.CONTACTS)[side][c]] for side in ("outer", "inner"))
        place = np.einsum("tji,tj->ti", outer["axes"], inner["origin"] - outer["origin"])
        past, height = np.abs(place[:, 0]) - corner.end, place[:, 2]
        # about the edge the force turns steadily for centres outside of it
        inside = np.maximum(past, height) < 1e-9 * corner.end
        jumps = np.diff(height >= past) & (inside[1:] | inside[:-1]) & (closed[1:, c] | closed[:-1, c])
        if np.any(jumps):
            raise SolverError(
                f"contact '{engine.model.contacts[c].name}': its corner is pressed past the end of the face at t = "
                f"{t[1:][jumps][0]:.6g} s, where the force turns at once and the motion has no derivative; give the "
                "joint a corner_radius above the penetration"
            )


def _with_poses_of_run(scene: Scene, engine: Engine) -> Scene:
    """Return the scene with the poses of its run, from which equilibria of changed scenes are sought.

    From further away each search would end elsewhere along motions that no force resists.
    """
    if scene.start is None or scene.start.at != "equilibrium":
        return scene
    return scene.model_copy(update={"body": engine.model.scene.body})


METHOD = "variational equations of the tangent of the equations of motion, with the jumps of impacts"


def _variable(one: Requested, values: np.ndarray) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
    quantity, recorded = one.quantity, one.recorded
    inner = (quantity.dim,) if quantity.dim else ()
    dims = ("time", *inner) if recorded is None else recorded.dims
    unit = quantity.unit if recorded is None else recorded.unit
    about = {"units": unit, "long_name": f"derivative of {one.name}, per SI unit of the parameter"}
    return ("parameter", *dims), values, about


def _derivative(
    one: Requested, model: Model, run: Differentiated, k: int, values: Series, changes: Series, horizon: float
) -> np.ndarray:
    """Return the derivative along direction k, NaN beyond the horizon."""
    time, recorded = run.trajectory.time, one.recorded
    if recorded is None:
        change = np.where(time[:, None] <= horizon, changes[one.quantity.name], np.nan)
        return change if one.quantity.dim else change[:, 0]
    if not one.quantity.over_time:
        at, value = _derivative_of_contact(one, model, run, k, values, changes)
        return np.asarray(value if at <= horizon else np.nan)
    if recorded.reduction == "series":
        raise InputError(f"of: '{one.name}'", "is over time", f"write {one.quantity.name}")
    series, change = values[one.quantity.name], changes[one.quantity.name]
    if recorded.reduction == "largest":
        at, value = _derivative_of_largest(time, series, change)
        return np.asarray(value if at <= horizon else np.nan)
    # step for the derivative of reductions, smooth functions of their series, as a fraction of the largest change
    step = 1e-6 * (np.abs(series).max(initial=0.0) or 1.0) / (np.abs(change).max(initial=0.0) or 1.0)
    ends = [reduce_series(time, series + sign * step * change, recorded.reduction) for sign in (-1.0, 1.0)]
    result = np.asarray((ends[1] - ends[0]) / (2.0 * step))
    result = result if time[-1] <= horizon else np.full_like(result, np.nan)
    return result if result.ndim == 0 or one.quantity.dim else result[..., 0]


def _derivative_of_largest(time: np.ndarray, series: np.ndarray, change: np.ndarray) -> tuple[float, float]:
    """Return the time of the largest magnitude, and the derivative of that magnitude.

    The maximum of a function of time changes as the function does at the time of the maximum. That time, and the change
    there, are those of parabolas through the largest row and its neighbours.
    """
    sizes = np.linalg.norm(series, axis=1)
    changes = np.einsum("tc,tc->t", series, change) / np.where(sizes > 0.0, sizes, 1.0)
    k = int(np.argmax(sizes))
    if not 0 < k < len(time) - 1:
        return float(time[k]), float(changes[k])
    rows = slice(k - 1, k + 2)
    bend, slope, _ = np.polyfit(time[rows] - time[k], sizes[rows], 2)
    later = float(np.clip(-0.5 * slope / bend, time[k - 1] - time[k], time[k + 1] - time[k])) if bend < 0.0 else 0.0
    return float(time[k] + later), float(np.polyval(np.polyfit(time[rows] - time[k], changes[rows], 2), later))


def _derivative_of_contact(
    one: Requested, model: Model, run: Differentiated, k: int, values: Series, changes: Series
) -> tuple[float, float]:
    """Return the time up to which the motion determines a contact's result, and the derivative of the result."""
    assert one.recorded is not None
    trajectory, events = run.trajectory, run.trajectory.events
    contact = [c.name for c in model.contacts].index(one.quantity.owner)
    if one.quantity.kind == "impulse":
        slot = model.speeds.stop + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * contact
        return float(trajectory.time[-1]), float(run.changes[-1, k, slot + m.CONTACT_LEDGER.impulse])
    own = (events["contact"] == contact) & (events["kind"] == CLOSING)
    if one.quantity.kind == "impact_times":
        hits = np.flatnonzero(own & (events["speed"] > IMPACT))
        if not len(hits):
            return 0.0, np.nan
        hit = hits[0 if one.recorded.reduction == "first" else -1]
        return float(events["time"][hit]), float(run.event_times[hit, k])
    closings = events[own]
    if not len(closings):
        return 0.0, np.nan
    strongest = closings[np.argmax(closings["peak_force"])]
    until = strongest["time"] + (strongest["duration"] if np.isfinite(strongest["duration"]) else np.inf)
    during = np.flatnonzero((trajectory.time >= strongest["time"]) & (trajectory.time <= until))
    row = during[np.argmax(values[NORMAL_FORCE][during, contact])]
    return float(trajectory.time[row]), float(changes[NORMAL_FORCE][row, contact])
