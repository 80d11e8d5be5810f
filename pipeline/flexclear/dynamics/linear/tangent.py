r"""Free motions under the closure constraints, and forces along them.

With :math:`Z` such that :math:`JZ = 0` and :math:`Z^TMZ = 1`, small motions are :math:`Z z`, and the loops' multipliers
do no work on them. The stiffness is the derivative of :math:`Z^T(\mathrm{bias} - J^T\lambda)` at fixed
:math:`\lambda`: forces in the loops stiffen or weaken a mechanism as the tension of a string does.

Changes of forces are exact: the routines of the right-hand side run on dual numbers. Forces of one
mechanism change over lengths from a millimetre (gravity, springs) to a nanometre (a contact that is just closed). No
step width would fit all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flexclear.dynamics import memory as m
from flexclear.dynamics.linear.bench import (
    Bench,
    balance,
    displacement_map,
    set_drives,
    state,
)
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.specialise import dual
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.system.errors import SolverError

#: relative singular values of the closure rows below which rows are redundant
REDUNDANT_ROW = 1e-9
#: rounding of a sum of some dozens of terms
EPSILON = 1e-15


@dataclass(frozen=True)
class Tangent:
    """A pose of a mechanism and the free motions about it.

    q: positions.  Z: speeds per free motion, shape (nv, mobility).  moves: positions per coordinate, (nq, nv).
    bias, mass, multipliers: as in `bench.Balance`; multipliers balance `bias` best.
    forces: size of the balancing forces (`bench.Balance.moment`).
    """

    q: np.ndarray
    Z: np.ndarray
    moves: np.ndarray
    bias: np.ndarray
    mass: np.ndarray
    multipliers: np.ndarray
    redundant: int
    forces: float

    @property
    def unbalanced(self) -> np.ndarray:
        """Negative unbalanced forces along the free motions, shape (mobility,)."""
        return self.Z.T @ self.bias

    def magnitude(self, size: np.ndarray) -> float:
        """Return the size of the balancing forces along the free motions; size: natural unit of each speed, (nv,)."""
        return self.forces * float(np.linalg.norm(np.abs(self.Z).T @ (1.0 / size)))


def tangent(bench: Bench, q: np.ndarray) -> Tangent:
    """Return the free motions at closed positions q; raise SolverError at deformations beyond any real pose."""
    b = balance(bench, q)
    try:
        Z, lower, spread = free_motions(b.mass, b.jacobian)
    except np.linalg.LinAlgError:
        raise SolverError(
            f"at t = {bench.time:.6g} s: the bodies deform so much that the mass matrix is not positive definite"
        ) from None
    load = scipy.linalg.solve_triangular(lower, b.bias, lower=True)
    multipliers = np.linalg.lstsq(spread.T, load, rcond=REDUNDANT_ROW)[0] if len(spread) else np.zeros(0)
    moves = displacement_map(bench, q)
    redundant = len(b.jacobian) - (len(b.bias) - Z.shape[1]) + bench.engine.mobility.redundant
    return Tangent(q, Z, moves, b.bias, b.mass, multipliers, redundant, b.moment)


def free_motions(mass: np.ndarray, jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Z, shape (nv, mobility); the Cholesky factor L of the mass, and J L^-T.

    Raises LinAlgError for a mass that is not positive definite.
    """
    lower = np.linalg.cholesky(mass)
    spread = scipy.linalg.solve_triangular(lower, jacobian.T, lower=True).T
    scale = np.linalg.norm(spread, axis=1)
    rows = spread[scale > 0.0] / scale[scale > 0.0, None]
    free = np.eye(len(mass))
    if len(rows):
        _, values, axes = np.linalg.svd(rows)
        free = axes[int(np.sum(values > REDUNDANT_ROW * values[0])) :].T
    return scipy.linalg.solve_triangular(lower.T, free), lower, spread


def stiffness(bench: Bench, at: Tangent, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return forces per displacement along motions (columns), shape (n, n) [1/s^2], and rounding errors of columns."""
    directions = np.zeros((motions.shape[1], bench.model.ny))
    directions[:, : len(at.q)] = (at.moves @ motions).T
    changes = force_changes(bench, at.q, directions, at.multipliers)
    return motions.T @ changes.T, _rounding_of_changes(bench, motions, changes, at.forces)


def damping(bench: Bench, at: Tangent, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return forces per speed along motions, with gyroscopic ones, shape (n, n) [1/s], and rounding errors likewise."""
    directions = np.zeros((motions.shape[1], bench.model.ny))
    directions[:, bench.model.speeds] = motions.T
    changes = force_changes(bench, at.q, directions, np.zeros_like(at.multipliers))
    return motions.T @ changes.T, _rounding_of_changes(bench, motions, changes, _forces_by_turning(bench, at))


def _forces_by_turning(bench: Bench, at: Tangent) -> float:
    """Return the contribution of the drives' motion to the balancing forces, per speed of the fastest; 0 at rest."""
    if not bench.fastest:
        return 0.0
    moving, drives = balance(bench, at.q).acting, bench.drives
    try:
        set_drives(bench, drives * [1.0, 0.0])
        resting = balance(bench, at.q).acting
    finally:
        set_drives(bench, drives)
    return float(np.max(np.abs(moving - resting), initial=0.0)) / bench.fastest


def _rounding_of_changes(bench: Bench, motions: np.ndarray, changes: np.ndarray, forces: float) -> np.ndarray:
    """Return the rounding error of changes of forces along motions, by the size of all summands, shape (n,).

    forces: balancing forces, as moments, per displacement or speed: their sum may itself be rounding.
    """
    reach = np.max(np.abs(motions) / bench.model.speed_scales[:, None], axis=0, initial=0.0)
    terms = np.linalg.norm(np.abs(motions).T @ np.abs(changes).T, axis=0)
    return EPSILON * np.asarray(terms + forces * reach * np.linalg.norm(reach))


def force_changes(bench: Bench, q: np.ndarray, directions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
    """Return changes of bias - J^T multipliers at rest in positions q, along directions; shape (directions, nv).

    directions: changes of the state, (directions, NY).  multipliers: constant, (rows,).  Raises SolverError where the
    equations are singular.
    """
    rates = change_rates(bench, q, directions, multipliers)
    return dual.changes(rates[bench.model.speeds], len(directions)) @ modes_of(bench.model.arrays).T


def change_rates(
    bench: Bench,
    q: np.ndarray,
    directions: np.ndarray,
    multipliers: np.ndarray | None = None,
    laws: np.ndarray | None = None,
) -> np.ndarray:
    """Return the rates of the state at rest in positions q, with their changes; of speeds the forces that hold them, as
    `mechanics.balance` has them.

    directions: changes of the state, (directions, NY).  multipliers: (rows,), zero by default.  laws: changes of the
    entries of the table LAW, (directions, entries).
    """
    from flexclear.dynamics.mechanics.balance import store_holding_forces  # here: they import the compiler
    from flexclear.dynamics.mechanics.of_topology import mechanism_of
    from flexclear.dynamics.mechanics.tables import Tables
    from flexclear.dynamics.routines.numbers import Numbers

    engine, model, h = bench.engine, bench.model, bench.engine.h
    y = state(bench, q)
    engine.view(m.Y)[:] = y
    engine.evaluate_laws(bench.time)
    w, topology = list(engine.w), topology_of(model.arrays, h)
    w[h[m.Y] : h[m.Y] + len(y)] = dual.seed_changes(y, directions)
    if laws is not None:
        first = h[m.LAW.at]
        w[first : first + laws.shape[1]] = dual.seed_changes(engine.w[first : first + laws.shape[1]], laws)
    calls = Numbers(h, model.arrays.f, np.array(w, dtype=object), engine.n, int(h[m.Y]), int(h[m.SLOPES]))
    given = np.zeros(h[m.N_KEPT_ROWS]) if multipliers is None else multipliers
    store_holding_forces(mechanism_of(Tables(model.parts, topology)), list(given), calls)
    return calls.rates[: len(y)]
