"""Constraints that joints and drives impose on the poses of links: residuals, wrenches, free motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.laws import NO_LAWS, drive_laws
from flexclear.dynamics.model.mechanism import Link, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given
from flexclear.dynamics.model.tree import PATH, Edge


class Demands(NamedTuple):
    """Residuals (n,) [m or -] of a joint, and the wrenches (n, 6) (moment about the origin, force) that resist them.

    The rate of a residual is its wrench times the twist of B relative to A (angular velocity; velocity of the point at
    the origin).
    """

    residuals: np.ndarray
    wrenches: np.ndarray

    @property
    def turning(self) -> np.ndarray:
        """True for each residual that is an angle, not a length, shape (n,)."""
        return ~np.any(self.wrenches[:, 3:] != 0.0, axis=1)


@dataclass(frozen=True)
class Constraint:
    """A joint between frames on two links.

    values: prescribed start values of coordinates, by number: from drives, and from the scene's start.
    """

    edge: Edge
    link_a: int
    place_a: Placement
    link_b: int
    place_b: Placement
    values: Mapping[int, float]

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.edge.name

    def demands(self, poses: Sequence[Placement]) -> Demands:
        """Return residuals and wrenches of the joint, without those of its drives."""
        return demands(self.edge.kind, *self.frames(poses))

    def prescribed(self, poses: Sequence[Placement]) -> Demands:
        """Return residuals and wrenches of the coordinates that have prescribed `values`."""
        return coordinate_demands(self.edge.kind, *self.frames(poses), self.values)

    def frames(self, poses: Sequence[Placement]) -> tuple[Placement, Placement]:
        """Return both frames in the world, from the poses of all links."""
        return poses[self.link_a].of(self.place_a), poses[self.link_b].of(self.place_b)

    def coordinates(self, poses: Sequence[Placement]) -> dict[tuple[str, int], float]:
        """Return the joint coordinates [m or rad], by the joint's name and their numbers."""
        A, B = self.frames(poses)
        declared, relative = joint_type(self.edge.kind), A.inverse().of(B)
        now = declared.coordinates(relative.R, relative.p)
        return {(self.name, k): float(now[k]) for k in range(len(declared.COORDINATES))}


def constraints(
    mechanism: Mechanism, given: Mapping[str, Pieces] = NO_LAWS, starts: Sequence[Given] = ()
) -> list[Constraint]:
    """Return all joints but contacts and paths: those of the tree in the order of its links, then the closures.

    given: laws that replace the scene's.  starts: coordinates whose positions are prescribed as well.
    """
    t = mechanism.scene.time.start
    laws = dict(zip(mechanism.drives, drive_laws(mechanism.scene, given), strict=True))
    tree = [link.branch.edge for link in mechanism.links if link.branch.edge is not None and not link.massless]
    joints = []
    for edge in [*tree, *(closure.edge for closure in mechanism.closures)]:
        if edge.kind == PATH:
            continue
        a, b = mechanism.site(edge.frame_a), mechanism.site(edge.frame_b)
        values = {s.number: s.position for s in starts if s.joint == edge.name and s.position is not None}
        values |= {k: laws[name].value(t) for k, name in enumerate(edge.drives) if name is not None}
        places = (start_place(mechanism, site) for site in (a, b))
        joints.append(Constraint(edge, a.link, next(places), b.link, next(places), values))
    return joints


def outboard_place(mechanism: Mechanism, link: Link) -> Placement:
    """Return the placement of a link's inboard joint on the link itself, in the link's frame."""
    frame = link.branch.frame
    return Placement() if frame is None or not link.flexible else start_place(mechanism, mechanism.site(frame))


def demands(kind: str, A: Placement, B: Placement) -> Demands:
    """Return residuals and wrenches of a joint between two frames, without its drives."""
    declared = joint_type(kind)
    residuals, wrenches = [], []
    for k in declared.TRANSLATIONS:
        along = A.R[:, k]
        residuals.append(along @ (B.p - A.p))
        wrenches.append([*_cross(B.p, along), *along])
    for k, other in declared.ROTATIONS:
        residuals.append(A.R[:, k] @ B.R[:, other])
        wrenches.append([*_cross(B.R[:, other], A.R[:, k]), 0.0, 0.0, 0.0])
    return Demands(np.array(residuals), np.array(wrenches).reshape(-1, 6))


def coordinate_demands(kind: str, A: Placement, B: Placement, values: Mapping[int, float]) -> Demands:
    """Return residuals and wrenches of those coordinates of a joint that have prescribed values."""
    declared, relative = joint_type(kind), A.inverse().of(B)
    now = declared.coordinates(relative.R, relative.p)
    residuals, wrenches = [], []
    for k, value in values.items():
        coordinate = declared.COORDINATES[k]
        along, miss = (A, B)[coordinate.side].R[:, coordinate.axis], float(now[k]) - value
        if coordinate.turning:
            miss = (miss + np.pi) % (2.0 * np.pi) - np.pi
            wrenches.append([*along, 0.0, 0.0, 0.0])
        else:
            wrenches.append([*_cross(B.p, along), *along])
        residuals.append(miss)
    return Demands(np.array(residuals), np.array(wrenches).reshape(-1, 6))


def _cross(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    """Return the vector product; numpy's own costs fifty times as much for one pair, and thousands are needed."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def freedoms(kind: str, A: Placement, B: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Return free motions of B relative to A: axes of rotations about B's origin (turns, 3), and of slides (slides, 3).

    Both sets are orthonormal; rotations come first in the joint's speeds.
    """
    declared, (_, wrenches) = joint_type(kind), demands(kind, A, B)
    turning = wrenches[len(declared.TRANSLATIONS) :, :3]
    turns = np.linalg.svd(turning)[2][len(turning) :] if len(turning) else np.eye(3)
    return np.asarray(turns), A.R.T[[k for k in range(3) if k not in declared.TRANSLATIONS]]
