"""The run dataset (schema RUN) of a trajectory."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import RUN, conform
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.assembly.loading import LEDGER, order
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.integrate import state
from pipeline.dynamics.integrate.trajectory import Trajectory
from pipeline.dynamics.record.coordinates import joint_coordinates
from pipeline.dynamics.record.motion import body_motions, frame_positions, link_motions, modal, quaternions
from pipeline.dynamics.record.topology import topology
from pipeline.dynamics.record.wrenches import joint_wrenches
from pipeline.dynamics.run import Run
from pipeline.dynamics.tables import (
    CONTACT_LOSS,
    FRICTION_POWER,
    GAP,
    NORMAL_FORCE,
    RATE,
    TOUCH_FORCE,
    TOUCH_OFFSET,
    TOUCH_SIZE,
)

Seen = dict[str, np.ndarray]
Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


def dataset(run: Run) -> xr.Dataset:
    """All that is recorded of a run (schema RUN)."""
    built, trajectory, seen = run.engine.built, run.trajectory, run.observed
    variables: Variables = {}
    coordinates: dict[str, object] = {"time": trajectory.time}
    _motion(built, seen, variables, coordinates)
    _modes(built, seen, variables, coordinates)
    _drives(built, seen, variables, coordinates)
    _joint_coordinates(built, seen, variables, coordinates)
    if built.system.scene.forces():
        _loads(built, seen, variables, coordinates)
    if built.system.contacts:
        _contacts(built, seen, variables, coordinates)
        _events(trajectory, variables)
    if run.twin is not None:
        coordinates["twin_time"] = run.twin.time
        variables["twin_separation"] = (("twin_time",), run.twin.separation)
        variables["horizon"] = ((), np.array(run.twin.horizon))
    _ledger(built, seen, variables)
    topological, named = topology(run.engine, trajectory, seen, list(run.scene.joint))
    made = xr.Dataset(variables | topological, coords=coordinates | named)
    result = conform(made, RUN, **attributes(run.scene), **_report(run), **_counts(run))
    if "event_kind" in result:
        result["event_kind"].attrs |= {
            "flag_values": np.array([0, 1], dtype=np.int8),
            "flag_meanings": "opening closing",
        }
    return result


def attributes(scene: Scene) -> dict[str, str]:
    """What the run was made from: parameters, assumptions, sources, versions; no times, no paths."""
    parameters = scene.model_dump(mode="json", exclude={"title", "description"}, exclude_none=True)
    for body in scene.flexible():
        parameters["body"][body]["mesh"] = Path(parameters["body"][body]["mesh"]).name
    return {
        "scene": scene.name,
        "parameters": json.dumps(parameters, sort_keys=True),
        "assumptions": json.dumps(scene.assumptions(), sort_keys=True),
        "sources": json.dumps(scene.sources(), sort_keys=True),
        "versions": " ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy", "xarray")),
    }


def _report(run: Run) -> dict[str, float | int]:
    found: dict[str, float | int] = {
        **run.trajectory.counters,
        "largest_drift_before_projection": run.trajectory.drift,
        "closure_residual_of_given_start": run.start_residual,
    }
    return found if run.twin is None else found | {"twin_perturbation": run.twin.perturbation}


def _counts(run: Run) -> dict[str, str | int]:
    """Redundancy, in words for the attributes."""
    redundant = run.engine.mobility.redundant
    found: dict[str, str | int] = {"redundant_closure_rows": redundant}
    if redundant:
        found["redundant_reactions"] = "one of many solutions: closure rows that follow from the others carry nothing"
    return found


def _motion(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    origin = built.system.origin
    links = link_motions(built, seen["link_frame"])
    bodies = body_motions(built, seen, links)
    frames = frame_positions(built, seen, links)
    coordinates["body"] = list(bodies)

    def stacked(parts: list[np.ndarray]) -> np.ndarray:
        return np.stack(parts, axis=1)

    dims = ("time", "body", "axis")
    every = list(bodies.values())
    variables["position"] = (dims, stacked([m.p + origin for m in every]))
    variables["quaternion"] = (("time", "body", "quat"), stacked([quaternions(m.R) for m in every]))
    variables["velocity"] = (dims, stacked([m.v for m in every]))
    variables["angular_velocity"] = (dims, stacked([m.omega for m in every]))
    variables["acceleration"] = (dims, stacked([m.a for m in every]))
    variables["angular_acceleration"] = (dims, stacked([m.alpha for m in every]))
    rows = len(seen["status"])
    coordinates["frame"] = list(frames)
    variables["frame_position"] = (
        ("time", "frame", "axis"),
        stacked([p + origin for p in frames.values()]) if frames else np.zeros((rows, 0, 3)),
    )
    wrenches = joint_wrenches(built, seen, bodies, frames)
    coordinates["joint"] = list(wrenches)
    for name, part in (("joint_moment", 0), ("joint_force", 1)):
        values = [w[part] for w in wrenches.values()]
        variables[name] = (("time", "joint", "axis"), stacked(values) if values else np.zeros((rows, 0, 3)))


def _modes(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    if not built.layout.modes:
        return
    states = {str(built.system.links[i].flexible): modal(built, i, seen) for i in sorted(built.layout.modes)}
    owners = [name for name, s in states.items() for _ in range(s.q.shape[1])]
    numbers = [k + 1 for s in states.values() for k in range(s.q.shape[1])]
    coordinates["mode"] = np.arange(len(owners))
    coordinates["mode_body"] = ("mode", owners)
    coordinates["mode_number"] = ("mode", np.array(numbers))
    variables["modal_coordinate"] = (("time", "mode"), np.concatenate([s.q for s in states.values()], axis=1))
    variables["modal_velocity"] = (("time", "mode"), np.concatenate([s.u for s in states.values()], axis=1))


def _drives(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    names = built.system.drives
    if not names:
        return
    sign_of = {name: link.stage.sign for link in built.system.links if link.stage for name in link.drives}
    signs = np.array([sign_of[name] for name in names])
    coordinates["drive"] = names
    variables["drive_force"] = (("time", "drive"), signs * seen["drive_force"])
    variables["drive_position"] = (("time", "drive"), signs * seen["coordinate"][:, built.layout.nq :])


def _joint_coordinates(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    found = joint_coordinates(built, seen)
    if found:
        coordinates["coordinate"] = list(found)
        for k, name in enumerate(("joint_position", "joint_velocity", "joint_acceleration")):
            variables[name] = (("time", "coordinate"), np.stack([series[k] for series in found.values()], axis=1))


def _loads(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    from pipeline.dynamics.record.loads import load_series

    coordinates["load"] = order(built.system.scene)
    variables.update(load_series(built, seen))


def _contacts(built: Tables, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    touch = seen["touch"].reshape(len(seen["touch"]), -1, TOUCH_SIZE)
    coordinates["contact"] = [name for name, *_ in built.system.contacts]
    scalars = {
        "contact_gap": touch[..., GAP],
        "contact_penetration": np.maximum(0.0, -touch[..., GAP]),
        "contact_rate": touch[..., RATE],
        "contact_normal_force": touch[..., NORMAL_FORCE],
        "contact_friction_power": touch[..., FRICTION_POWER],
    }
    variables.update({name: (("time", "contact"), values) for name, values in scalars.items()})
    for name, o in (("contact_force", TOUCH_FORCE), ("contact_offset", TOUCH_OFFSET)):
        variables[name] = (("time", "contact", "axis"), touch[..., o : o + 3])


def _events(trajectory: Trajectory, variables: Variables) -> None:
    e = trajectory.events
    columns = {
        "event_time": e[:, state.EVENT_TIME],
        "event_contact": e[:, state.EVENT_CONTACT].astype(np.int32),
        "event_kind": (e[:, state.EVENT_KIND] == state.CLOSING).astype(np.int8),
        "event_approach_speed": e[:, state.SPEED],
        "event_peak_force": e[:, state.PEAK_FORCE],
        "event_peak_penetration": e[:, state.PEAK_DEPTH],
        "event_duration": e[:, state.DURATION],
    }
    variables.update({name: (("event",), values) for name, values in columns.items()})


def _ledger(built: Tables, seen: Seen, variables: Variables) -> None:
    names = built.system.scene.forces()
    ledger = seen["state"][:, built.layout.nq + built.layout.nv :]
    kinetic, potential, elastic = seen["energy"].T
    # ledger: work of the drives, loss of modal damping, per contact its normal and friction losses; then, where
    # there are loads, their work, their losses, and the angles that some of them follow
    losses = CONTACT_LOSS + 2 * len(built.system.contacts)
    assert ledger.shape[1] == losses + (LEDGER + built.packed.sizes["N_TURNS"] if names else 0)
    work, dissipated = ledger[:, 0], ledger[:, 1:losses].sum(axis=1)
    load_work = ledger[:, losses] if names else np.zeros(len(ledger))
    if names:
        dissipated = dissipated + ledger[:, losses + 1]
        variables["load_work"] = (("time",), load_work)
    balance = kinetic + potential + elastic + dissipated - work - load_work
    series = {
        "kinetic": kinetic,
        "potential": potential,
        "elastic": elastic,
        "dissipated": dissipated,
        "drive_work": work,
        "energy_error": balance - balance[0],
        "constraint_error": seen["residual"][:, 0],
    }
    variables.update({name: (("time",), values) for name, values in series.items()})
