"""Over a singular pose: where a polynomial motion is laid, what passes on it, and what is said where it ends there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.singular_step import NEVER, TOO_LITTLE
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.refusals.reach import beyond_reach, rest
from flexclear.pipeline.dynamics.run.singular_poses.collocation import Collocation, Lead, Sampler, collocate

#: where no pose is foreseen the polynomial is first as long as the fastest coordinate takes for this fraction of its
#: unit, then half of that, and so on
FIRST_REACH, REACH_HALVINGS = 0.3, 10
#: fraction of its unit that the fastest coordinate goes back for the rate of the rows' independence
BACKWARD_STEP = 1e-4
#: least fraction of a row with which a polynomial may begin: where other motions are fast it must be short
LEAST_FRACTION = 3e-4
#: speeds in a pose that a polynomial led to may be off by this fraction of the fastest
TURNING_BACK = 1e-6
#: where no polynomial was found and a row has less than this fraction left, it is asked whether a loop's reach ends
OBVIOUS = 0.02
#: what is left of a segment after the polynomial, in fractions of its length, that belongs to it
REMAINDER = 1e-3
#: looks at a polynomial for the poses that it passes; singular values below this fraction of the largest vanish there
SAMPLED_TIMES, VANISHED = 32, 1e-6
#: fractions of the polynomial to which a pose is found, and at which it is examined from both sides
POSE_TOLERANCE, SIDE_DISTANCE = 1e-7, 1e-4
#: two looks that find a pose at times which differ by less than this fraction of the polynomial have found the same one
EQUAL_TIMES = 1e-6
#: a loop whose speeds in the pose are below this fraction of those next to it is at rest
LOOP_AT_REST = 1e-5


@dataclass(frozen=True)
class Pass:
    """A singular pose on the way. lost: ranks lost; joint: whose closure is dependent there."""

    time: float
    condition: float
    lost: int
    joint: str


def lay_over(engine: Engine) -> tuple[Collocation | None, tuple[Pass, ...]]:
    """Leave a polynomial ready for the stepper, over the singular pose ahead of it or out of one; and what it passes.

    Where there is none yet, the stepper's memory says how close to the pose it shall go before it asks again, or that
    it shall continue by itself.  SolverError when the mechanism comes to rest in the pose.
    """
    control = engine.control
    t, y = float(control[m.TIME]), engine.view(m.Y).copy()
    foreseen = control[m.LEFT] >= TOO_LITTLE and t < control[m.PASS_TIME] < NEVER
    sampler, slope = Sampler(engine), None
    if foreseen:
        y, slope = _closed(sampler, t, y)
    made, reach = _over(sampler, t, y, slope) if slope is not None else (_out(sampler, t, y), 0.0)
    passes = passes_of(sampler, made) if made is not None else ()
    sampler.restore()
    control[m.REACH] = control[m.MOST_REACH] = reach
    if made is None:
        text = beyond_reach(engine) if control[m.LEFT] < OBVIOUS else ""
        if text:
            raise SolverError(text)
        return None, ()
    made.lay(engine)
    return made, passes


def _closed(sampler: Sampler, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """The state closed, and its slope; as it is, and None, where the pose is too close for both."""
    closed, sound = sampler.closed(t, y)
    if not sound or not sampler.attempt(t, closed):
        return y, None
    return closed, sampler.slope()


def foresee_at_start(engine: Engine) -> bool:
    """Put a pose close ahead of the stepper's state into its memory, where no step has led to; whether it is so.

    From how fast the closure rows come to depend on each other there.
    """
    control, model = engine.control, engine.model
    t, sampler = float(control[m.TIME]), Sampler(engine)
    here = sampler.sample(t, engine.view(m.Y).copy())
    fastest = float(np.max(np.abs(here.slope / model.state_scales)[: model.nq], initial=0.0))
    back = BACKWARD_STEP / fastest if fastest > 0.0 else np.inf
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
    """A polynomial over the pose that is foreseen and as far beyond it as the stepper's reach.

    Else None, and from how far before the pose it may be tried again: 0 where rounding leaves nothing to try.
    """
    control = sampler.engine.control
    ahead, reach, fraction = float(control[m.PASS_TIME]) - t, float(control[m.REACH]), float(control[m.LEFT])
    nearest = LEAST_FRACTION / fraction * ahead
    while reach >= max(ahead, nearest):
        made = collocate(sampler, t, y, _within(sampler, t, ahead + reach), slope, fraction=fraction * reach / ahead)
        if made is not None:
            return made, reach
        reach *= 0.5
    return None, reach if reach >= nearest else 0.0


def _out(sampler: Sampler, t: float, y: np.ndarray) -> Collocation | None:
    """A polynomial out of a pose, or over one that is too close to be predicted, by the motion's own scale."""
    nq = sampler.engine.model.nq
    sampler.attempt(t, y)
    rate = np.append(sampler.slope()[:nq], np.zeros(len(y) - nq))
    fastest = float(np.max(np.abs(rate / sampler.engine.model.state_scales), initial=0.0))
    lead = Lead(lambda at: y + (at - t) * rate, TURNING_BACK)
    for k in range(REACH_HALVINGS if fastest > 0.0 else 0):
        made = collocate(sampler, t, y, _within(sampler, t, FIRST_REACH / fastest * 0.5**k), lead)
        if made is not None:
            return made
    return None


def _within(sampler: Sampler, t: float, span: float) -> float:
    """The span, or what is left of the segment."""
    left = float(sampler.engine.control[m.END]) - t
    return left if (1.0 + REMAINDER) * span >= left else span


# What passes --------------------------------------------------------------------------------------------------------


def passes_of(sampler: Sampler, made: Collocation) -> tuple[Pass, ...]:
    """The singular poses on a polynomial; SolverError where the mechanism comes to rest in one."""
    from scipy.optimize import minimize_scalar  # slow to import, and most runs pass nothing

    engine, times = sampler.engine, np.linspace(made.start, made.end, SAMPLED_TIMES + 1)

    def least(t: float) -> float:
        """The least singular value of all closures, whichever of them are solved for."""
        sampler.attempt(t, made.states(np.array([t]))[0])
        J = closure_rows.natural(engine.model, engine.h, engine.rows(m.JACOBIAN))
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
        t = _between(least, float(min((t, *bracket), key=least)), SIDE_DISTANCE * made.span, bracket)
        if least(t) < VANISHED * np.max(low) and not (
            times_of_passes and t - times_of_passes[-1] < EQUAL_TIMES * made.span
        ):
            times_of_passes.append(t)
    engine.keep(saved)
    return tuple(_pass(sampler, made, t) for t in times_of_passes)


def _between(least: Callable[[float], float], t: float, aside: float, bracket: tuple[float, float]) -> float:
    """Where straight lines on both sides meet at zero: in the pose itself nothing can be determined."""
    before, after = least(t - aside), least(t + aside)
    fraction = before / (before + after) if before + after > 0.0 else 0.5
    return float(np.clip(t - aside + 2.0 * aside * fraction, *bracket))


def _pass(sampler: Sampler, made: Collocation, t: float) -> Pass:
    """The singular pose at a time; SolverError where the mechanism comes to rest in it."""
    engine = sampler.engine
    sampler.attempt(t, made.states(np.array([t]))[0])
    J = engine.rows(m.JACOBIAN)
    U, values, _ = np.linalg.svd(closure_rows.natural(engine.model, engine.h, J))
    lost = max(int(np.sum(values < VANISHED * values[0])), 1)
    reported = np.linalg.svd(closure_rows.scaled(engine.model, engine.h, J), compute_uv=False)
    one = Pass(t, closure_rows.condition(reported), lost, closure_rows.worst_joint(engine, U[:, -1]))
    _refuse_rest(engine, made, one, U[:, -lost:])
    return one


def _refuse_rest(engine: Engine, made: Collocation, one: Pass, left: np.ndarray) -> None:
    """SolverError where the coordinates of the dependent closures do not move in the pose."""
    moving = selection.coordinates_of_rows(engine.model, engine.h, np.max(np.abs(left), axis=1) > 0.1)
    speeds = engine.model.speeds
    times = np.append(np.linspace(made.start, made.end, SAMPLED_TIMES + 1), one.time)
    rates = np.max(np.abs(made.states(times)[:, speeds] / engine.model.speed_scales)[:, moving], axis=1, initial=0.0)
    if rates[-1] <= LOOP_AT_REST * np.max(rates):
        raise SolverError(rest(one.time, f"joint {one.joint}, condition number {one.condition:.3g}"))
