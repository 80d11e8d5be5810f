"""Constraints that joints and drives impose on the poses of links: residuals, wrenches, free motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.joints.conditions import condition, measure, rows
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.laws import NO_LAWS, drive_laws
from flexclear.dynamics.model.mechanism import Link, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given
from flexclear.dynamics.model.tree import PATH, Edge
from flexclear.numerics.rotations import skew

NO_VALUES: Mapping[int, float] = MappingProxyType({})


class Demands(NamedTuple):
    """Residuals (n,) [m, rad or -] of a joint, and wrenches (n, 6), moment and force, about its second frame's origin.

    A wrench resists its residual, whose rate is its power on the motion of the second frame relative to the first.
    """

    residuals: np.ndarray
    wrenches: np.ndarray
    origin: np.ndarray

    @property
    def turning(self) -> np.ndarray:
        """True for each residual that is an angle, not a length, shape (n,)."""
        return ~np.any(self.wrenches[:, 3:] != 0.0, axis=1)

    def natural(self, length: float) -> Demands:
        """Return residuals and wrenches in radians and in the mechanism's size."""
        unit = np.where(self.turning, 1.0, length)
        return Demands(self.residuals / unit, self.wrenches / unit[:, None], self.origin)

    def about(self, p: np.ndarray, length: float = 1.0) -> np.ndarray:
        """Return moments about another point, and forces times a length, shape (n, 6)."""
        force = self.wrenches[:, 3:]
        return np.hstack([self.wrenches[:, :3] + force @ skew(self.origin - p).T, length * force])


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

    def demands(self, poses: Sequence[Placement], values: Mapping[int, float] = NO_VALUES) -> Demands:
        """Return residuals and wrenches of the joint, then of coordinates with prescribed values."""
        return demands(self.edge.kind, *self.frames(poses), values)

    def frames(self, poses: Sequence[Placement]) -> tuple[Placement, Placement]:
        """Return both frames in the world, from the poses of all links."""
        return poses[self.link_a].of(self.place_a), poses[self.link_b].of(self.place_b)

    def coordinates(self, poses: Sequence[Placement]) -> dict[tuple[str, int], float]:
        """Return the joint coordinates [m or rad], by the joint's name and their numbers."""
        F, G = (frame.pose for frame in self.frames(poses))
        declared = joint_type(self.edge.kind).COORDINATES
        return {(self.name, k): float(measure(one.gauge, F, G)[0]) for k, one in enumerate(declared)}


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


def demands(kind: str, A: Placement, B: Placement, values: Mapping[int, float] = NO_VALUES) -> Demands:
    """Return residuals and wrenches of a joint between two frames, then of its coordinates with prescribed values."""
    declared, F, G = joint_type(kind), A.pose, B.pose
    conditions = [condition(F, G, *row) for row in rows(declared)]
    for k, value in values.items():
        coordinate = declared.COORDINATES[k]
        now, wrench = measure(coordinate.gauge, F, G)
        miss = now - value
        conditions.append(((miss + np.pi) % (2.0 * np.pi) - np.pi if coordinate.turning else miss, wrench))
    wrenches = np.array([[*wrench.moment, *wrench.force] for _, wrench in conditions])
    return Demands(np.array([residual for residual, _ in conditions]), wrenches.reshape(-1, 6), B.p)


def joint_positions(kind: str, F: Placement, G: Placement) -> np.ndarray:
    """Return the positions of a joint between two frames."""
    declared, relative = joint_type(kind), F.inverse().of(G)
    if len(declared.COORDINATES) < len(declared.POSITIONS):
        return np.asarray(declared.coordinates(relative.R, relative.p))
    return np.array([float(measure(one.gauge, F.pose, G.pose)[0]) for one in declared.COORDINATES])


def moved_frame(kind: str, F: Placement, x: Sequence[float] | np.ndarray) -> Placement:
    """Return the second frame of a joint at its positions."""
    relative = joint_type(kind).motion(x, x)
    return F.of(Placement(np.array(relative.p_FG), np.reshape(relative.R_FG, (3, 3))))


def unit_motions(kind: str, F: Placement, G: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and displacement of the second frame of a joint per unit of each speed, (speeds, 3) each."""
    x = joint_positions(kind, F, G).tolist()
    S = np.array(joint_type(kind).motion(x, [0.0] * 6).S).reshape(-1, 2, 3) @ F.R.T
    return S[:, 0], S[:, 1]
