"""Out of a singular pose in which a run starts, along the branch that the given velocities are tangent to.

In the pose itself the equations have no unique solution, and just beside it an integrator's stages would leave
the branch. A short way beside it both are regular: so the motion over that way is a polynomial through the
start whose slopes are those of the equations at points which are closed first (collocation, by Picard's iteration).
Velocities that belong to no branch show in that closing changes them, however short the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from pipeline.core.errors import SolverError
from pipeline.dynamics import memory as m
from pipeline.dynamics.run import singular
from pipeline.dynamics.run.engine import Engine
from pipeline.dynamics.run.observation import observe

#: points of the polynomial: the zero of its first gap is the singular pose
POINTS = 8
#: the way is first this share of the time in which the fastest coordinate moves by its unit, then half of that
FIRST, HALVINGS = 0.1, 6
#: rounds of Picard's iteration; each leaves of the error a share like the way's
ROUNDS = 30
#: velocities may differ from those of a branch by this share: they are given with some digits
SAME = 1e-6
#: rounding of slopes so near to the pose, in units of the coordinates
ROUNDING = 1e-11

NODES = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, POINTS + 1) / POINTS))


def _integrals(ends: np.ndarray) -> np.ndarray:
    """Weights (ends, POINTS) of values at the nodes in the integral of their polynomial from 0 to each end."""
    basis = [chebyshev.chebint(row, lbnd=-1.0) for row in np.eye(POINTS)]
    integrals = 0.5 * np.array([chebyshev.chebval(2.0 * ends - 1.0, c) for c in basis]).T
    return np.asarray(integrals @ np.linalg.inv(chebyshev.chebvander(2.0 * NODES - 1.0, POINTS - 1)))


#: weights of values at the nodes in the value of their polynomial at the start
AT_START = chebyshev.chebvander(-1.0, POINTS - 1) @ np.linalg.inv(chebyshev.chebvander(2.0 * NODES - 1.0, POINTS - 1))


@dataclass(frozen=True)
class Departure:
    """The way out. span [s]; y0: state at the start; slopes at the nodes, (POINTS, n); y: state at its end, closed."""

    span: float
    y0: np.ndarray
    slopes: np.ndarray
    y: np.ndarray
    evaluations: int

    def states(self, after: np.ndarray) -> np.ndarray:
        """States at times after the start [s], (len(after), n)."""
        return np.asarray(self.y0 + self.span * _integrals(after / self.span) @ self.slopes)


def depart(engine: Engine, y0: np.ndarray) -> Departure:
    """From the state at the start; SolverError when its velocities are not those of one smooth motion.

    y0: with all loops closed.
    """
    nq, nv = engine.model.nq, engine.model.nv
    engine.select_pieces(0.5 * (engine.breaks[0] + engine.breaks[1]))
    engine.attempt(y0, engine.start)
    slope = engine.slope.copy()
    slope[nq:] = 0.0
    floors = engine.model.arrays.table(m.FLOORS)["magnitude"][engine.model.arrays.table(m.GROUPS)["group"]]
    fastest = float(np.max(np.abs(slope[:nq] / floors[:nq]), initial=0.0))
    if fastest > 0.0:
        span = min(FIRST / fastest, 0.5 * (engine.breaks[1] - engine.breaks[0]))
        size = np.where(np.arange(len(y0)) < nq, 1.0, fastest)[: nq + nv] * floors[: nq + nv]
        for _ in range(HALVINGS):
            found = _along(engine, y0, slope, span, size)
            if found is not None:
                return found
            span *= 0.5
    raise SolverError(engine.mobility.singular_start)


def _along(engine: Engine, y0: np.ndarray, slope: np.ndarray, span: float, size: np.ndarray) -> Departure | None:
    """The way of one length; None when there is none within the tolerance.

    size: of positions and speeds, that what is left is compared with.
    """
    nq, n = engine.model.nq, len(size)
    start, weights, used = y0.copy(), span * _integrals(NODES), 0
    states = y0 + span * NODES[:, None] * slope
    singular.select_rows(engine, states[-1], engine.start + span)
    for _ in range(2):  # once more with the velocities that the branch itself has at the start
        for _ in range(ROUNDS):
            seen = _closed(engine, states, span)
            used += 2 * POINTS
            if seen is None:
                return None
            closed, slopes = seen
            before, states = states, start + weights @ slopes
            if np.max(np.abs(states - before)[:, :n] / size) < ROUNDING:
                break
        start[nq:n] = (AT_START @ closed[:, nq:n])[0]
        if np.max(np.abs(start - y0)[:n] / size) > SAME:
            return None
    left = np.max(np.abs(closed - states)[:, :n] / size)
    if not left <= max(engine.rtol, ROUNDING):
        return None
    return Departure(span, start, slopes, closed[-1], used)


def _closed(engine: Engine, states: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray] | None:
    """States at the nodes with their loops closed, and the slopes there; None where that cannot be."""
    times = engine.start + span * NODES
    seen = observe(engine, np.column_stack([times, states]))
    if np.any(seen.status):
        return None
    closed, slopes = seen.state, np.zeros_like(states)
    for line, y, t in zip(slopes, closed, times, strict=True):
        if not engine.attempt(y, float(t)):
            return None
        line[:] = engine.slope
    return closed, slopes
