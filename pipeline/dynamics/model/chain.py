"""From a joint in the tree to the links that make its motion.

A joint moves by one kernel of its own. Where some of its freedoms are prescribed and others not, or where the tree
meets a joint with several axes from its second frame, it becomes a chain of hinges and slides with massless links
between: each freedom is then a coordinate by itself, free or known. The pose of a frame on a path is such a chain too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.tree import PATH, Edge

#: x, y and z of the origin, then Cardan angles about x, y and z
SLIDES = tuple(Coordinate(axis, False, axis=k) for k, axis in enumerate("xyz"))
TURNS = tuple(Coordinate(axis, True, axis=k) for k, axis in enumerate("xyz"))


@dataclass(frozen=True)
class Stage:
    """One link of a chain: joint type, axes of its frames in the joint's frames (columns), drives if prescribed.

    positions: which of the joint's positions are its own.  sign: -1 where it is met from its far side.
    """

    kind: str
    axes: np.ndarray
    positions: tuple[int, ...]
    drives: tuple[str, ...] = ()
    sign: float = 1.0


def stages(edge: Edge, reverse: bool, port_near: bool, port_far: bool) -> list[Stage]:
    """The chain of a joint, from the parent on; a link at a port of a flexible body keeps the port's axes."""
    found = _path(edge) if edge.kind == PATH else _joint(edge, reverse)
    if port_near and not _straight(found[0]):
        found.insert(0, Stage("fixed", np.eye(3), ()))
    if port_far and not _straight(found[-1]):
        found.append(Stage("fixed", np.eye(3), ()))
    return found


def _straight(stage: Stage) -> bool:
    return bool(np.array_equal(stage.axes, np.eye(3)))


def _joint(edge: Edge, reverse: bool) -> list[Stage]:
    declared, sign = joint_class(edge.kind), -1.0 if reverse else 1.0
    count, driven = len(declared.POSITIONS), [d for d in edge.drives if d is not None]
    one_axis = len({c.axis for c in declared.COORDINATES}) <= 1
    if count <= 1 or (not driven and (one_axis or not reverse)):
        return [Stage(edge.kind, np.eye(3), tuple(range(count)), tuple(driven), sign)]
    parts = [
        Stage(c.part, c.axes, (k,), (drive,) if drive is not None else (), sign)
        for k, (c, drive) in enumerate(zip(declared.COORDINATES, edge.drives or (None,) * count, strict=True))
    ]
    return parts[::-1] if reverse else parts


def _path(edge: Edge) -> list[Stage]:
    """Slides to the frame's origin; then Cardan angles, a rotation vector, or a free rotation."""
    slides, turns = edge.drives[:3], edge.drives[3:]
    found = [
        Stage(c.part, c.axes, (k,), (d,) if d else ()) for k, (c, d) in enumerate(zip(SLIDES, slides, strict=True))
    ]
    if edge.vector:
        return [*found, Stage("rotation-vector", np.eye(3), (3, 4, 5), tuple(d for d in turns if d))]
    if not any(turns):
        return [*found, Stage("spherical", np.eye(3), (3, 4, 5, 6))]
    angles = (
        Stage(c.part, c.axes, (3 + k,), (d,) if d else ()) for k, (c, d) in enumerate(zip(TURNS, turns, strict=True))
    )
    return [*found, *angles]


def path_positions(edge: Edge, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Positions of a path's chain for a pose in the world: origin, then quaternion or Cardan angles."""
    if not any(edge.drives[3:]):
        return np.concatenate([p, joint_class("spherical").coordinates(R, p)])
    # R = Rx(a) Ry(b) Rz(c)
    angles = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(np.clip(R[0, 2], -1.0, 1.0)), np.arctan2(-R[0, 1], R[0, 0])]
    return np.concatenate([p, angles])
