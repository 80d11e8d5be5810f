r"""Jacobian of the closures from joint axes and frames alone, scaled by the natural size of each entry.

Which rows of the Jacobian are independent is a question of size: an entry is zero when it is only rounding. Rounding is
proportional to the terms whose sum an entry is, not to the sum. A hinge axis that meets a point of the closure, for
instance, contributes the rotation times the distance along the axis, which cancels. So every entry has a natural size:
that of a rotation is the distance between the two joints, that of a slide its displacement. Rows and columns are scaled
until the largest natural size in each is one:

.. math:: J' = D_r J D_c, \qquad \max_j (D_r N D_c)_{ij} = \max_i (D_r N D_c)_{ij} = 1

Then the singular values of J' are pure numbers, independent of units, masses, axes and size, and have an absolute
floor. Small parts of large mechanisms keep their own scale.

Source: scaling: Ruiz (2001), A scaling algorithm to equilibrate both rows and columns norms in matrices, Rutherford
Appleton Laboratory, RAL-TR-2001-034.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.joints.conditions import measure
from flexclear.dynamics.model.constraints import Demands, demands, outboard_place, unit_motions
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.index_tables import closure_route, uncommon
from flexclear.dynamics.model.interface_basis import frame_index
from flexclear.dynamics.model.mechanism import Closure, Site
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.model import Model

#: singular values of naturally sized rows below this are zero.  The bound is above the rounding of a zero: an entry is
#: a sum of some ten products whose factors, frames along a chain, are right to some ten roundings of 1e-16, in all
#: 1e-14; poses are closed to 1e-13, at worst 1e-11, of the mechanism's size, which is 1e-8 of the least arm.  And it is
#: below the root of `mechanics.closures.SINGULAR`, 3e-7, at which no evaluation solves for a row.
ZERO_SINGULAR_VALUE = 1e-7


@dataclass(frozen=True)
class Motions:
    """Unit motion of each column of a numbering: rotation [rad], displacement [m] of point `at`; each (columns, 3)."""

    turn: np.ndarray
    shift: np.ndarray
    at: np.ndarray

    @property
    def twists(self) -> np.ndarray:
        """Rotation, and displacement of the point at the origin, shape (columns, 6)."""
        return np.hstack([self.turn, self.shift + np.cross(self.at, self.turn)])


@dataclass(frozen=True)
class Rates:
    """Scaled Jacobian of the closures: of free coordinates, J (rows, nv), and of driven ones, `known` (rows, drives).

    row, column: factors of scaling, of each row and of each column of both.
    """

    J: np.ndarray
    known: np.ndarray
    row: np.ndarray
    column: np.ndarray

    @cached_property
    def decomposed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """U, singular values and V^T of J, complete."""
        return np.linalg.svd(self.J)

    @property
    def values(self) -> np.ndarray:
        """Singular values, descending."""
        return self.decomposed[1]

    @property
    def rank(self) -> int:
        """Number of independent rows."""
        return int(np.sum(self.values > ZERO_SINGULAR_VALUE))

    @property
    def free(self) -> np.ndarray:
        """Motions of the free coordinates at which all residual rates are zero, shape (nv, nv - rank)."""
        nv = self.J.shape[1]
        return self.column[:nv, None] * self.decomposed[2][self.rank :].T

    @property
    def self_stresses(self) -> np.ndarray:
        """Left null space of J: multipliers in balance without loads (self-stresses), shape (rows - rank, rows)."""
        return self.decomposed[0][:, self.rank :].T * self.row

    @property
    def dependent_drives(self) -> np.ndarray:
        """True for each driven coordinate in a dependence among driven coordinates alone; shape (drives,)."""
        left = self.decomposed[0][:, self.rank :].T @ self.known
        return np.asarray(np.max(np.abs(left), axis=0, initial=0.0) > ZERO_SINGULAR_VALUE)


def rates(model: Model, poses: Sequence[Placement]) -> Rates:
    """Return the scaled Jacobian of a mechanism's closures at these poses of its links."""
    numbering, L = model.numbering, model.length
    motion, speeds = motions(model, poses), model.nv + len(model.drives)
    J, sizes = (np.zeros((model.arrays.size(m.N_CLOSURE_ROWS), speeds)) for _ in range(2))
    first = 0
    for closure in model.closures:
        mine = slice(first, first + len(closure.rows))
        for a, b, acting in natural_wrenches(closure, poses, L):
            route = uncommon(closure_route(numbering, numbering.site(a), numbering.site(b)))
            coordinate, column, sign = np.array(route, dtype=np.int64).reshape(-1, 3).T
            turn, shift, arm = motion.turn[column], motion.shift[column], acting.origin - motion.at[column]
            moment, force = acting.wrenches[:, :3], acting.wrenches[:, 3:]
            moved = moment @ turn.T + force @ (shift + np.cross(turn, arm)).T
            np.add.at(J[mine].T, coordinate, (sign * moved).T)
            angle = np.linalg.norm(turn, axis=1)
            # least arm of a rotation, in units of the mechanism's size: positions are not more exact at smaller
            # distances
            way = np.linalg.norm(shift, axis=1) + angle * (np.linalg.norm(arm, axis=1) + L * 1e-3)
            size = np.outer(np.linalg.norm(moment, axis=1), angle) + np.outer(np.linalg.norm(force, axis=1), way)
            np.add.at(sizes[mine].T, coordinate, size.T)
        first += len(closure.rows)
    by_row, by_column = scales(sizes)
    J *= by_row[:, None] * by_column
    return Rates(J[:, : model.nv], J[:, model.nv :], by_row, by_column)


def natural_wrenches(
    closure: Closure | Coupling, poses: Sequence[Placement], length: float
) -> list[tuple[Site, Site, Demands]]:
    """Return the wrenches of a closure's rows, in radians or the mechanism's size, by the sites that they act on."""
    frames = [(poses[a.link].of(a.placement), poses[b.link].of(b.placement)) for a, b in closure.ends]
    if isinstance(closure, Closure):
        return [(*closure.ends[0], demands(closure.edge.kind, *frames[0]).natural(length))]
    sides, unit = list[tuple[Site, Site, Demands]](), 1.0 if closure.second.coordinate.turning else length
    for ends, (side, factor), (A, B) in zip(closure.ends, closure.parts, frames, strict=True):
        wrench = measure(side.coordinate.gauge, A.pose, B.pose)[1] * (factor / unit)
        sides.append((*ends, Demands(np.zeros(1), np.array([[*wrench.moment, *wrench.force]]), B.p)))
    return sides


def motions(model: Model, poses: Sequence[Placement]) -> Motions:
    """Return all columns' unit motions: 1 rad, the mechanism's size, for modes that size times the root of the mass."""
    numbering, mechanism = model.numbering, model.mechanism
    turn, shift, at = (np.zeros((numbering.columns, 3)) for _ in range(3))
    for i, link in enumerate(mechanism.links):
        if link.inboard is None:
            continue
        F, G = poses[link.inboard.link].of(link.inboard.placement), poses[i].of(outboard_place(mechanism, link))
        turns, slides = unit_motions(link.kind, F, G)
        mine = slice(numbering.coordinates[i].start, numbering.coordinates[i].start + len(turns))
        turn[mine], shift[mine], at[mine] = turns, mechanism.length * slides, G.p
    for site, frame, first in numbering.ports:
        on = numbering.sites[site].link
        mine, moving = slice(first, first + len(numbering.moving(on))), numbering.bases[on].moving
        turns, slides, moved = _shape_motions(model, on, frame, poses[on])
        turn[mine], shift[mine], at[mine] = moving.T @ turns, moving.T @ slides, moved
    return Motions(turn, shift, at)


def _shape_motions(model: Model, link: int, frame: str, pose: Placement) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rotation and displacement per mode of a flexible link's frame, relative to the inboard one, undeformed."""
    own, unit = model.links[link].branch.frame, model.length * model.links[link].mass ** 0.5
    turn, shift, at = _frame_motions(model, link, frame, pose)
    if own is not None:
        held, moved_by, origin = _frame_motions(model, link, own, pose)
        turn, shift = turn - held, shift - moved_by - np.cross(held, at - origin)
    return unit * turn, unit * shift, at


def _frame_motions(model: Model, link: int, frame: str, pose: Placement) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    bundle = model.links[link].bundle
    assert bundle is not None
    k = frame_index(bundle, frame.partition(".")[2])
    turn = (pose.R @ bundle["frame_rotation_shape"].values[k]).T
    shift = (pose.R @ bundle["frame_translation_shape"].values[k]).T
    return turn, shift, pose.of(Placement(bundle["frame_position"].values[k])).p


def scales(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return factors of rows and columns that bring the largest entry of each to one; empty ones have factor one."""
    row, column = np.ones(sizes.shape[0]), np.ones(sizes.shape[1])
    # iterations of scaling; each halves the exponents by which rows and columns differ
    for _ in range(12):
        now = sizes * row[:, None] * column
        row /= _root(np.max(now, axis=1, initial=0.0))
        column /= _root(np.max(now, axis=0, initial=0.0))
    return row, column


def _root(largest: np.ndarray) -> np.ndarray:
    return np.sqrt(np.where(largest > 0.0, largest, 1.0))
