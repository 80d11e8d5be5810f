"""Start of a run as another run has recorded it (`scene.start`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.model.driving import coordinate_of, label
from flexclear.dynamics.model.stops import ends
from flexclear.dynamics.starts.snapshot import round_for_scene
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.fields import Pose
from flexclear.scene.parts import FlexibleBody, Ground, RigidBody
from flexclear.scene.schema import Scene
from flexclear.scene.start import ModalStart
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress

PLACE = "[start.from]"


def begin(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene with poses, velocities, modes and closed contacts of the recorded row; no assembly is chosen.

    Raises InputError where the run has other bodies or modes.
    """
    assert scene.start is not None
    posed, modal = with_placing_joints(scene), dict[str, ModalStart]()
    row, bodies = scene.start.recorded, dict[str, Any](posed.body)
    for name, body in scene.flexible().items():
        rows = np.array([values for mode, values in row.items() if mode.startswith(f"modal.{name}.")]).reshape(-1, 2)
        bundle, count = bundles[name], bundles[name].sizes["mode"]
        if len(rows) != count:
            problem = f"{scene.start.run} has {len(rows)} modes of the body '{name}', this scene {count}"
            raise InputError(PLACE, problem, f"give [body.{name}.modes] as that run had it")
        q = rows[:, 0]
        moment = bundle["first_moment"].values + bundle["modal_first_moment"].values @ q
        if body.stiffening is not None:
            moment = moment + 0.5 * np.einsum("kij,i,j->k", bundle["second_order_first_moment"].values, q, q)
        bodies[name] = _body_at(body, row[f"body.{name}"], moment / float(bundle["mass"].values))
        modal[name] = ModalStart(coordinate=tuple(round_for_scene(q)), velocity=tuple(round_for_scene(rows[:, 1])))
    assert posed.start is not None
    progress(None, f"continues {scene.start.run} at t = {scene.start.time:.9g} s")
    return posed.model_copy(update={"body": bodies, "start": posed.start.model_copy(update={"modal": modal})}), ""


def with_placing_joints(scene: Scene) -> Scene:
    """Return the scene with the recorded poses of rigid bodies, and of flexible ones as if undeformed.

    Its start keeps the recorded numbers for internal states, which `model.internal_states` enters.
    Raises InputError for bodies that the run lacks, or that only the run has.
    """
    assert scene.start is not None
    row = scene.start.recorded
    moving = {name for name, body in scene.body.items() if not isinstance(body, Ground)}
    known = {name.removeprefix("body.") for name in row if name.startswith("body.")}
    for names, has, lacks in ((moving - known, "this scene", "that run"), (known - moving, "that run", "this scene")):
        if names:
            problem = f"the run {scene.start.run} is of other bodies: {has} has '{min(names)}', {lacks} has not"
            raise InputError(PLACE, problem, "continue a run of a scene with the same bodies")
    bodies = {
        name: _body_at(body, row[f"body.{name}"], np.array(body.com) if isinstance(body, RigidBody) else np.zeros(3))
        if name in moving
        else body
        for name, body in scene.body.items()
    }
    joints, stops, gears = dict[str, Any](scene.joint), dict[str, Any](scene.stop), _centred_gears(scene)
    for name in [*scene.contacts(), *scene.stops()]:
        speeds = {
            k.removeprefix(f"contact.{name}").removeprefix("."): max(v[0], 0.0)
            for k, v in row.items()
            if k == f"contact.{name}" or k.startswith(f"contact.{name}.")
        }
        if speeds and name in joints:
            joints[name] = joints[name].with_approach_speeds(speeds)
        elif speeds:
            ends = stops if name in stops else gears
            ends[name] = ends[name].model_copy(update={"initial_approach_speed": [*speeds.values()][-1]})
    start = scene.start.model_copy(update={"run": None, "time": None})
    return scene.model_copy(update={"body": bodies, "joint": joints, "stop": stops, "gear": gears, "start": start})


def _centred_gears(scene: Scene) -> dict[str, Any]:
    """Return the gears of the scene with the middle of their backlash as it was in the recorded run."""
    assert scene.start is not None
    gears, row = dict[str, Any](scene.gear), scene.start.recorded
    for name, end in ends(scene, dict.fromkeys(scene.joint, 1.0)):
        gap, owner = row.get(f"gap.{name}"), name.partition(".")[0]
        if end.family == "gear" and gap is not None and gears[owner].centre is None:
            kinds = [
                (joint, scene.joint[joint].type, coordinate_of(scene, joint, one.name, "")[1])
                for joint, one in end.parts
            ]
            (second,), (first,) = (row[f"joint.{label(*kind)}"] for kind in kinds)
            centre = second - end.ratio * first - end.limit + end.sense * gap[0]
            gears[owner] = gears[owner].model_copy(update={"centre": centre})
    return gears


def _body_at(body: Any, recorded: tuple[float, ...], centre: np.ndarray) -> Any:
    """Return a body with a recorded motion; centre: its centre of mass in its frame."""
    position, quaternion = np.array(recorded[:3]), np.array(recorded[3:7])
    origin = position - quaternion_to_matrix(quaternion) @ centre
    pose = Pose(position=tuple(round_for_scene(origin)), quaternion=tuple(round_for_scene(quaternion)))
    velocities = {"velocity": recorded[7:10], "angular_velocity": recorded[10:13]}
    kept = velocities if isinstance(body, (RigidBody, FlexibleBody)) else {}
    return body.model_copy(update={"pose": pose, **kept})
