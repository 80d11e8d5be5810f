r"""The motions that closures leave free, and forces along them.

With :math:`Z` such that :math:`JZ = 0` and :math:`Z^TMZ = 1`, small motions are :math:`Z z`, and the loops' multipliers
do no work on them. The stiffness is the derivative of :math:`Z^T(\mathrm{bias} - J^T\lambda)` at fixed
:math:`\lambda`: forces in the loops stiffen or weaken a mechanism as the tension of a string does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics.linear.bench import Bench, balance, displacement_map, set_drives
from flexclear.pipeline.dynamics.linear.differences import Rounding, derivative

#: singular values of the closures below this fraction of the largest are redundant rows
RANK = 1e-9
#: widest step of a derivative, as a fraction of the mechanism's size, or of one radian
WIDEST = 1e-2
#: rounding of a sum of some dozens of terms
EPSILON = 1e-15


@dataclass(frozen=True)
class Tangent:
    """A pose of a mechanism and the free motions about it.

    q: positions.  Z: speeds per free motion, shape (nv, mobility).  moves: positions per coordinate, (nq, nv).
    bias, mass, multipliers: as in `bench.Balance`; multipliers balance `bias` best.  slip: rates of the loops.
    """

    q: np.ndarray
    Z: np.ndarray
    moves: np.ndarray
    bias: np.ndarray
    mass: np.ndarray
    multipliers: np.ndarray
    slip: np.ndarray
    redundant: int

    @property
    def unbalanced(self) -> np.ndarray:
        """Forces along the free motions that nothing balances, with their sign turned, shape (mobility,)."""
        return self.Z.T @ self.bias


def tangent(bench: Bench, q: np.ndarray) -> Tangent:
    """The free motions at positions q whose loops are closed; SolverError where these are far beyond any real pose."""
    b = balance(bench, q)
    try:
        lower = np.linalg.cholesky(b.mass)
    except np.linalg.LinAlgError:
        raise SolverError(
            f"at t = {bench.time:.6g} s: bodies are so far deformed that the mass matrix is not positive definite"
        ) from None
    spread = scipy.linalg.solve_triangular(lower, b.jacobian.T, lower=True).T
    scale = np.linalg.norm(spread, axis=1)
    rows = spread[scale > 0.0] / scale[scale > 0.0, None]
    rank, free = 0, np.eye(len(b.bias))
    if len(rows):
        _, values, axes = np.linalg.svd(rows)
        rank = int(np.sum(values > RANK * values[0]))
        free = axes[rank:].T
    Z = scipy.linalg.solve_triangular(lower.T, free)
    load = scipy.linalg.solve_triangular(lower, b.bias, lower=True)
    multipliers = np.linalg.lstsq(spread.T, load, rcond=RANK)[0] if len(spread) else np.zeros(0)
    moves = displacement_map(bench, q)
    return Tangent(
        q, Z, moves, b.bias, b.mass, multipliers, b.slip, len(b.jacobian) - rank + bench.engine.mobility.redundant
    )


def stiffness(bench: Bench, at: Tangent, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces per displacement along motions (columns), shape (n, n) [1/s^2], and an error estimate of each column."""
    size = bench.model.speed_scales
    noise = EPSILON * magnitude(motions, at.bias)

    def columns(direction: np.ndarray) -> tuple[np.ndarray, float]:
        step = at.moves @ direction
        grain = EPSILON * float(np.max(np.abs(at.q)) / np.max(np.abs(step)))

        def force(s: float) -> np.ndarray:
            b = balance(bench, at.q + s * step)
            return motions.T @ (b.bias - b.jacobian.T @ at.multipliers)

        return derivative(force, WIDEST / float(np.max(np.abs(direction) / size)), Rounding(noise, grain))

    return _stacked([columns(d) for d in motions.T], motions.shape[1])


def damping(bench: Bench, at: Tangent, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces per speed along motions (columns), gyroscopic ones included, shape (n, n) [1/s], and errors."""
    # forces that balance those of the drives' motion leave nothing of their size in the sum, only their rounding
    noise = Rounding(EPSILON * (magnitude(motions, at.bias) + magnitude(motions, _at_rest(bench, at))))
    size = bench.model.speed_scales

    def columns(direction: np.ndarray) -> tuple[np.ndarray, float]:
        def force(s: float) -> np.ndarray:
            return motions.T @ balance(bench, at.q, s * direction).bias

        return derivative(force, WIDEST / float(np.max(np.abs(direction) / size)), noise)

    return _stacked([columns(d) for d in motions.T], motions.shape[1])


def magnitude(motions: np.ndarray, bias: np.ndarray) -> float:
    """Size of the terms of which the forces along motions are sums."""
    return float(np.linalg.norm(np.abs(motions).T @ np.abs(bias)))


def _at_rest(bench: Bench, at: Tangent) -> np.ndarray:
    """Return the bias of the same pose with its drives at rest, shape (nv,)."""
    drives = bench.drives.copy()
    set_drives(bench, drives * [1.0, 0.0])
    bias = balance(bench, at.q).bias
    set_drives(bench, drives)
    return bias


def _stacked(columns: list[tuple[np.ndarray, float]], n: int) -> tuple[np.ndarray, np.ndarray]:
    """A matrix and the errors of its columns, each with its error."""
    return np.array([c for c, _ in columns]).T.reshape(n, n), np.array([e for _, e in columns])
