"""The motion over a singular pose, or out of one: a polynomial with the slopes of the equations at closed states.

In the pose the equations have no unique solution, and near it they amplify the errors of a method, so that no method
can place its stages there. The motion itself is smooth on its branch. So it is computed as a polynomial through a
regular state, with the slopes of the equations at points whose loops are closed first (collocation, by Picard's
iteration); points too close to the pose are omitted. A polynomial that is closed on both sides and smooth between them
follows its branch. Four checks accept it: the iteration converges, closing changes nothing, the loops are closed
between the points, and one point less gives the same end. It depends on no method and no tolerance.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.7 (collocation).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Blocks
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import ROUNDING as CLOSED
from flexclear.dynamics.run.evaluation.observation import observe_with, rows_of

#: number of points of the polynomial; the end is one of them, the start is not
POINTS = m.COLLOCATION_ROWS - 1
NODES = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, POINTS + 1) / POINTS))
#: points where a closure row has less than this fraction of its independence at the best point are omitted; or less
#: than the second fraction when the first omits more than MANY_POINTS: a slow motion is near the pose for long
LEAST_INDEPENDENCE, LEAST_WHERE_SLOW, MANY_POINTS = 0.05, 0.005, 2
#: out of a singular pose, slopes of so many points predict the next; corrections of the start's speeds to the branch
LED, SPEED_CORRECTIONS = 2, 4
#: most iterations; they end when the change is below CONVERGED, or below STAGNATED without further progress
RELAXATIONS, HELPS, CONVERGED, STAGNATED = 40, 0.3, 1e-13, 1e-10
#: the iteration fails when a change is larger than the last by this factor, and, after so many, when the unresolved
#: part does not fall
WORSE, EARLY_ITERATIONS = 10.0, 6
#: admissible error of the polynomial, in units of the coordinates and in fractions of the mechanism's size; admissible
#: change of its end without one of the points, at least ten times its error
POLYNOMIAL_ERROR, SENSITIVE = 1e-10, 1e-9

#: pivot ratios of the closures at which accelerations have eight digits when loops are closed to 1e-14, and six digits,
#: which must suffice when the row's own pose gives none
CLEAR, NEARLY_CLEAR = 1e-4, 1e-6
#: first distance in time from a singular pose, as fraction of the polynomial over it, its factor between attempts, and
#: the number of attempts
FIRST_DISTANCE, WIDER, DISTANCE_TRIES = 1e-4, 2.0, 11
#: points of evaluation, in units of the distance, and their weights in the limit between them: exact for quintics
SIDES, WEIGHTS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]), np.array([1.0, -6.0, 15.0, 15.0, -6.0, 1.0]) / 20.0


@dataclass(frozen=True)
class Collocation:
    """A polynomial motion. start, span [s]; series: Chebyshev coefficients of the state, (COLLOCATION_ROWS, n)."""

    start: float
    span: float
    series: np.ndarray

    @property
    def end(self) -> float:
        """Time of its end [s]."""
        return self.start + self.span

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return the states at times [s], shape (len(times), n)."""
        return np.asarray(chebyshev.chebval(2.0 * (np.asarray(times) - self.start) / self.span - 1.0, self.series).T)

    def lay(self, engine: Engine) -> None:
        """Store the polynomial for the stepper, and its start as the stepper's state."""
        engine.view(m.Y)[:] = self.states(np.array([self.start]))[0]
        engine.view(m.COLLOCATION)[:] = self.series.ravel()
        engine.control[m.COLLOCATED] = self.span


@dataclass(frozen=True)
class Lead:
    """A prediction out of a singular pose. state: approximate state by time [s].

    turn: admissible correction of the start's speeds to those of the branch, as a fraction of the fastest; 0: none.
    """

    state: Callable[[float], np.ndarray]
    turn: float


@dataclass(frozen=True)
class Sample:
    """A closed state at a point: its slope, and the independence of the closure rows; sound: whether these exist."""

    y: np.ndarray
    slope: np.ndarray
    independence: np.ndarray
    sound: bool


class Sampler:
    """Evaluates closed states with the laws and contacts in force; `restore` leaves the engine as it was."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.evaluations = engine, 0
        laws = engine.model.arrays.size(m.N_LAWS)
        self._pieces = engine.n[engine.n[m.ACTIVE] :][:laws].copy()
        self._contacts = engine.modes.copy(), engine.latched.copy()
        self._kept = engine.w.copy(), engine.n.copy()

    def restore(self) -> None:
        """Restore the engine's memory, except the number of evaluations."""
        self.engine.w[:], self.engine.n[:] = self._kept
        self.engine.n[m.EVALUATIONS] += self.evaluations

    def closed(self, t: float, y: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return the state nearest to y with its loops closed, and whether there is one."""
        row = rows_of(self.engine, y[None], t, *self._contacts)
        seen = observe_with(self.engine, row, self._pieces[None, :], CLOSED)
        self.evaluations += 2
        return seen["state"][0].copy(), bool(seen["status"][0, 0] == m.OK)

    def sample(self, t: float, y: np.ndarray) -> Sample:
        """Return the sample at a state after closing its loops."""
        there, sound = self.closed(t, y)
        sound &= self.attempt(t, there)
        return Sample(there, self.slope(), self.engine.independence(), sound)

    def attempt(self, t: float, y: np.ndarray) -> bool:
        """Evaluate a state without closing its loops."""
        self.evaluations += 1
        return self.engine.attempt(y, t)

    def slope(self) -> np.ndarray:
        """Return the slope of the state evaluated last."""
        return self.engine.slope.copy()


def collocate(
    sampler: Sampler, t: float, y: np.ndarray, span: float, begin: np.ndarray | Lead, fraction: float = 1.0
) -> Collocation | None:
    """Return the motion over a span from a closed state; None without a smooth and resolved one.

    begin: the slope at the start; in a singular pose, which has none, a prediction out of it.  fraction: independence
    of a closure row at the ends over its largest; rounding follows the square.
    """
    lead = begin if isinstance(begin, Lead) else None
    samples = _march(sampler, t, y, span, begin)
    used = _far_from_singular(samples, LEAST_INDEPENDENCE)
    if lead is None and used.sum() < POINTS - MANY_POINTS:
        used = _far_from_singular(samples, LEAST_WHERE_SLOW)
    # 6: least number of remaining points
    if used.sum() < 6:
        return None
    evaluated, nodes = [s for s, far in zip(samples, used, strict=True) if far], NODES[used]
    # 100.0: these bounds are larger by this factor for a motion from rest out of a pose: it is near the pose for long
    # 0.03: and, when a row has less than this fraction of its independence at the ends, by the square of their ratio
    blur = 100.0 if lead is not None and lead.turn == 0.0 else max(1.0, (0.03 / fraction) ** 2)
    for _ in range(SPEED_CORRECTIONS if lead is not None and lead.turn > 0.0 else 1):
        size = _sizes(sampler.engine, y, [s.slope for s in evaluated])
        iterated = _iterate(sampler, t, y, span, nodes, evaluated, blur * size)
        if iterated is None:
            return None
        evaluated, slopes, left = iterated
        if lead is None or lead.turn == 0.0:
            break
        better = _speeds_at_start(sampler.engine, y, nodes, [s.y for s in evaluated])
        if not np.max(np.abs(better - y) / size) <= lead.turn:
            return None
        y = better
    series = _series(nodes, slopes, y, span)
    made = Collocation(t, span, series)
    unresolved = _sensitivity(nodes, slopes, span, blur * size)
    sound = (
        left <= POLYNOMIAL_ERROR
        and unresolved <= SENSITIVE
        and _largest_opening(sampler, made, nodes) <= blur * POLYNOMIAL_ERROR
    )
    return made if sound else None


def _iterate(
    sampler: Sampler, t: float, y: np.ndarray, span: float, nodes: np.ndarray, evaluated: list[Sample], size: np.ndarray
) -> tuple[list[Sample], np.ndarray, float] | None:
    """Iterate (Picard) from the slopes at the nodes; return the last samples, their slopes, the change by closing."""
    slopes = np.array([s.slope for s in evaluated])
    weights, last, rough = _integrals(nodes, nodes), np.inf, np.inf
    states = y + span * weights @ slopes
    for k in range(RELAXATIONS):
        evaluated = [sampler.sample(t + x * span, state) for x, state in zip(nodes, states, strict=True)]
        if not all(s.sound for s in evaluated):
            return None
        slopes = np.array([s.slope for s in evaluated])
        left = float(np.max(np.abs([s.y for s in evaluated] - states) / size))
        before, states = states, y + span * weights @ slopes
        change = float(np.max(np.abs(states - before) / size))
        if change <= CONVERGED or (change <= STAGNATED and change > HELPS * last):
            return evaluated, slopes, left
        unresolved = _sensitivity(nodes, slopes, span, size)
        if not change <= WORSE * last or (
            k >= EARLY_ITERATIONS and unresolved > SENSITIVE and unresolved > HELPS * rough
        ):
            return None
        last, rough = change, unresolved
    return None


def _speeds_at_start(engine: Engine, y: np.ndarray, nodes: np.ndarray, closed: list[np.ndarray]) -> np.ndarray:
    """Return the state with the branch's own speeds at the start, extrapolated from closed states on it."""
    speeds, better = engine.model.speeds, y.copy()
    polynomial = np.linalg.solve(chebyshev.chebvander(2.0 * nodes - 1.0, len(nodes) - 1), np.array(closed)[:, speeds])
    better[speeds] = chebyshev.chebval(-1.0, polynomial)
    return better


def _march(sampler: Sampler, t: float, y: np.ndarray, span: float, begin: np.ndarray | Lead) -> list[Sample]:
    """Return samples at the nodes, each state predicted by the polynomial through the slopes before it."""
    nodes, slopes = ([], []) if isinstance(begin, Lead) else ([0.0], [begin])
    samples = list[Sample]()
    for x in NODES:
        if isinstance(begin, Lead) and len(nodes) < LED:
            state = begin.state(t + x * span)
        else:
            state = y + span * (_integrals(np.array(nodes), np.array([x]))[0] @ np.array(slopes))
        samples.append(sampler.sample(t + x * span, state))
        if samples[-1].sound and _share(samples[-1], samples) >= LEAST_INDEPENDENCE:
            nodes.append(x)
            slopes.append(samples[-1].slope)
    return samples


def _share(sample: Sample, samples: list[Sample]) -> float:
    """Return the least ratio of a row's independence to its largest at any sample."""
    if not len(sample.independence):
        return 1.0
    best = np.max([s.independence for s in samples if s.sound], axis=0)
    return float(np.min(sample.independence / best))


def _far_from_singular(samples: list[Sample], least: float) -> np.ndarray:
    """Return a mask of the usable samples."""
    if not any(s.sound for s in samples):
        return np.zeros(len(samples), dtype=bool)
    return np.array([s.sound and _share(s, samples) >= least for s in samples])


def _sizes(engine: Engine, y: np.ndarray, slopes: list[np.ndarray]) -> np.ndarray:
    """Return the scales of errors of positions and speeds; the rest of the state follows from them."""
    nq, unit = engine.model.nq, engine.model.state_scales
    fastest = float(np.max(np.abs(np.array(slopes)[:, :nq]) / unit[:nq], initial=0.0))
    size = np.where(np.arange(len(y)) < nq, 1.0, fastest) * unit
    size[engine.model.speeds.stop :] = np.inf
    return size


def _integrals(nodes: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return weights (ends, nodes) of values at the nodes in the integral of their polynomial from 0 to each end."""
    degree = len(nodes) - 1
    basis = [chebyshev.chebint(row, lbnd=-1.0) for row in np.eye(degree + 1)]
    integrals = 0.5 * np.array([chebyshev.chebval(2.0 * ends - 1.0, c) for c in basis]).T
    return np.asarray(np.linalg.solve(chebyshev.chebvander(2.0 * nodes - 1.0, degree).T, integrals.T).T)


def _series(nodes: np.ndarray, slopes: np.ndarray, y: np.ndarray, span: float) -> np.ndarray:
    """Return the Chebyshev coefficients of the state, padded to COLLOCATION_ROWS."""
    derivative = np.linalg.solve(chebyshev.chebvander(2.0 * nodes - 1.0, len(nodes) - 1), slopes)
    series = np.zeros((m.COLLOCATION_ROWS, len(y)))
    series[: len(nodes) + 1] = 0.5 * span * chebyshev.chebint(derivative, lbnd=-1.0)
    series[0] += y
    return series


def _sensitivity(nodes: np.ndarray, slopes: np.ndarray, span: float, size: np.ndarray) -> float:
    """Return the change of the end when one of the points in the middle is omitted."""
    middle, end = len(nodes) // 2, np.ones(1)
    fewer = _integrals(np.delete(nodes, middle), end) @ np.delete(slopes, middle, axis=0)
    return float(np.max(np.abs(_integrals(nodes, end) @ slopes - fewer) * span / size))


def _largest_opening(sampler: Sampler, made: Collocation, nodes: np.ndarray) -> float:
    """Return the largest residual of a closure between the points, in fractions of the mechanism's size or as sines."""
    model = sampler.engine.model
    along = model.arrays.table(m.CLOSURE_ROWS, sampler.engine.h)["kind"] == 0
    scale, worst = np.where(along, model.length, 1.0), 0.0
    ends = np.concatenate([[0.0], nodes])
    times = made.start + made.span * 0.5 * (ends[1:] + ends[:-1])
    for t, y in zip(times, made.states(times), strict=True):
        sampler.attempt(float(t), y)
        worst = max(worst, float(np.max(np.abs(sampler.engine.view(m.RESIDUAL)) / scale, initial=0.0)))
    return worst


def is_blurred(engine: Engine, row: np.ndarray, clear: float = CLEAR) -> bool:
    """Return True when a row is so near a singular pose that its accelerations and forces are rounding."""
    one = recording.record(row[None], len(engine.model.contacts))
    seen = engine.attempt(one.state[0], float(one.time[0]))
    return not seen or float(engine.view(m.PIVOT)[m.LAST_PIVOT]) < clear


def observe_around(engine: Engine, row: np.ndarray, motion: Collocation, clear: float) -> Blocks | None:
    """Return the outputs of such a row as the limit from both sides, one row of each block; None without a limit.

    In the pose the closures' multipliers are not unique; on a smooth motion they are continuous across it. Their mean
    over both sides, at one, two and three distances, is accurate to the sixth power of the distance.  The polynomial
    gives the states there, also a little beyond its ends, under the laws that hold between them.
    clear: pivot ratio of the closures that the sides must have.
    """
    pieces = np.tile(engine.pieces[engine.segments(0.5 * (motion.start + motion.end), after=True)], (len(SIDES), 1))
    for k in range(DISTANCE_TRIES):
        rows = np.tile(row, (len(SIDES), 1))
        rows_around = recording.record(rows, len(engine.model.contacts))
        rows_around.time[:] += FIRST_DISTANCE * motion.span * WIDER**k * SIDES
        rows_around.state[:] = motion.states(rows_around.time)
        if not any(is_blurred(engine, side, clear) for side in rows):
            seen = observe_with(engine, rows, pieces, CLOSED)
            if not np.any(seen["status"]):
                return {name: WEIGHTS @ block for name, block in seen.items()}
    return None
