"""What the joints of a system demand of the poses of its links, before anything is compiled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.registry import lookup
from pipeline.dynamics.assembly.merge import Placement
from pipeline.dynamics.assembly.system import Link, System
from pipeline.dynamics.assembly.tree import Edge, joint_class


@dataclass(frozen=True)
class Constraint:
    """A joint between frames on two links; `value`: what its drive prescribes at the start, or None."""

    edge: Edge
    link_a: int
    place_a: Placement
    link_b: int
    place_b: Placement
    value: float | None

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.edge.name

    def frames(self, poses: Sequence[Placement]) -> tuple[Placement, Placement]:
        """Both frames in the world, from the poses of all links."""
        return poses[self.link_a].of(self.place_a), poses[self.link_b].of(self.place_b)


def constraints(system: System) -> list[Constraint]:
    """All joints but contacts: those of the tree in the order of its links, then the closures."""
    found = []
    for i, link in enumerate(system.links):
        edge = link.branch.edge
        if edge is not None:
            assert link.inboard is not None
            place = outboard_place(system, link)
            value = None if edge.drive is None else _start_value(system, edge, link.branch.reverse)
            found.append(Constraint(edge, link.inboard.link, link.inboard.place, i, place, value))
    for edge, a, b in system.closures:
        found.append(Constraint(edge, a.link, a.place, b.link, b.place, None))
    return found


def outboard_place(system: System, link: Link) -> Placement:
    """A link's own side of its inboard joint, in the link's frame."""
    edge = link.branch.edge
    if edge is None or not link.flexible:
        return Placement()
    return system.frames[edge.frame_a if link.branch.reverse else edge.frame_b].place


def _start_value(system: System, edge: Edge, reverse: bool) -> float:
    """Coordinate that the drive prescribes when the run starts."""
    drive, t = system.scene.drive[str(edge.drive)], system.scene.time.start
    pieces = lookup("pipeline.dynamics.drives", drive.law.type, where="[drive]")(drive.law)
    piece = pieces[max(int(np.searchsorted(pieces[:, 0], t, side="right")) - 1, 0)]
    value = float(np.polyval(piece[:0:-1], t - piece[0]))
    return -value if reverse else value


def demands(kind: str, A: Placement, B: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n,) [m or -] of a joint, and the wrenches (n, 6) (moment about the origin, force) that resist them.

    A wrench times the twist of B relative to A (angular velocity; velocity of the point at the origin) is the
    residual's rate.
    """
    declared = joint_class(kind)
    residuals, wrenches = [], []
    for k in declared.TRANSLATIONS:
        along = A.R[:, k]
        residuals.append(along @ (B.p - A.p))
        wrenches.append([*np.cross(B.p, along), *along])
    for k, other in declared.ROTATIONS:
        residuals.append(A.R[:, k] @ B.R[:, other])
        wrenches.append([*np.cross(B.R[:, other], A.R[:, k]), 0.0, 0.0, 0.0])
    return np.array(residuals), np.array(wrenches).reshape(-1, 6)


def prescribed(kind: str, A: Placement, B: Placement, value: float) -> tuple[np.ndarray, np.ndarray]:
    """The same for the one coordinate of a driven joint."""
    declared, relative = joint_class(kind), A.inverse().of(B)
    miss = float(declared.coordinates(relative.R, relative.p)[0]) - value
    along = A.R[:, 2]
    if declared.POSITIONS == "r":
        wrench = [*along, 0.0, 0.0, 0.0]
        miss = (miss + np.pi) % (2.0 * np.pi) - np.pi
    else:
        wrench = [*np.cross(B.p, along), *along]
    return np.array([miss]), np.array([wrench])


def freedoms(kind: str, A: Placement, B: Placement, length: float) -> np.ndarray:
    """Basis (n, 6) of the twists of B relative to A that a joint allows; velocities in units of `length` per second."""
    _, wrenches = demands(kind, A, B)
    if not len(wrenches):
        return np.eye(6)
    scaled = wrenches * np.array([1.0 / length] * 3 + [1.0] * 3)
    _, _, Vt = np.linalg.svd(scaled)
    return np.asarray(Vt[len(wrenches) :])
