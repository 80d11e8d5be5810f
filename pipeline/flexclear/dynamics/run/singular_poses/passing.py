"""Passage over a singular pose: the polynomial motion, the poses on it, and refusals where the motion ends there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.singular_step import NEVER, TOO_LITTLE
from flexclear.dynamics.model import selection
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.refusals.reach import beyond_reach, describe_rest
from flexclear.dynamics.run.singular_poses.collocation import Collocation, Lead, Sampler, collocate
from flexclear.system.errors import SolverError

#: without a predicted pose the polynomial is first as long as the fastest coordinate takes for this fraction of its
#: unit, then half, and so on
FIRST_REACH, REACH_HALVINGS = 0.3, 10
#: samples of a polynomial in the search for its poses; singular values below this fraction of the largest are zero
SAMPLED_TIMES, VANISHED = 32, 1e-6
#: tolerance of a pose's time, and distance of the samples on both sides, as fractions of the polynomial
POSE_TOLERANCE, SIDE_DISTANCE = 1e-7, 1e-4
#: poses at times that differ by less than this fraction of the polynomial are the same
EQUAL_TIMES = 1e-6


@dataclass(frozen=True)
class Pass:
    """A singular pose of the motion. lost: ranks lost; joint: the one whose closure is dependent there."""

    time: float
    condition: float
    lost: int
    joint: str


def lay_over(engine: Engine) -> tuple[Collocation | None, tuple[Pass, ...]]:
    """Store a polynomial for the stepper, over the singular pose ahead or out of one; return it and its poses.

    Without a polynomial, the stepper's memory contains the distance to the pose for the next attempt, or 0 for normal
    steps.  Raises SolverError when the mechanism comes to rest in the pose.
    """
    control = engine.control
    t, y = float(control[m.TIME]), engine.view(m.Y).copy()
    foreseen = control[m.LEFT] >= TOO_LITTLE and t < control[m.PASS_TIME] < NEVER
    sampler, slope = Sampler(engine), None
    if foreseen:
        y, slope = _closed_state_and_slope(sampler, t, y)
    made, reach = _over(sampler, t, y, slope) if slope is not None else (_out(sampler, t, y), 0.0)
    passes = passes_of(sampler, made) if made is not None else ()
    sampler.restore()
    control[m.REACH] = control[m.MOST_REACH] = reach
    if made is None:
        # 0.02: without a polynomial, and with less than this fraction of a row's independence, the end of a loop's
        # reach is checked
        text = beyond_reach(engine) if control[m.LEFT] < 0.02 else ""
        if text:
            raise SolverError(text)
        return None, ()
    made.lay(engine)
    return made, passes


def _closed_state_and_slope(sampler: Sampler, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the closed state and its slope; the given state and None when the pose is too near for both."""
    closed, sound = sampler.closed(t, y)
    if not sound or not sampler.attempt(t, closed):
        return y, None
    return closed, sampler.slope()


def foresee_at_start(engine: Engine) -> bool:
    """Predict a pose close ahead of a state before the first step; return True and store it for the stepper if so.

    The prediction uses the rate at which the closure rows lose their independence.
    """
    control, model = engine.control, engine.model
    t, sampler = float(control[m.TIME]), Sampler(engine)
    here = sampler.sample(t, engine.view(m.Y).copy())
    fastest = float(np.max(np.abs(here.slope / model.state_scales)[: model.nq], initial=0.0))
    # 1e-4: backward step of the fastest coordinate, in its unit, for the rate of the rows' independence
    back = 1e-4 / fastest if fastest > 0.0 else np.inf
    before = sampler.sample(t - back, here.y - back * here.slope) if here.sound and fastest > 0.0 else here
    sampler.restore()
    fall = before.independence - here.independence
    falling = fall > 0.0
    ahead = back * float(np.min(here.independence[falling] / fall[falling], initial=np.inf))
    if not before.sound or not ahead * fastest < FIRST_REACH:
        return False
    control[[m.PASS_TIME, m.REACH, m.LEFT]] = t + ahead, FIRST_REACH / fastest, ahead * fastest
    return True


def _over(sampler: Sampler, t: float, y: np.ndarray, slope: np.ndarray) -> tuple[Collocation | None, float]:
    """Return a polynomial over the predicted pose, as far beyond it as the stepper's reach, and that reach.

    Else return None, and the distance before the pose for the next attempt: 0 when rounding leaves none.
    """
    control = sampler.engine.control
    ahead, reach, fraction = float(control[m.PASS_TIME]) - t, float(control[m.REACH]), float(control[m.LEFT])
    # 3e-4: least independence of a row, over its largest, with which a polynomial may begin: with other fast motions it
    # is short
    nearest = 3e-4 / fraction * ahead
    while reach >= max(ahead, nearest):
        made = collocate(
            sampler, t, y, _span_within_segment(sampler, t, ahead + reach), slope, fraction=fraction * reach / ahead
        )
        if made is not None:
            return made, reach
        reach *= 0.5
    return None, reach if reach >= nearest else 0.0


def _out(sampler: Sampler, t: float, y: np.ndarray) -> Collocation | None:
    """Return a polynomial out of a pose, or over one too near to be predicted, with a length by the motion's scale."""
    nq = sampler.engine.model.nq
    sampler.attempt(t, y)
    rate = np.append(sampler.slope()[:nq], np.zeros(len(y) - nq))
    fastest = float(np.max(np.abs(rate / sampler.engine.model.state_scales), initial=0.0))
    # 1e-6: admissible error of speeds in a pose at the end of a polynomial, as a fraction of the fastest
    lead = Lead(lambda at: y + (at - t) * rate, 1e-6)
    for k in range(REACH_HALVINGS if fastest > 0.0 else 0):
        made = collocate(sampler, t, y, _span_within_segment(sampler, t, FIRST_REACH / fastest * 0.5**k), lead)
        if made is not None:
            return made
    return None


def _span_within_segment(sampler: Sampler, t: float, span: float) -> float:
    """Return the span, or the rest of the segment."""
    left = float(sampler.engine.control[m.END]) - t
    # 1e-3: a polynomial that leaves less than this fraction of its length to the segment's end is extended to that end
    return left if (1.0 + 1e-3) * span >= left else span


# Poses on a polynomial ----------------------------------------------------------------------------------------------


def passes_of(sampler: Sampler, made: Collocation) -> tuple[Pass, ...]:
    """Return the singular poses on a polynomial. Raise SolverError when the mechanism comes to rest in one."""
    from scipy.optimize import minimize_scalar  # slow to import, and most runs pass nothing

    engine, times = sampler.engine, np.linspace(made.start, made.end, SAMPLED_TIMES + 1)

    def least(t: float) -> float:
        """Return the least singular value of all closures, whichever of them are selected."""
        sampler.attempt(t, made.states(np.array([t]))[0])
        J = closure_rows.natural(engine.model, engine.h, engine.jacobian)
        return float(np.linalg.svd(J, compute_uv=False)[engine.mobility.rank - 1])

    saved = engine.selected.copy()
    engine.keep(np.ones(len(saved), dtype=bool))
    low, times_of_passes = np.array([least(t) for t in times]), list[float]()
    bounded = np.concatenate([[np.inf], low, [np.inf]])
    for k in np.flatnonzero((low <= bounded[:-2]) & (low <= bounded[2:])):
        bracket = float(times[max(int(k) - 1, 0)]), float(times[min(int(k) + 1, SAMPLED_TIMES)])
        t = float(
            minimize_scalar(least, bounds=bracket, method="bounded", options={"xatol": POSE_TOLERANCE * made.span}).x
        )
        t = _interpolate_zero(least, float(min((t, *bracket), key=least)), SIDE_DISTANCE * made.span, bracket)
        if least(t) < VANISHED * np.max(low) and not (
            times_of_passes and t - times_of_passes[-1] < EQUAL_TIMES * made.span
        ):
            times_of_passes.append(t)
    engine.keep(saved)
    return tuple(_pass(sampler, made, t) for t in times_of_passes)


def _interpolate_zero(least: Callable[[float], float], t: float, aside: float, bracket: tuple[float, float]) -> float:
    """Return the time at which straight lines on both sides reach zero: the pose itself determines nothing."""
    before, after = least(t - aside), least(t + aside)
    fraction = before / (before + after) if before + after > 0.0 else 0.5
    return float(np.clip(t - aside + 2.0 * aside * fraction, *bracket))


def _pass(sampler: Sampler, made: Collocation, t: float) -> Pass:
    """Return the singular pose at a time. Raise SolverError when the mechanism comes to rest in it."""
    engine = sampler.engine
    sampler.attempt(t, made.states(np.array([t]))[0])
    J = engine.jacobian
    U, values, _ = np.linalg.svd(closure_rows.natural(engine.model, engine.h, J))
    lost = max(int(np.sum(values < VANISHED * values[0])), 1)
    reported = np.linalg.svd(closure_rows.scale_rows(engine.model, engine.h, J), compute_uv=False)
    one = Pass(t, closure_rows.condition(reported), lost, closure_rows.worst_joint(engine, U[:, -1]))
    _refuse_rest(engine, made, one, U[:, -lost:])
    return one


def _refuse_rest(engine: Engine, made: Collocation, one: Pass, left: np.ndarray) -> None:
    """Raise SolverError when the coordinates of the dependent closures do not move in the pose."""
    moving = selection.coordinates_of_rows(engine.model, engine.h, np.max(np.abs(left), axis=1) > 0.1)
    speeds = engine.model.speeds
    times = np.append(np.linspace(made.start, made.end, SAMPLED_TIMES + 1), one.time)
    rates = np.max(np.abs(made.states(times)[:, speeds] / engine.model.speed_scales)[:, moving], axis=1, initial=0.0)
    # 1e-5: a loop whose speeds in the pose are below this fraction of those next to it is at rest
    if rates[-1] <= 1e-5 * np.max(rates):
        raise SolverError(describe_rest(one.time, f"joint {one.joint}, condition number {one.condition:.3g}"))
