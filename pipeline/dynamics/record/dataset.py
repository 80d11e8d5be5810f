"""The run dataset (schema RUN) of a trajectory."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import RUN, conform
from pipeline.core.registry import lookup
from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.record.motion import body_motions, frame_positions, link_motions, modal, quaternions
from pipeline.dynamics.record.topology import topology
from pipeline.dynamics.record.wrenches import joint_wrenches
from pipeline.dynamics.run import ledger
from pipeline.dynamics.run.coordinates import joint_coordinates
from pipeline.dynamics.run.run import Run
from pipeline.dynamics.run.trajectory import Trajectory

#: event kinds by their flag values; 0 and 1 as ever
EVENT_KINDS = ("opening", "closing", "compression", "sticking", "slipping")
_FLAGS = {
    m.OPENING: "opening",
    m.CLOSING: "closing",
    m.COMPRESSION: "compression",
    m.STICKING: "sticking",
    m.SLIPPING: "slipping",
}

Seen = dict[str, np.ndarray]
Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


def dataset(run: Run) -> xr.Dataset:
    """All that is recorded of a run (schema RUN)."""
    model, trajectory, seen = run.engine.model, run.trajectory, run.observed
    variables: Variables = {}
    coordinates: dict[str, object] = {"time": trajectory.time}
    _motion(model, seen, variables, coordinates)
    _modes(model, seen, variables, coordinates)
    _drives(model, seen, run.scene, variables, coordinates)
    _joint_coordinates(model, seen, variables, coordinates)
    if model.scene.forces():
        _loads(model, seen, variables, coordinates)
    if model.mechanism.contacts:
        _contacts(model, seen, variables, coordinates)
        _events(trajectory, variables)
    if run.twin is not None:
        coordinates["twin_time"] = run.twin.time
        variables["twin_separation"] = (("twin_time",), run.twin.separation)
        variables["horizon"] = ((), np.array(run.twin.horizon))
    for name, asked in run.scene.output.requests().items():
        record = lookup("pipeline.dynamics.record", name, where="[output]")
        record(model, seen, asked, variables, coordinates)
    variables.update(ledger.series(model, seen))
    topological, named = topology(run.engine, trajectory, seen, list(run.scene.joint))
    made = xr.Dataset(variables | topological, coords=coordinates | named)
    result = conform(made, RUN, **attributes(run.scene), **_report(run), **_counts(run), **_told(model, trajectory))
    if "event_kind" in result:
        result["event_kind"].attrs |= {
            "flag_values": np.arange(len(EVENT_KINDS), dtype=np.int8),
            "flag_meanings": " ".join(EVENT_KINDS),
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


def _told(model: Model, trajectory: Trajectory) -> dict[str, str]:
    """Laws of the contacts, and in words what is to be doubted."""
    told = "\n".join(warnings(model, trajectory))
    if not model.mechanism.contacts:
        return {"warnings": told} if told else {}
    from pipeline.dynamics.contact import validity

    return {"contacts": validity.laws(model.mechanism.contacts, model.laws), "warnings": told}


def warnings(model: Model, trajectory: Trajectory) -> list[str]:
    """Sentences about what a run is to be doubted for."""
    return [*_contact_warnings(model, trajectory), *_step_warnings(model, trajectory)]


def _step_warnings(model: Model, trajectory: Trajectory) -> list[str]:
    """Fixed steps are not made shorter where the method is unstable: what happens there is not resolved."""
    solver, stiff = model.scene.solver, trajectory.counters.get("stiff_steps", 0)
    if solver.step is None or not stiff:
        return []
    return [
        f"{stiff} of {trajectory.counters['steps']} steps of {solver.step:g} s were too long for {solver.integrator} "
        f"to be stable: the equations have rates up to {trajectory.steepest:.2g} 1/s, as the slope of friction at "
        "small sliding speeds has; a shorter step or an implicit integrator resolves that"
    ]


def _contact_warnings(model: Model, trajectory: Trajectory) -> list[str]:
    """Sentences about contacts that left the range for which their laws were made."""
    if not model.mechanism.contacts:
        return []
    from pipeline.dynamics.contact import validity

    e, found = trajectory.events, []
    for c, ((name, joint, _, _), law) in enumerate(zip(model.mechanism.contacts, model.laws, strict=True)):
        mine = e[e[:, m.EVENT.contact] == c]
        depth, force = np.fmax.reduce(mine[:, [m.EVENT.peak_depth, m.EVENT.peak_force]], axis=0, initial=0.0)
        found += validity.warnings(name, joint, law, float(depth), float(force))
    return found


def _report(run: Run) -> dict[str, float | int]:
    counters = run.trajectory.counters
    found: dict[str, float | int] = {
        **counters,
        "stiff_share": counters.get("stiff_steps", 0) / max(1, counters.get("steps", 0)),
        "largest_rate": run.trajectory.steepest,
        "largest_drift_before_projection": run.trajectory.drift,
        "largest_rate_drift_before_projection": run.trajectory.rate_drift,
        "closure_residual_of_given_start": run.start_residual,
    }
    return found if run.twin is None else found | {"twin_perturbation": run.twin.perturbation}


def _counts(run: Run) -> dict[str, str | int]:
    """Redundancy, and the integrator that made the run, in words for the attributes."""
    redundant = run.engine.mobility.redundant
    found: dict[str, str | int] = {"redundant_closure_rows": redundant}
    found["method"] = run.engine.model.scene.solver.integrator
    if run.switched:
        found["switched"] = run.switched
    if redundant:
        found["redundant_reactions"] = "one of many solutions: closure rows that follow from the others carry nothing"
    return found


def _motion(model: Model, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    origin = model.mechanism.origin
    links = link_motions(model, seen["link_frame"])
    bodies = body_motions(model, seen, links)
    frames = frame_positions(model, seen, links)
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
    wrenches = joint_wrenches(model, seen, bodies, frames)
    coordinates["joint"] = list(wrenches)
    for name, part in (("joint_moment", 0), ("joint_force", 1)):
        values = [w[part] for w in wrenches.values()]
        variables[name] = (("time", "joint", "axis"), stacked(values) if values else np.zeros((rows, 0, 3)))


def _modes(model: Model, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    if not model.numbering.modes:
        return
    states = {str(model.mechanism.links[i].flexible): modal(model, i, seen) for i in sorted(model.numbering.modes)}
    owners = [name for name, s in states.items() for _ in range(s.q.shape[1])]
    numbers = [k + 1 for s in states.values() for k in range(s.q.shape[1])]
    coordinates["mode"] = np.arange(len(owners))
    coordinates["mode_body"] = ("mode", owners)
    coordinates["mode_number"] = ("mode", np.array(numbers))
    variables["modal_coordinate"] = (("time", "mode"), np.concatenate([s.q for s in states.values()], axis=1))
    variables["modal_velocity"] = (("time", "mode"), np.concatenate([s.u for s in states.values()], axis=1))


def _drives(model: Model, seen: Seen, scene: Scene, variables: Variables, coordinates: dict[str, object]) -> None:
    names = model.mechanism.drives
    if not names:
        return
    sign_of = {name: link.stage.sign for link in model.mechanism.links if link.stage for name in link.drives}
    signs = np.array([sign_of[name] for name in names])
    coordinates["drive"] = names
    force, position = signs * seen["drive_force"], signs * seen["coordinate"][:, model.numbering.nq :]
    sharing = [name for name in model.scene.forces() if name not in scene.load]
    if sharing:  # actuators beyond the freedoms, which the engine has as loads
        from pipeline.dynamics.record.loads import along_coordinates

        coordinates["drive"] = [*names, *sharing]
        known = joint_coordinates(model, seen)
        force = np.concatenate([force, along_coordinates(model, seen, sharing)], axis=1)
        position = np.concatenate([position, np.stack([known[name][0] for name in sharing], axis=1)], axis=1)
    variables["drive_force"] = (("time", "drive"), force)
    variables["drive_position"] = (("time", "drive"), position)


def _joint_coordinates(model: Model, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    found = joint_coordinates(model, seen)
    if found:
        coordinates["coordinate"] = list(found)
        for k, name in enumerate(("joint_position", "joint_velocity", "joint_acceleration")):
            variables[name] = (("time", "coordinate"), np.stack([series[k] for series in found.values()], axis=1))


def _loads(model: Model, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    from pipeline.dynamics.record.loads import load_series

    coordinates["load"] = list(model.scene.forces())
    variables.update(load_series(model, seen))


def _contacts(model: Model, seen: Seen, variables: Variables, coordinates: dict[str, object]) -> None:
    touch = seen["touch"].reshape(len(seen["touch"]), -1, m.TOUCH.size)
    coordinates["contact"] = [name for name, *_ in model.mechanism.contacts]
    scalars = {
        "contact_gap": touch[..., m.TOUCH.gap],
        "contact_penetration": np.maximum(0.0, -touch[..., m.TOUCH.gap]),
        "contact_rate": touch[..., m.TOUCH.rate],
        "contact_normal_force": touch[..., m.TOUCH.normal_force],
        "contact_friction_power": touch[..., m.TOUCH.friction_power],
        "contact_sliding_speed": touch[..., m.TOUCH.slip],
    }
    variables.update({name: (("time", "contact"), values) for name, values in scalars.items()})
    for name, o in (("contact_force", m.TOUCH.force), ("contact_offset", m.TOUCH.offset)):
        variables[name] = (("time", "contact", "axis"), touch[..., o : o + 3])
    variables["contact_delivered_restitution"] = (("contact",), np.array([law.delivered for law in model.laws]))


def _events(trajectory: Trajectory, variables: Variables) -> None:
    e = trajectory.events
    columns = {
        "event_time": e[:, m.EVENT.time],
        "event_contact": e[:, m.EVENT.contact].astype(np.int32),
        "event_kind": np.array([EVENT_KINDS.index(_FLAGS[int(k)]) for k in e[:, m.EVENT.kind]], dtype=np.int8),
        "event_approach_speed": e[:, m.EVENT.speed],
        "event_peak_force": e[:, m.EVENT.peak_force],
        "event_peak_penetration": e[:, m.EVENT.peak_depth],
        "event_duration": e[:, m.EVENT.duration],
    }
    variables.update({name: (("event",), values) for name, values in columns.items()})
