"""Fitting of frames known only to a tolerance, as those of meshed bodies, so that nearly fitting joints fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flexclear.artifacts.labelled import Labelled, label_dataset
from flexclear.dynamics.model.closing import close
from flexclear.dynamics.model.constraints import Constraint, demands
from flexclear.dynamics.model.mechanism import Mechanism, build
from flexclear.dynamics.model.merge import Placement
from flexclear.numerics.rotations import matrix_to_quaternion, rotation_vector_to_matrix
from flexclear.scene.parts import FRAME_ERROR, RigidBody


def fit_frames(
    mechanism: Mechanism, joints: list[Constraint], near: Callable[[float], Iterable[Sequence[Placement]]]
) -> Mechanism | None:
    """Return the mechanism with frames of bodies moved by the least amount that lets nearly fitting joints fit.

    joints: of the mechanism, which cannot be closed.  near: poses of the links, from the largest residual with which
    joints may fit there, in units of the mechanism's size.  None where frames would move beyond their tolerance.
    """
    tolerances = _tolerances(mechanism)
    if not tolerances:
        return None
    within = max(tolerances.values()) / mechanism.length
    fits = (_fit_frames_within(mechanism, joints, poses, tolerances, within) for poses in near(within))
    return next((one for one in fits if one is not None), None)


def _tolerances(mechanism: Mechanism) -> dict[str, float]:
    """Return the distance by which frames of each body may be moved [m]; without bodies that start deformed."""
    known = {name: body.frame_tolerance for name, body in mechanism.scene.rigid().items()}
    for i, link in enumerate(mechanism.links):
        if link.flexible and link.bundle is not None and i not in mechanism.deformation:
            known[link.flexible] = FRAME_ERROR * float(np.ptp(link.bundle["frame_position"].values, axis=0).max())
    return {name: tolerance for name, tolerance in known.items() if tolerance > 0.0}


def _fit_frames_within(
    mechanism: Mechanism,
    joints: list[Constraint],
    poses: Sequence[Placement],
    tolerances: Mapping[str, float],
    within: float,
) -> Mechanism | None:
    best = close(mechanism, joints, poses, within=within)
    # the least-squares misfit is spread over all joints; closing those between exact frames gives the rest to the
    # others
    loose = [any(f.partition(".")[0] in tolerances for f in (j.edge.frame_a, j.edge.frame_b)) for j in joints]
    exact_joints = [joint for joint, moves in zip(joints, loose, strict=True) if not moves]
    best = None if best is None else close(mechanism, exact_joints, best)
    if best is None:
        return None
    moved: dict[str, dict[str, Placement]] = {}
    for joint in joints:
        for name, link, far in ((joint.edge.frame_b, joint.link_b, True), (joint.edge.frame_a, joint.link_a, False)):
            body, _, frame = name.partition(".")
            if body not in tolerances:
                continue
            place = best[link].of(mechanism.links[link].placements[body]).inverse().of(_fitting_frame(joint, best, far))
            if np.linalg.norm(place.p - mechanism.frames[name].placement.p) > tolerances[body]:
                return None
            moved.setdefault(body, {})[frame] = place
            break
    return _rebuilt(mechanism, moved)


def _rebuilt(mechanism: Mechanism, moved: Mapping[str, Mapping[str, Placement]]) -> Mechanism:
    """Return the mechanism built with these frames of bodies instead of its own."""
    bodies, bundles = dict(mechanism.scene.body), dict[str, Labelled]()
    for link in mechanism.links:
        if link.flexible and link.bundle is not None:
            bundles[link.flexible] = _with_frames_at(link.bundle, moved.get(link.flexible, {}))
    for body, places in moved.items():
        old = bodies[body]
        if isinstance(old, RigidBody):
            poses = {
                frame: type(old.frames[frame]).model_validate(
                    {"position": place.p.tolist(), "quaternion": matrix_to_quaternion(place.R).tolist()}
                )
                for frame, place in places.items()
            }
            bodies[body] = old.model_copy(update={"frames": old.frames | poses})
    return build(mechanism.scene.model_copy(update={"body": bodies}), bundles)


def _with_frames_at(bundle: Labelled, places: Mapping[str, Placement]) -> Labelled:
    """Return a bundle with frames at these places in the undeformed body."""
    arrays = label_dataset(bundle)
    position, rotation = (arrays[name].values.copy() for name in ("frame_position", "frame_rotation"))
    for k, frame in enumerate(arrays["frame"].values.tolist()):
        if frame in places:
            position[k], rotation[k] = places[frame].p, places[frame].R
    new = {"frame_position": position, "frame_rotation": rotation}
    changes = {name: replace(arrays[name], values=values) for name, values in new.items()}
    return replace(arrays, variables={**arrays.variables, **changes})


def _fitting_frame(joint: Constraint, poses: Sequence[Placement], far: bool) -> Placement:
    """Return a joint's second (`far`) or first frame in the world, moved by the least that makes the joint fit."""
    A, B = joint.frames(poses)
    # steps of Newton's method for the frame of a joint; they converge quadratically from the errors of a mesh
    for _ in range(5):
        demanded, here = demands(joint.edge.kind, A, B), B if far else A
        step = np.linalg.pinv(demanded.about(here.p)) @ demanded.residuals * (-1.0 if far else 1.0)
        there = Placement(here.p + step[3:], rotation_vector_to_matrix(step[:3]) @ here.R)
        A, B = (A, there) if far else (there, B)
    return B if far else A


def describe_moved_frames(before: Mechanism, after: Mechanism) -> str:
    """Return a sentence that lists bodies whose frames were moved, with amounts."""
    away = dict[str, float]()
    for name, frame in after.frames.items():
        size = float(np.linalg.norm(frame.placement.p - before.frames[name].placement.p))
        away[frame.body] = max(size, away.get(frame.body, 0.0))
    moved = ", ".join(f"{body} by up to {size:.2g} m" for body, size in away.items() if size > 0.0)
    return f"frames were moved within their frame_tolerance to assemble the joints: {moved}"
