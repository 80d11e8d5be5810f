"""From a joint in the tree to the links that make its motion.

A joint moves by one kernel of its own. Where some of its freedoms are prescribed and others not, or where the tree
meets a joint with several axes from its second frame, it becomes a chain of hinges and slides with massless links
between: each freedom is then a coordinate by itself, free or known. The pose of a frame on a path is such a chain too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.model.driving import joint_type
from flexclear.pipeline.dynamics.model.tree import PATH, Edge

#: x, y and z of the origin, then Cardan angles about x, y and z
SLIDES = tuple(Coordinate(axis, False, axis=k) for k, axis in enumerate("xyz"))
TURNS = tuple(Coordinate(axis, True, axis=k) for k, axis in enumerate("xyz"))


@dataclass(frozen=True)
class InboardJoint:
    """The joint between a link and its parent: a joint of the scene, or one step of the chain that represents it.

    kind: joint type.  axes: of its frames, in the frames of the scene's joint (columns).
    positions: which of that joint's positions are its own.
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
        """Whether its frames have the axes of those of the scene's joint."""
        return bool(np.array_equal(self.axes, np.eye(3)))


def chain(edge: Edge, reverse: bool, port_near: bool, port_far: bool) -> list[InboardJoint]:
    """The chain of a joint, from the parent on; a link at a port of a flexible body keeps the port's axes."""
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
    parts = _single(declared.COORDINATES, edge.drives or (None,) * count, 0, sign)
    return parts[::-1] if reverse else parts


def _single(
    coordinates: tuple[Coordinate, ...], drives: tuple[str | None, ...], first: int, sign: float
) -> list[InboardJoint]:
    """A hinge or slide per coordinate; first: position of the first one in the joint."""
    return [
        InboardJoint(c.part, c.axes, (first + k,), (drive,) if drive else (), sign)
        for k, (c, drive) in enumerate(zip(coordinates, drives, strict=True))
    ]


def _path(edge: Edge) -> list[InboardJoint]:
    """Slides to the frame's origin; then Cardan angles, a rotation vector, or a free rotation."""
    turns = edge.drives[3:]
    slides = _single(SLIDES, edge.drives[:3], 0, 1.0)
    if edge.vector:
        return [*slides, InboardJoint("rotation-vector", positions=(3, 4, 5), drives=tuple(d for d in turns if d))]
    if not any(turns):
        return [*slides, InboardJoint("spherical", positions=(3, 4, 5, 6))]
    return [*slides, *_single(TURNS, turns, 3, 1.0)]


def path_positions(edge: Edge, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Positions of a path's chain for a pose in the world: origin [m], then quaternion or Cardan angles [rad]."""
    if not any(edge.drives[3:]):
        return np.concatenate([p, joint_type("spherical").coordinates(R, p)])
    # R = Rx(a) Ry(b) Rz(c)
    angles = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(np.clip(R[0, 2], -1.0, 1.0)), np.arctan2(-R[0, 1], R[0, 0])]
    return np.concatenate([p, angles])
