"""Run dataset (schema RUN) of a trajectory."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator
from functools import partial

import numpy as np

from flexclear.artifacts import quantities
from flexclear.artifacts.coordinates import motion
from flexclear.artifacts.labelled import LabelledArrays, label_arrays
from flexclear.artifacts.schema import RUN, conform_arrays
from flexclear.dynamics.effects.citations import references
from flexclear.dynamics.equations.observation import Observed, Series, Variables
from flexclear.dynamics.model.driving import prescribed_coordinates
from flexclear.dynamics.model.internal_states import named_states
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.plausibility import doubts
from flexclear.dynamics.model.stops import ends_an_angle
from flexclear.dynamics.record import bushings, controllers, films, frame_loads, gears, joint_friction, stress, wear
from flexclear.dynamics.record.motion import Motions, motion_series, points_in_world
from flexclear.dynamics.record.topology import topology
from flexclear.dynamics.record.wrenches import every_joint_wrench, held_moments
from flexclear.dynamics.run import ledger
from flexclear.dynamics.run.coordinates import joint_coordinates, named_coordinates
from flexclear.dynamics.run.run import Run
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.scene.event_kinds import EVENT_KINDS
from flexclear.scene.output import VARIABLES
from flexclear.scene.quantity import KINDS, Quantity
from flexclear.scene.schema import Scene
from flexclear.workflow.fingerprint import library_version


def record_run(run: Run) -> LabelledArrays:
    """Return all recorded variables of a run (schema RUN)."""
    model, trajectory = run.model, run.trajectory
    motions = Motions(model, run.observed)
    frames, joints = list(model.mechanism.frames), list(model.scene.joint)
    parts = list(_motion(motions, motions.moving_bodies, joints, frames))
    parts += [_names(model), _internal(model, trajectory), *(made() for _, made in _makers(run.scene, motions))]
    if model.contacts:
        parts.append((events_of(model, trajectory), {}))
    if run.perturbed is not None:
        horizon: Variables = {"horizon": ((), np.array(run.perturbed.horizon))}
        separation: Variables = {"separation": (("separation_time",), run.perturbed.separation)}
        parts.append((separation | horizon, {"separation_time": run.perturbed.time}))
    parts.append(topology(run))
    variables, coordinates = Variables(), dict[str, object](time=trajectory.time)
    for part in parts:
        variables |= part[0]
        coordinates |= part[1]
    title, facts = f"Motion of {subject(run.scene)}", attributes(run.scene) | _report(run)
    return conform_arrays(label_arrays(variables, coordinates), RUN, title=title, **facts)


def variables_for(
    scene: Scene, motions: Motions, terms: Collection[Quantity], time: np.ndarray, events: Variables | None = None
) -> LabelledArrays:
    """Return the run variables from which these quantities are computed (`core.artifacts.quantities.series`).

    terms: terms of quantities, no expressions.  time: of the rows [s].  events: from `events_of`, for quantities of
    events.
    """
    names: dict[str, list[str]] = {}
    for term in terms:
        mine = names.setdefault(KINDS[term.kind].owner, [])
        mine += [term.owner] if term.owner not in mine else []
    requested = {KINDS[term.kind].variable for term in terms}
    parts = list(_motion(motions, *(names.get(owner) for owner in ("body", "joint", "frame"))))
    parts += [made() for makes, made in _makers(scene, motions) if any(name.startswith(makes) for name in requested)]
    parts.append(({"time": (("time",), time)}, {}))
    variables = {name: values for part in parts for name, values in part[0].items() if name in requested}
    return label_arrays(
        variables | (events or {}), {name: values for part in parts for name, values in part[1].items()}
    )


def series(scene: Scene, motions: Motions, requested: Collection[Quantity], time: np.ndarray) -> dict[str, np.ndarray]:
    """Return quantities over time, (rows, components), by name; time: of the rows [s]."""
    arrays = variables_for(scene, motions, {term for one in requested for term in one.terms()}, time)
    return {one.name: quantities.series(arrays, one) for one in requested}


#: of effects: variables and coordinates of the dataset, by beginnings of the variables' names
RECORDS = {
    "gears": (("gear_",), gears.gear_series),
    "bushings": (("bushing_",), bushings.bushing_series),
    "films": (("film_",), films.film_series),
    "controllers": (("controller_",), controllers.controller_series),
    "joint_friction": (("joint_bearing", "joint_sliding", "joint_friction_"), joint_friction.friction_series),
    "wear": (("wear_",), wear.wear_series),
}
#: of effects: warnings about the results of a run
WARNINGS = {"joint_friction": joint_friction.warnings}
#: variables that a scene's ``[output]`` requests, by its key
ON_REQUEST = {"stress": stress.record, "frame_loads": frame_loads.record}
#: beginnings of the names of the ledger's variables
_LEDGER = (
    *("kinetic", "potential", "elastic", "dissipated", "drive_work", "energy_error", "constraint_error", "load_work"),
    *("load_loss", "joint_friction_loss", "modal_damping_loss", "contact_elastic", "contact_damping_loss"),
    *("contact_impulse", "contact_friction_loss"),
)


def _makers(scene: Scene, motions: Motions) -> Iterator[tuple[tuple[str, ...], Callable[[], Series]]]:
    """Yield name beginnings and the maker of these variables, without those of bodies, frames and joints."""
    model, seen = motions.model, motions.seen
    yield ("modal_",), lambda: _modes(motions)
    yield ("drive_force", "drive_position"), lambda: _drives(scene, model, seen)
    yield ("joint_position", "joint_velocity", "joint_acceleration"), lambda: _joint_coordinates(model, seen)
    if scene.forces():
        yield ("load_",), lambda: _loads(model, seen)
    for effect in model.parts.present:
        if effect.name in RECORDS:
            beginnings, function = RECORDS[effect.name]
            yield beginnings, partial(function, model, seen)
    if model.contacts:
        yield ("contact_",), lambda: _contacts(model, seen)
    for name, asked in scene.output.requests().items():
        yield tuple(VARIABLES[name]), partial(ON_REQUEST[name], motions, asked)
    yield _LEDGER, lambda: (ledger.series(model, seen), {})


def subject(scene: Scene) -> str:
    """Return a description of the moving bodies for titles, with flexible bodies and clearance joints."""
    moving = [name for name, body in scene.body.items() if body.type != "ground"]
    shown = moving if len(moving) < 5 else [*moving[:3], f"{len(moving) - 3} more bodies"]
    words = ", ".join(shown[:-1]) + " and " + shown[-1] if len(shown) > 1 else "".join(shown)
    for what, names in (("flexible", list(scene.flexible())), ("clearance", list(scene.contacts()))):
        words += f"; {what}: {', '.join(names)}" if names else ""
    return words


def attributes(scene: Scene) -> dict[str, str]:
    """Return the attributes that describe the run's input: parameters, references, versions; no times, no file names.

    Sources of values are stored in what is derived from the run, so that editing their text starts no run again.
    """
    parameters = scene.model_dump(mode="json", exclude={"title", "description", "limits"}, exclude_none=True)
    for body in scene.flexible():
        del parameters["body"][body]["mesh"]
    return {
        "parameters": json.dumps(parameters, sort_keys=True),
        "references": references(scene),
        "versions": " ".join(f"{name} {library_version(name)}" for name in ("numpy", "numba", "scipy", "xarray")),
    }


def warnings(run: Run) -> list[str]:
    """Return sentences that state doubts about a run."""
    choice = [run.model.mechanism.choice] if run.model.mechanism.choice else []
    return [
        *choice,
        *(f"{text} ({remedy})" for _, text, remedy in doubts(run.model.mechanism)),
        *run.mended,
        *_contact_warnings(run),
        *_flexible_warnings(run),
        *(text for warn in run.model.parts.functions(WARNINGS) for text in warn(run)),
        *_step_warnings(run.model, run.trajectory),
        *ledger.warnings(run.model, run.judged[1]),
    ]


def _step_warnings(model: Model, trajectory: Trajectory) -> list[str]:
    """Return a warning if fixed steps were too long for the method to be stable, which leaves fast rates unresolved."""
    solver, stiff = model.scene.solver, trajectory.counters.get("stiff_steps", 0)
    if solver.step is None or not stiff:
        return []
    return [
        f"{stiff} of {trajectory.counters['steps']} steps of {solver.step:g} s were too long for {solver.integrator} "
        f"to be stable: the equations have rates up to {trajectory.steepest:.2g} 1/s, as the slope of friction at "
        "small sliding speeds has; a shorter step or an implicit integrator resolves that"
    ]


def _contact_warnings(run: Run) -> list[str]:
    """Return sentences about contacts that left the range of validity of their laws."""
    if not run.model.contacts:
        return []
    from flexclear.dynamics.contact import validity

    depths, forces = validity.deepest(run.trajectory.events, run.observed.touch)
    sentences = list[str]()
    for contact, law, depth, force in zip(run.model.contacts, run.model.laws, depths, forces, strict=True):
        sentences += validity.warnings(contact.words, contact.joint, law, float(depth), float(force))
    return sentences + [text for text in _tilts(run) if text]


def _tilts(run: Run) -> Iterator[str]:
    """Yield a sentence about each pin that its joint keeps from tilting, else an empty one."""
    from flexclear.dynamics.contact import validity

    model, time = run.model, run.trajectory.time
    if not np.ptp(time) > 0.0:  # an equilibrium has no mean
        return
    weight = sum(link.mass for link in model.links) * max(float(np.linalg.norm(model.gravity)), 1.0)
    for c, held in held_moments(Motions(model, run.observed)).items():
        contact, impulse = model.contacts[c], ledger.series(model, run.observed)["contact_impulse"][1][:, c]
        moment, force = (float(x / np.ptp(time)) for x in (np.trapezoid(held, time), np.ptp(impulse)))
        if moment > validity.NO_MOMENT * weight * model.length:
            yield validity.tilting(contact.words, contact.joint, moment, force)


def _flexible_warnings(run: Run) -> list[str]:
    """Return sentences about flexible bodies that left the range of validity of linear modes."""
    if not run.model.numbering.flexible:
        return []
    from flexclear.dynamics.run.refusals import validity

    trajectory, seen = run.judged
    return validity.warnings(run.model, trajectory.time, seen)


def _report(run: Run) -> dict[str, float | int | str]:
    """Return attributes that describe integration, method and contact laws of a run, with its warnings."""
    counters, redundant = run.trajectory.counters, run.engine.mobility.redundant
    energies = ledger.balance(run.model, run.judged[1])
    facts: dict[str, float | int | str] = {
        **counters,
        "stiff_share": counters.get("stiff_steps", 0) / max(1, counters.get("steps", 0)),
        "largest_rate": run.trajectory.steepest,
        "largest_drift_before_projection": run.trajectory.drift,
        "largest_rate_drift_before_projection": run.trajectory.rate_drift,
        "closure_residual_of_given_start": run.model.mechanism.start_residual,
        "exchanged_energy": energies.exchanged,
        "energy_rounding": energies.rounding,
    }
    if run.perturbed is not None:
        facts["separation_perturbation"] = quantities.PERTURBATION
    facts |= {"redundant_closure_rows": redundant, "method": run.model.scene.solver.integrator}
    if run.mended:
        facts["start_mended"] = "\n".join(run.mended)
    if run.switched:
        facts["switched"] = run.switched
    if redundant:
        facts["redundant_reactions"] = "one of many solutions: redundant closure rows carry no force"
    facts["warnings"] = "\n".join(warnings(run))
    if run.model.contacts:
        from flexclear.dynamics.contact import validity

        facts["contacts"] = validity.laws(run.model.contacts, run.model.laws)
    return facts


def _motion(
    motions: Motions, bodies: list[str] | None, joints: list[str] | None, frames: list[str] | None
) -> Iterator[Series]:
    """Yield motion of some bodies, wrenches of joints, positions of frames; None leaves out a kind."""
    origin = motions.model.mechanism.origin
    if bodies is not None:
        moved = motions.several(bodies)
        alpha: Variables = {"angular_acceleration": (("time", "body", "axis"), moved.alpha)}
        yield motion_series(moved, origin) | alpha, {"body": bodies}
    if joints is not None:
        moment, force = every_joint_wrench(motions, joints)
        dims = ("time", "joint", "axis")
        yield {"joint_moment": (dims, moment), "joint_force": (dims, force)}, {"joint": joints}
    if frames is not None:
        places = points_in_world(motions.positions(frames), origin)
        yield {"frame_position": (("time", "frame", "axis"), places)}, {"frame": frames}


def _names(model: Model) -> Series:
    """Return bodies of the frames; types of the joints, their frames and bodies."""
    joints, frames = model.scene.joint, model.mechanism.frames
    coordinates: dict[str, object] = {"frame_body": ("frame", [name.partition(".")[0] for name in frames])}
    if not joints:
        return {}, coordinates
    coordinates["joint_type"] = ("joint", [joint.type for joint in joints.values()])
    for k, side in enumerate(("first", "second")):
        ends = [joint.between[k] for joint in joints.values()]
        coordinates[f"joint_{side}_frame"] = ("joint", ends)
        coordinates[f"joint_{side}_body"] = ("joint", [frames[end].body for end in ends])
    return {}, coordinates


def _internal(model: Model, trajectory: Trajectory) -> Series:
    """Return the internal states from which another run may continue."""
    if not (named := named_states(model)):
        return {}, {}
    return {"internal_state": (("time", "internal"), trajectory.state[:, [*named.values()]])}, {"internal": [*named]}


def _modes(motions: Motions) -> Series:
    model = motions.model
    if not model.numbering.flexible:
        return {}, {}
    states = {str(model.links[i].flexible): motions.modal(i) for i in model.numbering.flexible}
    owners = [name for name, state in states.items() for _ in range(state.q.shape[1])]
    numbers = [k + 1 for state in states.values() for k in range(state.q.shape[1])]
    return {
        "modal_coordinate": (("time", "mode"), np.concatenate([state.q for state in states.values()], axis=1)),
        "modal_velocity": (("time", "mode"), np.concatenate([state.u for state in states.values()], axis=1)),
    }, {
        "mode": [f"{owner}.{number}" for owner, number in zip(owners, numbers, strict=True)],
        "mode_body": ("mode", owners),
        "mode_number": ("mode", np.array(numbers)),
    }


def _drives(scene: Scene, model: Model, seen: Observed) -> Series:
    names = list(model.drives)
    if not names:
        return {}, {}
    force, position = model.drive_signs * seen.drive_force, model.drive_signs * seen.positions[:, model.nq :]
    turning = {coordinate.name: coordinate.dimension == "angle" for coordinate in prescribed_coordinates(model.scene)}
    sharing = [name for name in model.scene.forces() if name not in scene.load]
    if sharing:  # actuators beyond the freedoms, which are loads in the engine
        from flexclear.dynamics.record.loads import along_coordinates, turning_loads

        names += sharing
        turning |= dict(zip(sharing, turning_loads(model, sharing), strict=True))
        known = joint_coordinates(model, seen)
        force = np.concatenate([force, along_coordinates(model, seen, sharing)], axis=1)
        position = np.concatenate([position, np.stack([known[name][0] for name in sharing], axis=1)], axis=1)
    return {
        "drive_force": (("time", "drive"), force),
        "drive_position": (("time", "drive"), position),
    }, {"drive": names, "drive_motion": ("drive", [motion(turning[name]) for name in names])}


def _joint_coordinates(model: Model, seen: Observed) -> Series:
    every = joint_coordinates(model, seen)
    if not every:
        return {}, {}
    names = ("joint_position", "joint_velocity", "joint_acceleration")
    series = (np.stack(values, axis=1) for values in zip(*every.values(), strict=True))
    variables: Variables = {name: (("time", "coordinate"), s) for name, s in zip(names, series, strict=True)}
    kinds = {label: (joint, turns) for label, joint, turns in named_coordinates(model.scene)}
    known = model.scene.start.recorded if model.scene.start is not None else {}
    for name, angle in zip(every, variables["joint_position"][1].T, strict=True):
        if kinds[name][1]:  # full turns go on from those of the run that this one continues
            before = known.get(f"joint.{name}", angle[:1])[0]
            angle += 2.0 * np.pi * np.round((before - angle[0]) / (2.0 * np.pi))
    return variables, {
        "coordinate": list(every),
        "coordinate_joint": ("coordinate", [kinds[name][0] for name in every]),
        "coordinate_motion": ("coordinate", [motion(kinds[name][1]) for name in every]),
    }


def _loads(model: Model, seen: Observed) -> Series:
    from flexclear.dynamics.record.loads import load_series, turning_loads

    forces = model.scene.forces()
    return load_series(model, seen), {
        "load": list(forces),
        "load_type": ("load", [load.type for load in forces.values()]),
        "load_motion": ("load", [motion(turns) for turns in turning_loads(model, list(forces), measured=True)]),
    }


def _contacts(model: Model, seen: Observed) -> Series:
    touch = seen.touch
    scalars = {
        "contact_gap": touch["gap"],
        "contact_penetration": np.maximum(0.0, -touch["gap"]),
        "contact_rate": touch["rate"],
        "contact_normal_force": touch["normal_force"],
        "contact_friction_power": touch["friction_power"],
        "contact_sliding_speed": touch["slip"],
    }
    variables: Variables = {name: (("time", "contact"), values) for name, values in scalars.items()}
    variables["contact_force"] = (("time", "contact", "axis"), touch["force"])
    variables["contact_offset"] = (("time", "contact", "axis"), touch["offset"])
    variables["contact_delivered_restitution"] = (("contact",), np.array([law.delivered for law in model.laws], float))
    return variables, contact_names(model)


def contact_names(model: Model) -> dict[str, object]:
    """Return names of the contacts, types of their joints or stops, and whether their gaps are angles or lengths."""
    return {
        "contact": [contact.name for contact in model.contacts],
        "contact_type": ("contact", [contact.joint.type for contact in model.contacts]),
        "contact_motion": ("contact", [motion(ends_an_angle(contact.joint)) for contact in model.contacts]),
    }


def events_of(model: Model, trajectory: Trajectory) -> Variables:
    """Return the events of a run, by variable."""
    events, names = trajectory.events, np.array([contact.name for contact in model.contacts], dtype=str)
    columns = {
        "event_time": events["time"],
        "event_contact": names[events["contact"].astype(np.int64)],
        "event_kind": np.array(EVENT_KINDS, dtype=str)[events["kind"].astype(np.int64)],
        "event_approach_speed": events["speed"],
        "event_peak_force": events["peak_force"],
        "event_peak_penetration": events["peak_depth"],
        "event_duration": events["duration"],
    }
    return {name: (("event",), values) for name, values in columns.items()}
