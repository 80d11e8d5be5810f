"""Scenes whose bodies have the poses of an engine's state, whatever joints or drives that engine has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.driving import joint_drives
from flexclear.dynamics.model.initial import centre_of
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.scene.drives import JointDrive
from flexclear.scene.ends import Gear
from flexclear.scene.fields import Pose
from flexclear.scene.laws import Constant, Polynomial
from flexclear.scene.loads import JointForce
from flexclear.scene.parts import Ground
from flexclear.scene.schema import Scene
from flexclear.scene.start import JointStart, ModalStart, Start
from flexclear.scene.units import LARGEST_NUMBER

Vector = tuple[float, float, float]


def with_poses(scene: Scene, engine: Engine, y: np.ndarray, t: float) -> Scene:
    """Return the scene with every body's pose and deformation of state y at time t.

    Velocities are those of the scene.  Its joint positions and its place to begin are left out.
    """
    closure_rows.evaluate(engine, y, t)
    frames, model, bodies = engine.table(m.LINK_FRAMES), engine.model, dict[str, Any]()
    for name, body in scene.body.items():
        i = model.mechanism.link_of[name]
        if isinstance(body, Ground):
            bodies[name] = body
            continue
        placement, frame = model.links[i].placements[name], frames[i]
        p = frame["origin"] + frame["axes"] @ placement.p + model.mechanism.origin
        quaternion = matrix_to_quaternion(frame["axes"] @ placement.R)
        pose = Pose(position=tuple(round_for_scene(p)), quaternion=tuple(round_for_scene(quaternion)))
        bodies[name] = body.model_copy(update={"pose": pose})
    given = scene.start.modal if scene.start is not None else {}
    modal = {
        name: ModalStart(coordinate=tuple(q), velocity=given[name].velocity if name in given else None)
        for name, q in _modes(engine, y[: model.nq], model.numbering.modal_positions).items()
    }
    start = _start_without_poses(scene, modal)
    return scene.model_copy(update={"body": bodies, "gear": _centred_gears(scene, engine), "start": start})


def _centred_gears(scene: Scene, engine: Engine) -> dict[str, Gear]:
    """Return the gears with the middle of their backlash, for angles that count from an evaluated pose on."""
    gears, numbering = dict(scene.gear), engine.model.numbering
    for c, contact in enumerate(engine.model.contacts):
        name, end = contact.owner, contact.joint
        if contact.family == "gear" and name in gears and gears[name].centre is None:
            sites = [numbering.site(site) for site in (contact.outer, contact.inner, *contact.others)]
            frames = [Placement(one["origin"], one["axes"]) for one in engine.table(m.SITE_FRAMES)[sites]]
            centre = end.value(*frames) - end.limit + end.sense * engine.table(m.TOUCH)["gap"][c]
            gears[name] = gears[name].model_copy(update={"centre": float(centre)})
    return gears


def with_poses_and_velocities(scene: Scene, engine: Engine, y: np.ndarray, t: float) -> Scene:
    """Return the scene as `with_poses` does, with the velocities of the state as well."""
    still, model = with_poses(scene, engine, y, t), engine.model
    frames, q, u, bodies = engine.table(m.LINK_FRAMES), y[: model.nq], y[model.speeds], dict(still.body)
    for name, body in still.body.items():
        if not isinstance(body, Ground):
            twist = centre_of(model, name).motion(frames, q, u)
            given = {"angular_velocity": tuple(twist[:3].tolist()), "velocity": tuple(twist[3:].tolist())}
            bodies[name] = body.model_copy(update=given)
    assert still.start is not None
    rates = _modes(engine, u, model.numbering.modal_coordinates)
    modal = {n: ModalStart(coordinate=s.coordinate, velocity=tuple(rates[n])) for n, s in still.start.modal.items()}
    start = still.start.model_copy(update={"joint": {}, "modal": modal})
    return still.model_copy(update={"body": bodies, "start": start})


def with_resting_contacts(scene: Scene, contacts: Iterable[str], *, stops: bool) -> Scene:
    """Return the scene with those of these contacts at rest that are closed at the start; of stops and gears too."""

    def at_rest(family: str, names: Iterable[str]) -> dict[str, Any]:
        parts = getattr(scene, family)
        begun = [name for name in names if parts[name].initial_approach_speed is None]
        return parts | {name: parts[name].model_copy(update={"initial_approach_speed": 0.0}) for name in begun}

    ends = scene.stops() if stops else {}
    of_ends = {key: at_rest(key, [n for n, end in ends.items() if end.family == key]) for key in ("stop", "gear")}
    return scene.model_copy(update={"joint": at_rest("joint", contacts), **of_ends})


def _modes(engine: Engine, values: np.ndarray, numbers: dict[int, range]) -> dict[str, list[float]]:
    """Return the values of the modes of flexible bodies, by name."""
    return {str(engine.model.links[i].flexible): round_for_scene(values[own]) for i, own in numbers.items()}


def round_for_scene(values: np.ndarray) -> Any:
    """Return computed values as a scene may give them; rounding below the smallest number of scenes becomes zero."""
    return np.where(np.abs(values) < 1.0 / LARGEST_NUMBER, 0.0, values).tolist()


def _start_without_poses(scene: Scene, modal: dict[str, ModalStart]) -> Start:
    """Return the start without entries that the poses now replace."""
    old = scene.start if scene.start is not None else Start()
    rates = joint_starts(old, lambda one: None if one.velocity is None else JointStart(velocity=one.velocity))
    return old.model_copy(update={"at": None, "run": None, "recorded": {}, "joint": rates, "modal": modal})


def with_held_drives(
    scene: Scene, starts: Iterable[Given], law: Callable[[Given, float], Constant | Polynomial]
) -> dict[str, Any]:
    """Return the scene's drives, and drives of those coordinates whose given position nothing else drives."""
    driven, drives = joint_drives(scene), dict[str, Any](scene.drive)
    for start in starts:
        own = driven.get(start.joint, ())
        if start.position is not None and not (own and own[start.number]):
            name = f"hold-{start.joint}-{start.coordinate.name}"
            drives[name] = JointDrive(
                joint=start.joint, coordinate=start.coordinate.name, law=law(start, start.position)
            )
    return drives


def with_forces_for_drives(scene: Scene, forces: Mapping[str, float]) -> Scene:
    """Return the scene with constant forces [N or N m] in place of drives of joints, named ``drive.<name>``."""
    loads: dict[str, Any] = {}
    for name, force in forces.items():
        drive: Any = scene.drive[name]
        law = Constant(type="constant", value=force)
        loads[f"drive.{name}"] = JointForce(
            type="joint-force", joint=drive.joint, coordinate=drive.coordinate, force=law
        )
    kept = {name: drive for name, drive in scene.drive.items() if name not in forces}
    return scene.model_copy(update={"drive": kept, "load": {**scene.load, **loads}})


def joint_starts(start: Start, left: Callable[[JointStart], JointStart | None]) -> dict[str, dict[str, JointStart]]:
    """Return the non-empty results of `left`, applied to a start's entry of each joint coordinate, by joint."""
    reduced = {
        joint: {name: new for name, one in coordinates.items() if (new := left(one)) is not None}
        for joint, coordinates in start.joint.items()
    }
    return {joint: coordinates for joint, coordinates in reduced.items() if coordinates}
