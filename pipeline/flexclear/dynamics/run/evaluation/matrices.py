"""Matrices of a mechanism in the state evaluated last, by its routines on numbers: milliseconds, without a compiler."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics.balance import store_holding_forces
from flexclear.dynamics.mechanics.evaluation import eliminate_coordinates, place_links
from flexclear.dynamics.mechanics.loops import Loops, factorise_loops, jacobian
from flexclear.dynamics.mechanics.mechanism import Frame, Link
from flexclear.dynamics.mechanics.modes import Block, Modes
from flexclear.dynamics.mechanics.of_topology import mechanism_of
from flexclear.dynamics.mechanics.record import moving_parts
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.mechanics.trees import on_body
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.routines.numbers import Numbers
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.dynamics.vectors import ZERO, Motion, Vector, Wrench

if TYPE_CHECKING:
    from flexclear.dynamics.run.evaluation.engine import Engine

#: unit forces, and unit moments
UNITS = [Vector([float(i == k) for i in range(3)]) for k in range(3)]
UNIT_WRENCHES = [*(Wrench(ZERO, one) for one in UNITS), *(Wrench(one, ZERO) for one in UNITS)]


class Matrices:
    """A mechanism on numbers, its unknown coordinates eliminated; every_row: with all closure rows, not the selected.

    Modes have the interface basis (`model.interface_basis`).
    """

    def __init__(self, engine: Engine, *, every_row: bool = False) -> None:
        self.model, arrays = engine.model, engine.model.arrays
        tables, self.calls = on_numbers(engine, arrays.h if every_row else engine.h)
        self.mechanism, self._rows0 = mechanism_of(tables), tables.table(m.CLOSURES)["kept0"].tolist()
        self._first = dict[Link | Modes | Block, int]()
        for moved, row in moving_parts(tables, self.mechanism):
            self._first[moved] = int(row["c0"])
            for block in moved.blocks if isinstance(moved, Modes) else ():
                self._first[block] = int(row["c0"]) + block.at.start
        self._shape = tables.size(m.N_KEPT_ROWS), arrays.size(m.NV) + arrays.size(m.N_DRIVES)
        with self.calls.building():
            place_links(self.mechanism)
            eliminate_coordinates(self.mechanism)

    @property
    def factor(self) -> np.ndarray:
        """L of the mass matrix M = L L^T, shape (nv, nv)."""
        L = np.zeros((self.model.nv,) * 2)

        def fill(begin: int, link: Link, K: Sequence[Wrench]) -> None:
            on_carrier = [one.about(link.step.p_PB) for one in K]
            for moved, rows in jacobian([(link.frame, on_carrier)]).items():
                if rows:
                    L[self._first[moved] :][: len(rows), begin : begin + len(K)] = rows

        for link in self.mechanism.links:
            k, S = self._first[link], [] if link.driven else link.step.S
            of_joint = [gain.K for gain in link.gains]
            fill(k, link, of_joint)
            for i, s in enumerate(S):
                L[k + i, k : k + i + 1] = [*(K.on(s) for K in of_joint[:i]), 1.0 / link.gains[i].root]
            for block in link.modes.blocks if link.modes else ():
                first, gains = self._first[block], block.gains
                fill(first, link, gains.K)
                for i, row in enumerate(gains.L):
                    L[first + i, first : first + i + 1] = [*row[:-1], 1.0 / row[-1]]
                for before, below in block.below.items():
                    L[first : first + len(below), self._first[before] :][:, : len(below[0])] = below
                for i, s in enumerate(S):
                    L[k + i, first : first + len(gains.K)] = [K.on(s) for K in gains.K]
        return L

    @property
    def loops(self) -> Loops:
        """The closures, passed to the ground and factorised; once only."""
        with self.calls.building():
            return factorise_loops(self.mechanism, self.calls)

    def dense(self, rows: Mapping[int, Mapping[Any, c.Rows]]) -> np.ndarray:
        """Return numbers of closure rows, which are given by closure and by what they move, (rows, speeds)."""
        full = np.zeros(self._shape)
        for number, by in rows.items():
            for moved, block in by.items():
                if block:
                    at = self._rows0[number], self._first[moved]
                    full[at[0] : at[0] + len(block[0]), at[1] : at[1] + len(block)] = np.transpose(block)
        return full

    @property
    def jacobian(self) -> np.ndarray:
        """Rates of all rows per speed, free ones first, then prescribed; shape (rows, speeds)."""
        return self.dense({number: jacobian(ends, driven=True) for number, ends in self.loops.ends.items()})

    def motion(self, frame: Frame) -> Motion:
        """Return the motion of a frame."""
        with self.calls.building():
            return on_body(*frame.placed)

    def moved_by(self, a: Frame, b: Frame, wrenches: Iterable[Wrench]) -> np.ndarray:
        """Return motions between two frames, which wrenches on b, about its origin, choose; per speed, (.., speeds)."""
        p, ways = self.motion(b).p_WB, list(wrenches)
        on_a, on_b = ([wrench.about(p - one.carrier.motion.p_WB) for wrench in ways] for one in (a, b))
        found = np.zeros((len(ways), self._shape[1]))
        for moved, block in jacobian([(a, [wrench * -1.0 for wrench in on_a]), (b, on_b)], driven=True).items():
            if block:
                found[:, self._first[moved] :][:, : len(block)] = np.transpose(block)
        return found

    def natural_lengths(self, factor: np.ndarray) -> np.ndarray:
        """Return the length in the metric of the mass that each closure row would have without cancellation; (rows,).

        factor: L of the mass matrix.  A rotation has the mechanism's size as its arm, in place of distances that only
        rounding resolves.  All lengths are 0 where the mass matrix has no factor.
        """
        from scipy.linalg import solve_triangular  # slow to import, and most mechanisms have no redundant rows

        arrays, lengths, nv = self.model.arrays, np.zeros(self._shape[0]), self.model.nv
        if not np.all(factor.diagonal() > 0.0):
            return lengths
        inverse = solve_triangular(factor, np.eye(nv), lower=True, check_finite=False)
        mobility = np.sum(inverse**2, axis=0)  # diagonal of M^-1
        for row, one in zip(arrays.table(m.CLOSURES), self.mechanism.closures, strict=True):
            span, total = slice(row["row0"], row["row0"] + row["n_rows"]), np.zeros(row["n_rows"])
            pairs = zip(one.frames[::2], one.frames[1::2], strict=True)
            for (a, b), (turning, ratio) in zip(pairs, _rows_of(self.model, row), strict=True):
                motions = self.moved_by(a, b, UNIT_WRENCHES)[:, :nv]
                angle = np.linalg.norm(motions[3:], axis=0)
                way = np.linalg.norm(motions[:3], axis=0) + self.model.length * angle
                along, about = (np.sum((ratio * size) ** 2 * mobility) for size in (way, angle))
                total = total + np.where(turning, about, along)
            lengths[span] = np.sqrt(total)
        return lengths


def holding_forces(engine: Engine) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces that the motion needs without free accelerations, shape (nv,), with those on modes in the
    interface basis; and the wrench that each link and its subtree need for it, (links, 6): moments about the world's
    origin, and forces."""
    tables, calls = on_numbers(engine, engine.h)
    mechanism, nothing = mechanism_of(tables), [0.0] * tables.size(m.N_KEPT_ROWS)
    store_holding_forces(mechanism, nothing, calls)
    on_links = [link.rest.F.about(link.motion.p_WB) for link in mechanism.links]
    on_ground = sum((rest.F for rest, _ in mechanism.ground.beyond), Wrench(ZERO, ZERO))
    wrenches = [[*one.moment, *one.force] for one in (on_ground, *on_links)]
    return calls.rates[engine.model.speeds].copy(), np.array(wrenches, dtype=float)


def on_numbers(engine: Engine, h: np.ndarray) -> tuple[Tables, Numbers]:
    """Return a topology, and a list whose calls are done at once; the engine is not changed."""
    arrays, own = engine.model.arrays, engine.h
    calls = Numbers(own, arrays.f, engine.w.copy(), engine.n, int(own[m.Y]), int(own[m.SLOPES]))
    return Tables(engine.model.parts, topology_of(arrays, h)), calls


def _rows_of(model: Model, closure: Any) -> list[tuple[np.ndarray, float]]:
    """Return, for each joint of a closure (row of CLOSURES), the mask of its rotational rows, and their factor."""
    arrays, k = model.arrays, closure["coupling"]
    if k < 0:
        rows = slice(closure["row0"], closure["row0"] + closure["n_rows"])
        return [(arrays.table(m.CLOSURE_ROWS)["kind"][rows] == 1, 1.0)]
    turning, coupling = arrays.table(m.GAUGES)["turning"] == 1, arrays.table(m.NAMED["couplings"])[k]
    ratio = float(arrays.table(m.NAMED["coupling_numbers"])["ratio"][k])
    return [(turning[coupling["second"]], 1.0), (turning[coupling["first"]], ratio)]
