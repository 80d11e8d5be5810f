"""Fitting of frames known only to a tolerance, as those of meshed bodies, so that nearly fitting joints fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexclear.dynamics.model.closing import close
from flexclear.dynamics.model.constraints import Constraint, demands
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.numerics.rotations import matrix_to_quaternion, rotation_vector_to_matrix, skew
from flexclear.scene.parts import RigidBody
from flexclear.scene.schema import Scene

#: steps of Newton's method for the frame of a joint; they converge quadratically from the errors of a mesh
NEWTON_STEPS = 5


def fitted(mechanism: Mechanism, joints: list[Constraint], poses: Sequence[Placement]) -> Scene | None:
    """Return the scene with frames of bodies moved by the least amount that lets nearly fitting joints fit.

    joints, poses: of the mechanism, which cannot be closed.  None where frames would move beyond their tolerance.
    """
    scene = mechanism.scene
    tolerances = {n: body.frame_tolerance for n, body in scene.rigid().items() if body.frame_tolerance > 0.0}
    if not tolerances or not mechanism.all_rigid:
        return None
    best = close(mechanism, joints, poses, within=max(tolerances.values()) / mechanism.length)
    # the least-squares misfit is spread over all joints; closing those between exact frames gives the rest to the
    # others
    loose = [any(f.partition(".")[0] in tolerances for f in (j.edge.frame_a, j.edge.frame_b)) for j in joints]
    exact_joints = [joint for joint, moves in zip(joints, loose, strict=True) if not moves]
    best = None if best is None else close(mechanism, exact_joints, best)
    if best is None:
        return None
    bodies = dict(scene.body)
    for joint in joints:
        for name, link, far in ((joint.edge.frame_b, joint.link_b, True), (joint.edge.frame_a, joint.link_a, False)):
            body, _, frame = name.partition(".")
            if body not in tolerances:
                continue
            old = bodies[body]
            assert isinstance(old, RigidBody)
            place = best[link].of(mechanism.links[link].placements[body]).inverse().of(_met(joint, best, far))
            if np.linalg.norm(place.p - mechanism.frames[name].placement.p) > tolerances[body]:
                return None
            pose = {"position": place.p.tolist(), "quaternion": matrix_to_quaternion(place.R).tolist()}
            frames = old.frames | {frame: type(old.frames[frame]).model_validate(pose)}
            bodies[body] = old.model_copy(update={"frames": frames})
            break
    exact = {name: bodies[name].model_copy(update={"frame_tolerance": 0.0}) for name in tolerances}
    return scene.model_copy(update={"body": bodies | exact})


def _met(joint: Constraint, poses: Sequence[Placement], far: bool) -> Placement:
    """Return a joint's second (`far`) or first frame in the world, moved by the least that makes the joint fit."""
    A, B = joint.frames(poses)
    for _ in range(NEWTON_STEPS):
        residual, wrench = demands(joint.edge.kind, A, B)
        here = B if far else A
        moment = wrench[:, :3] - wrench[:, 3:] @ skew(here.p).T
        step = np.linalg.pinv(np.hstack([moment, wrench[:, 3:]])) @ residual * (-1.0 if far else 1.0)
        there = Placement(here.p + step[3:], rotation_vector_to_matrix(step[:3]) @ here.R)
        A, B = (A, there) if far else (there, B)
    return B if far else A


def changed(before: Scene, after: Scene) -> str:
    """Return a sentence that lists bodies whose frames were moved, with amounts."""
    away = {
        body: max(float(np.linalg.norm(np.subtract(new.position, old.frames[frame].position))) for frame, new in frames)
        for body, old in before.rigid().items()
        if (frames := list(after.rigid()[body].frames.items()))
    }
    moved = ", ".join(f"{body} by up to {size:.2g} m" for body, size in away.items() if size > 0.0)
    return f"frames were moved within their frame_tolerance to assemble the joints: {moved}"
