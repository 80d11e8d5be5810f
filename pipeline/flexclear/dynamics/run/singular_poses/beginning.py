"""Start in a singular pose: motion out of it along one of the branches that cross there.

Given velocities select the branch; if they and the drives leave a choice, `[start] branch` of the scene decides. Each
branch has a motion out of the pose, a polynomial with closed states (`collocation`). For velocities that belong to no
branch there is no such polynomial, however short.

A branch leaves the pose in a direction in which the closures hold to second order. The dependent rows have no first
order part in the free directions; their second order part is a quadratic form each. The common zeros of the forms are
the tangents of the branches. The forms come from residuals of states at a small distance, at the time when the drives
have moved as far.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import initial
from flexclear.dynamics.model.driving import coordinate_of
from flexclear.dynamics.run.coordinates import joint_coordinates, label
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.run.evaluation.start import start_motions
from flexclear.dynamics.run.refusals.reach import restore_work_array
from flexclear.dynamics.run.singular_poses.collocation import Collocation, Lead, Sampler, collocate
from flexclear.scene.start import Branch
from flexclear.system.errors import InputError, SolverError

#: the polynomial is first as long as the fastest coordinate takes for this fraction of its unit, then half, and so on
FIRST_WAY, WAY_HALVINGS = 0.3, 9
#: distance of the displaced states, in units of the coordinates; singular values below this fraction of the largest are
#: zero
WAY, ZERO_SINGULAR = 1e-2, 1e-6
#: most directions among which branches are computed, starts of the iteration for each, its steps, and its tolerance
MOST_DIRECTIONS, SEARCH_STARTS, SEARCH_STEPS, EQUAL_DIRECTIONS = 6, 60, 40, 1e-3


def start_motion(engine: Engine, y: np.ndarray) -> Collocation:
    """Return the motion out of the start y, which has all loops closed; its closure rows remain selected.

    Raise SolverError when the velocities do not belong to a smooth motion, or the branch is not determined.
    """
    choices = engine.model.scene.start.branch if engine.model.scene.start is not None else ()
    if np.any(y[engine.model.speeds] != 0.0) and not choices:
        # 1e-6: given velocities may differ from those of a branch by this fraction: they have few digits
        motions, turn = [by_speeds(engine, y)], 1e-6
    else:
        # 0.5: computed directions have an error of some hundredths
        motions, turn = _matching_directions(engine, directions(engine, y), choices), 0.5
    way = _along(engine, motions[0], turn) if motions else None
    if way is None:
        raise SolverError(engine.mobility.start_refusal)
    engine.keep(engine.selected)  # the scales of rows are those of another state
    return way


def _along(engine: Engine, way: Direction, turn: float) -> Collocation | None:
    """Return the motion in a direction; None when there is none whose start differs by at most `turn`."""
    if way.size == 0.0:
        return None
    engine.control[m.END] = engine.breaks[1]
    for k in range(WAY_HALVINGS):
        span = way.reaching(FIRST_WAY * 0.5**k)
        closure_rows.select_rows(engine, way.state(engine.start + span), engine.start + span)
        sampler = Sampler(engine)
        lead = Lead(way.state, turn if way.speeds is None else 0.0)
        made = collocate(sampler, engine.start, way.start, span, lead)
        sampler.restore()
        if made is not None:
            return made
    return None


# Choice of the branch ------------------------------------------------------------------------------------------------


def _matching_directions(engine: Engine, ways: list[Direction], choices: tuple[Branch, ...]) -> list[Direction]:
    """Return the directions that satisfy the choices. Raise an error when there are several."""
    if len(ways) > 1:
        until = engine.start + min(way.reaching(WAY) for way in ways)
        changes = [_changes(engine, way, until) for way in ways]
        for number, choice in enumerate(choices):
            path = "[start.branch]" if len(choices) == 1 else f"[start.branch.{number}]"
            scene = engine.model.scene
            joint, k, _ = coordinate_of(scene, choice.joint, choice.coordinate, path)
            requested = [choice.sign * change[label(joint, scene.joint[joint].type, k)] for change in changes]
            # 0.05: changes of a coordinate on two branches, known to some hundredths, are equal when they differ by
            # less than this fraction
            best_ways = [max(requested) - value <= 0.05 * max(map(abs, requested)) for value in requested]
            ways = [way for way, best in zip(ways, best_ways, strict=True) if best]
            changes = [change for change, best in zip(changes, best_ways, strict=True) if best]
        if len(ways) > 1:
            _refuse_open(engine, changes, choices)
    return ways


def _changes(engine: Engine, way: Direction, until: float) -> dict[str, float]:
    """Return the approximate change of every joint coordinate up to a time."""
    times = np.array([engine.start, until])
    seen = observe(engine, rows_of(engine, np.array([way.state(t) for t in times]), times))
    return {name: float(np.diff(series[0])[0]) for name, series in joint_coordinates(engine.model, seen).items()}


def _refuse_open(engine: Engine, changes: list[dict[str, float]], choices: tuple[Branch, ...]) -> None:
    """Raise an error that names the joint that distinguishes the branches best, and its changes on each."""
    spread = {name: float(np.ptp([change[name] for change in changes])) for name in changes[0]}
    size = {name: max(abs(change[name]) for change in changes) for name in changes[0]}
    best = max(spread, key=lambda name: spread[name] / size[name] if size[name] > 0.0 else 0.0)
    text = ", ".join(f"{change[best] / size[best]:+.2g}" for change in changes)
    joint, _, coordinate = best.partition(".")
    written = f'joint = "{joint}", ' + (f'coordinate = "{coordinate}", ' if coordinate else "") + "sign = 1"
    ways = f"{len(changes)} ways, on which joint {best} starts to move by {text}"
    if choices:
        raise InputError(
            "[start.branch]", f"leaves {ways}", f"choose by {{ {written} }} or sign = -1, as a further entry of a list"
        )
    raise SolverError(
        f"{engine.mobility.singular_start}, here in {ways}: choose by [start] branch = {{ {written} }} or sign = -1, "
        "or give the bodies velocities"
    )


# Directions ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Direction:
    """A direction out of the pose. begin, end: times of the start and of the next break of the laws [s].

    start: the state at the start.  way: change of the state after a unit of progress; size: largest change of a
    coordinate, in its unit.  speeds: change of the state at a unit rate of progress; None when the motion begins at
    speed, not from rest.  progress: of the motion by time [s].
    """

    begin: float
    end: float
    start: np.ndarray
    way: np.ndarray
    size: float
    speeds: np.ndarray | None
    progress: Callable[[float], float]

    def reaching(self, size: float) -> float:
        """Return the time [s] until the fastest coordinate has moved `size` units, or to the next break."""
        from scipy.optimize import brentq  # slow to import, and few runs begin in a singular pose

        def beyond(span: float) -> float:
            return self.progress(self.begin + span) * self.size - size

        longest = self.end - self.begin
        return longest if beyond(longest) <= 0.0 else float(brentq(beyond, 0.0, longest, xtol=1e-15 * longest))

    def state(self, t: float) -> np.ndarray:
        """Return the approximate state at a time."""
        progress = self.progress(t)
        if self.speeds is None or t == self.begin:
            return np.asarray(self.start + progress * self.way)
        # 1e-4: fraction of the time since the start for finite differences of rates
        back = 1e-4 * (t - self.begin)
        rate = (progress - self.progress(t - back)) / back
        return np.asarray(self.start + progress * self.way + rate * self.speeds)


def by_speeds(engine: Engine, y: np.ndarray) -> Direction:
    """Return the direction of the state's own speeds."""
    nq = engine.model.nq
    engine.attempt(y, engine.start)
    rate = engine.slope.copy()
    rate[nq:] = 0.0
    return _steady(engine, y, rate)


def _steady(engine: Engine, y: np.ndarray, rate: np.ndarray) -> Direction:
    nq, begin, end = engine.model.nq, engine.start, float(engine.breaks[1])
    fastest = float(np.max(np.abs(rate[:nq]) / engine.model.state_scales[:nq], initial=0.0))
    return Direction(begin, end, y, rate, fastest, None, lambda t: t - begin)


def directions(engine: Engine, y: np.ndarray) -> list[Direction]:
    """Return all directions that drives and given velocities allow from the state at the start; few or none."""
    with restore_work_array(engine):
        return _Pose(engine, y).directions()


class _Pose:
    """First and second order data of the closures in the pose."""

    def __init__(self, engine: Engine, y: np.ndarray) -> None:
        self.engine, self.nv, self.units = engine, engine.model.nv, engine.model.speed_scales
        self.rest = y.copy()
        self.rest[engine.model.speeds] = 0.0
        engine.keep(np.ones(len(engine.selected), dtype=bool))
        self.asked = initial.velocity_equations(engine.model, start_motions(engine), self.rest)
        self.J = self.asked.matrix[self.asked.n_given :]
        U, values, _ = np.linalg.svd(self.J)
        rank = int(np.sum(values > ZERO_SINGULAR * values[0])) if len(values) else 0
        self.left = U[:, rank:]
        self.rates = np.array([self._rate(k) for k in range(self.nv)]).reshape(self.nv, engine.model.nq)

    def _rate(self, k: int) -> np.ndarray:
        """Return the rates of the positions at a unit of speed k."""
        speeds = np.zeros(self.nv)
        speeds[k] = 1.0
        self.engine.attempt(self._with(speeds), self.engine.start)
        return self.engine.slope[: self.engine.model.nq].copy()

    def moved(self, step: np.ndarray) -> np.ndarray:
        """Return the state displaced from the pose by coordinates, in their units."""
        y = self.rest.copy()
        y[: self.engine.model.nq] += step @ self.rates
        return y

    def residual(self, step: np.ndarray, t: float) -> np.ndarray:
        """Return the residuals of all closures after a displacement, at a time; lengths over the mechanism's size."""
        model = self.engine.model
        self.engine.attempt(self.moved(step), t)
        along = model.arrays.table(m.CLOSURE_ROWS, self.engine.h)["kind"] == 0
        return np.asarray(self.engine.view(m.RESIDUAL) * np.where(along, 1.0 / model.length, 1.0))

    def directions(self) -> list[Direction]:
        """Return the directions: of given speeds, of drives that start from rest, or of forces from rest."""
        rows, target = self.asked.matrix, self.asked.target
        speeds, *_ = np.linalg.lstsq(rows, target, rcond=ZERO_SINGULAR)
        fastest = float(np.max(np.abs(speeds), initial=0.0))
        if fastest > ZERO_SINGULAR * float(np.max(np.abs(target), initial=0.0)) > 0.0:
            span = WAY / fastest
            steps = self._tangents(span * speeds, _null(rows), self.engine.start + span)
            return [_steady(self.engine, self._with(step / span), self._slope(step / span)) for step in steps]
        until = self._drives_go()
        if until is None:
            return [d for step in self._tangents(np.zeros(self.nv), _null(self.J), None) for d in self._fall(step)]
        t = self.engine.start + until
        went = self.residual(np.zeros(self.nv), t)
        base, *_ = np.linalg.lstsq(self.J, -went, rcond=ZERO_SINGULAR)
        return [self._driven(step, float(np.linalg.norm(went))) for step in self._tangents(base, _null(self.J), t)]

    def _with(self, speeds: np.ndarray) -> np.ndarray:
        """Return the pose with speeds, in units of the coordinates."""
        y = self.rest.copy()
        y[self.engine.model.speeds] = speeds * self.units
        return y

    def _slope(self, step: np.ndarray) -> np.ndarray:
        """Return the change of the state by a displacement."""
        return self.moved(step) - self.rest

    def _drives_go(self) -> float | None:
        """Return the time until the drives have opened the loops by about WAY; None when they do not move them."""
        begin, end = self.engine.start, float(self.engine.breaks[1])

        def opened(span: float) -> float:
            return float(np.linalg.norm(self.residual(np.zeros(self.nv), begin + span)))

        span = end - begin
        if opened(span) < ZERO_SINGULAR and opened(0.5 * span) < ZERO_SINGULAR:
            return None
        # 60: halvings of the time in which the drives move that distance
        for _ in range(60):
            if opened(span) <= WAY:
                break
            span *= 0.5
        return span

    def _driven(self, step: np.ndarray, went: float) -> Direction:
        """Return a direction from rest whose progress is the opening of the loops by the drives."""
        return self._from_rest(step, lambda t: float(np.linalg.norm(self.residual(np.zeros(self.nv), t))) / went)

    def _from_rest(self, step: np.ndarray, progress: Callable[[float], float]) -> Direction:
        size, speeds = float(np.max(np.abs(step))), self._with(step) - self.rest
        begin, end = self.engine.start, float(self.engine.breaks[1])
        return Direction(begin, end, self.rest, self._slope(step), size, speeds, progress)

    def _fall(self, step: np.ndarray) -> list[Direction]:
        """Return the direction from rest under the forces, if they push this way along the branch."""
        t, y = self.engine.start, self.moved(step)
        closure_rows.select_rows(self.engine, y, t)
        if not self.engine.attempt(y, t):
            return []
        push = self.engine.slope[self.engine.model.speeds] / self.units @ step / (step @ step)
        if not push * (self.engine.end - t) ** 2 > WAY:
            return []
        return [self._from_rest(step, lambda at: 0.5 * push * (at - t) ** 2)]

    def _tangents(self, base: np.ndarray, free: np.ndarray, t: float | None) -> list[np.ndarray]:
        """Return displacements of about WAY with closures that hold to second order; from rest in both senses."""
        homogeneous, at = t is None, self.engine.start if t is None else t

        def open_by(alpha: np.ndarray) -> np.ndarray:
            return self.left.T @ self.residual(base + WAY * alpha @ free, at)

        forms = _quadratic(open_by, len(free))
        heard = _heard(forms, free)
        if not len(heard) or len(heard) > MOST_DIRECTIONS:
            return []
        forms = _quadratic(lambda beta: open_by(beta @ heard), len(heard))
        roots = _roots(forms, homogeneous)
        return [base + WAY * root @ heard @ free for root in roots]


def _null(rows: np.ndarray) -> np.ndarray:
    """Return the null space of rows: orthonormal directions, shape (k, nv)."""
    _, values, Vt = np.linalg.svd(rows)
    rank = int(np.sum(values > ZERO_SINGULAR * values[0])) if len(values) and values[0] > 0.0 else 0
    return np.asarray(Vt[rank:])


@dataclass(frozen=True)
class _Forms:
    """Quadratic functions c + B a + a A a of k variables: (l,), (l, k), (l, k, k)."""

    c: np.ndarray
    B: np.ndarray
    A: np.ndarray

    def value(self, a: np.ndarray) -> np.ndarray:
        return np.asarray(self.c + self.B @ a + np.einsum("lij,i,j->l", self.A, a, a))

    def gradient(self, a: np.ndarray) -> np.ndarray:
        return np.asarray(self.B + 2.0 * np.einsum("lij,j->li", self.A, a))


def _quadratic(function: Callable[[np.ndarray], np.ndarray], k: int) -> _Forms:
    """Fit a quadratic function to the function's values at unit steps."""
    e, c = np.eye(k), function(np.zeros(k))
    plus, minus = [function(e[i]) for i in range(k)], [function(-e[i]) for i in range(k)]
    B = 0.5 * np.array([p - q for p, q in zip(plus, minus, strict=True)]).reshape(k, len(c)).T
    A = np.zeros((len(c), k, k))
    for i in range(k):
        A[:, i, i] = 0.5 * (plus[i] + minus[i]) - c
        for j in range(i):
            A[:, i, j] = A[:, j, i] = 0.5 * (function(e[i] + e[j]) - plus[i] - plus[j] + c)
    return _Forms(c, B, A)


def _heard(forms: _Forms, free: np.ndarray) -> np.ndarray:
    """Return the combinations of free directions on which the forms depend, (k', k)."""
    rows = np.concatenate([forms.A.reshape(-1, len(free)), forms.B]) if len(free) else np.zeros((0, 0))
    if not rows.size or not np.any(rows):
        return np.zeros((0, len(free)))
    _, values, Vt = np.linalg.svd(rows)
    # 1e-3: free directions whose second order part is below this fraction belong to no branch
    return np.asarray(Vt[: int(np.sum(values > 1e-3 * values[0]))])


def _roots(forms: _Forms, homogeneous: bool) -> list[np.ndarray]:
    """Return zeros of the forms, of homogeneous ones with unit length, by Gauss-Newton from starts of a fixed seed."""
    k, roots = forms.B.shape[1], list[np.ndarray]()
    size = max(float(np.max(np.abs(forms.A), initial=0.0)), float(np.max(np.abs(forms.B), initial=0.0)))
    for start in np.random.default_rng(0).normal(size=(SEARCH_STARTS * k, k)):
        a = start / (np.linalg.norm(start) if homogeneous else 1.0)
        for _ in range(SEARCH_STEPS):
            value, gradient = forms.value(a), forms.gradient(a)
            if homogeneous:
                value, gradient = np.append(value, size * (a @ a - 1.0)), np.vstack([gradient, 2.0 * size * a])
            step, *_ = np.linalg.lstsq(gradient, -value, rcond=1e-10)
            a = a + step
        left = np.linalg.norm(np.append(forms.value(a), size * (a @ a - 1.0) if homogeneous else 0.0))
        if left <= EQUAL_DIRECTIONS * size and not any(
            np.linalg.norm(a - b) <= EQUAL_DIRECTIONS * (1.0 + np.linalg.norm(b)) for b in roots
        ):
            roots.append(a)
    return roots
