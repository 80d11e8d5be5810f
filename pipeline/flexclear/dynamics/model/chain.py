"""Chains of links for joints of the tree.

A joint moves by equations of its own. Where only some of its coordinates are prescribed, or where the tree meets a
joint with several axes from its second frame, it becomes a chain of hinges and slides with massless links between them.
Each coordinate of the chain is then free or known by itself. The pose of a frame on a path is a chain, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.tree import PATH, Edge
from flexclear.numerics.rotations import rotation_vector_to_matrix

#: x, y and z of the origin, then Cardan angles about x, y and z
SLIDES = tuple(Coordinate(axis, False, axis=k) for k, axis in enumerate("xyz"))
TURNS = tuple(Coordinate(axis, True, axis=k) for k, axis in enumerate("xyz"))


@dataclass(frozen=True)
class InboardJoint:
    """The joint between a link and its parent: a joint of the scene, or one step of the chain that represents it.

    kind: joint type.  axes: of its frames, in the frames of the scene's joint (columns).
    positions: indices of its positions in the scene's joint.
    drives: prescribed coordinates, none or as many as it has speeds.
    sign: -1 where the tree meets the joint from its second frame: its coordinates are then minus the scene's.
    """

    kind: str
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    positions: tuple[int, ...] = ()
    drives: tuple[str, ...] = ()
    sign: float = 1.0

    @property
    def straight(self) -> bool:
        """True when its frames have the axes of the scene's joint."""
        return bool(np.array_equal(self.axes, np.eye(3)))


def chain(edge: Edge, reverse: bool, port_near: bool, port_far: bool) -> list[InboardJoint]:
    """Return the chain of a joint, from the parent outwards; links at ports of flexible bodies keep the ports' axes."""
    joints = _path(edge) if edge.kind == PATH else _joint(edge, reverse)
    if port_near and not joints[0].straight:
        joints.insert(0, InboardJoint("fixed"))
    if port_far and not joints[-1].straight:
        joints.append(InboardJoint("fixed"))
    return joints


def _joint(edge: Edge, reverse: bool) -> list[InboardJoint]:
    declared, sign = joint_type(edge.kind), -1.0 if reverse else 1.0
    count, driven = len(declared.POSITIONS), tuple(d for d in edge.drives if d is not None)
    one_axis = len({c.axis for c in declared.COORDINATES}) <= 1
    if count <= 1 or (not driven and (one_axis or not reverse)):
        return [InboardJoint(edge.kind, positions=tuple(range(count)), drives=driven, sign=sign)]
    parts = _single_joints(declared.COORDINATES, edge.drives or (None,) * count, 0, sign)
    return parts[::-1] if reverse else parts


def _single_joints(
    coordinates: tuple[Coordinate, ...], drives: tuple[str | None, ...], first: int, sign: float
) -> list[InboardJoint]:
    """Return a hinge or slide per coordinate; first: position in the joint of the first one."""
    return [
        InboardJoint(c.part, c.axes, (first + k,), (drive,) if drive else (), sign)
        for k, (c, drive) in enumerate(zip(coordinates, drives, strict=True))
    ]


def _path(edge: Edge) -> list[InboardJoint]:
    """Return slides to the frame's origin; then Cardan angles, a rotation vector, or a free rotation."""
    turns = edge.drives[3:]
    slides = _single_joints(SLIDES, edge.drives[:3], 0, 1.0)
    if edge.vector:
        return [*slides, InboardJoint("rotation-vector", positions=(3, 4, 5), drives=tuple(d for d in turns if d))]
    if not any(turns):
        return [*slides, InboardJoint("spherical", positions=(3, 4, 5, 6))]
    return [*slides, *_single_joints(TURNS, turns, 3, 1.0)]


def path_positions(edge: Edge, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the positions of a path's chain at a pose in the world: origin [m], quaternion or Cardan angles [rad]."""
    if not any(edge.drives[3:]):
        return np.concatenate([p, joint_type("spherical").coordinates(R, p)])
    # R = Rx(a) Ry(b) Rz(c)
    angles = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(np.clip(R[0, 2], -1.0, 1.0)), np.arctan2(-R[0, 1], R[0, 0])]
    return np.concatenate([p, angles])


def path_pose(place: Mapping[str, float], vector: bool) -> Placement:
    """Return the pose in the world of a frame on a path, from prescribed components by name; others are zero.

    vector: True for the components of a rotation vector instead of Cardan angles.
    """
    p, angles = (np.array([place.get(f"{kind}.{axis}", 0.0) for axis in "xyz"]) for kind in ("position", "rotation"))
    turns = [angles] if vector else list(np.diag(angles))
    return Placement(p, reduce(np.matmul, map(rotation_vector_to_matrix, turns)))
