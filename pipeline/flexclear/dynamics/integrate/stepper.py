"""Steps of an integration method from event to event, with projection and a record.

One call advances to the end of a segment between two drive breaks, or until its budget of evaluations is used, so that
the caller can report progress and be interrupted. `adaptive` or `fixed` choose the length of a step; the method makes
it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.prescribed_motion import next_knot
from flexclear.dynamics.equations.projection import keep_scales, largest
from flexclear.dynamics.fields import data
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.integrate.method import AWAITS, LOST, await_rates, make_at_once, make_attempt
from flexclear.dynamics.integrate.norms import finite
from flexclear.dynamics.integrate.stiffness import make_detect_stiffness
from flexclear.dynamics.kernels import kernel

#: returned by `resolve` for an event after which integration restarts; other positive numbers: the event is only
#: recorded
RESTART = 1
#: returned for a step of given length that cannot end on the event inside it; other negative numbers end the run
AGAIN = -2
#: steps in a row that end next to a singular pose before it counts as one that the motion does not leave
MOST_BLIND = 20.0
#: error norm of a step that could not be made
FAILED = 1e9
#: in place of an error norm: the attempt waits for rates from a batched evaluation
#: (`run.evaluation.batched_evaluation`)
PENDING = -1.0
#: stage of a complete attempt that waits for the rates at its end
ENDING = 1 << 30


@kernel
def plan(d, step, following):
    """Return the next step to attempt; a step that was cut short does not limit it."""
    # a step below this fraction of the planned one has been cut short
    least = d.step if step < 0.9 * d.step else 0.0
    d.step = max(following, least)


@kernel
def never(d):
    """Return False: without contacts none is closed."""
    return False


@kernel
def watch_nothing(d):
    """Do nothing: the scene has neither contacts nor guards."""


def make_end_nowhere(evaluate_at: Callable, extend: Callable, repeat: Callable) -> Callable:
    """Build the kernel end_on_guard of scenes without guards (see `guards.make_end_on_guard`)."""

    @kernel
    def end_on_guard(d, step, before, ready):
        return 0.0

    return end_on_guard


@kernel
def resolve_nothing(d, step, t_new, rows, events):
    """Return no event: `resolve` of a stepper without events."""
    return 0, False, t_new, step


#: `guards.AMONG_CONTACTS` of scenes without guards
NO_GUARDS = (watch_nothing, watch_nothing, watch_nothing, make_end_nowhere)
#: `events` of scenes without contacts and guards
NO_CONTACTS = (watch_nothing, None, never)


class Stepping(NamedTuple):
    """The kernels of a method (`method.Method`), with steps over singular poses where there are loops.

    begin, proceed, error, keep: of the method.  attempt, extend: extended to the polynomial.  dense: the method with
    the extended interpolation.
    """

    begin: Callable
    proceed: Callable
    error: Callable
    keep: Callable
    attempt: Callable
    extend: Callable
    dense: Any


def make_stepping(evaluate: Callable, lists: Any, method: Any, poses: Any = None) -> Stepping:
    """Build the kernels of steps, which event resolution also uses; arguments as of `make_advance`."""
    begin, step, error, extend, keep = method.make_kernels(evaluate, lists)
    proceed = step if method.staged else make_at_once(step)
    attempt = make_attempt(evaluate, proceed) if method.staged else step
    if poses is None:
        return Stepping(begin, proceed, error, keep, attempt, extend, method)
    along, extend, interpolate = poses.make_along(method, attempt, extend)
    return Stepping(begin, proceed, error, keep, along, extend, replace(method, interpolate=interpolate))


def make_resolution(
    evaluate: Callable,
    project: Callable,
    lists: Any,
    method: Any,
    events: tuple[Callable, Callable, Callable],
    poses: Any = None,
) -> Callable:
    """Build the kernel resolution(d, step, t_new, rows, events) -> event?, which stores the other results of `resolve`.

    It is compiled concurrently with the steps, and takes as long. Arguments as of `make_advance`.
    """
    stepping = make_stepping(evaluate, lists, method, poses)
    _, make_resolve_events, _ = events
    resolve_events = make_resolve_events(evaluate, stepping.attempt, stepping.extend, project, stepping.dense)

    @kernel
    def resolution(d, step, t_new, rows, events):
        happened, ready, d.resolved_end, d.resolved_step = resolve_events(d, step, t_new, rows, events)
        d.extended = 1 if ready else 0
        return happened

    return resolution


def make_advance(
    evaluate: Callable,
    project: Callable,
    lists: Any,
    method: Any,
    stepping: Any,
    events: tuple[Callable, Callable | None, Callable] = NO_CONTACTS,
    resolve: Callable = resolve_nothing,
    poses: Any = None,
) -> Callable:
    """Build the kernel advance(h, f, w, n, outputs, rows, events).

    Its parts take `d`, the arrays with named fields (`fields`), instead of h, f, w and n.

    stepping: the module `adaptive` or `fixed`.  poses: `singular_step` for
    mechanisms with loops; trees do not compile it. events: watch_start, make_resolve_events and any_closed of
    `contact_events` or `step_end_events`. resolve: (d, step, t_new, rows, events) -> (event?, dense output ready?, end,
    step), for an accepted step
        (`make_resolution`).
    """
    made = make_stepping(evaluate, lists, method, poses)
    begin, proceed, error, keep, loops = made.begin, made.proceed, made.error, made.keep, poses is not None
    foresee: Any = None
    arrive: Any = None
    if loops:
        foresee, arrive = poses.make_foresee(evaluate), poses.make_arrive(evaluate, project, made.attempt, method)
    last, ends = method.last, method.ends
    watch_start, _, any_closed = events
    record_outputs = recording.make_record_outputs(made.extend, made.dense.interpolate, method.room.oscillations > 0)
    detect_stiffness = make_detect_stiffness(method)
    first_step, error_norm, after_rejection, next_step = stepping.make_step_control(evaluate, any_closed, error, method)

    @kernel
    def must_stop(d, outputs, rows, events):
        """Return True when the stepper must return to its caller; the reason is in `status`."""
        waiting = outputs.shape[0] - d.next_output
        room = m.ROOM + m.EVENTS_OF_A_CONTACT * d.n_contacts
        if d.time >= d.end:
            d.status = m.SEGMENT_END
        elif d.evaluations >= d.cap:
            d.status = m.CAP_REACHED
        elif d.evaluations >= d.budget:
            d.status = m.PAUSED
        elif d.blind_steps > MOST_BLIND:
            d.status = m.AT_SINGULAR
        elif d.last_pivot < d.least_pivot:
            d.status = m.WORN_ROWS
        elif d.n_recorded + waiting + room + recording.BETWEEN > rows.shape[0] or d.n_events + room > events.shape[0]:
            d.status = m.FULL
        else:
            return False
        return True

    @kernel
    def open_loops(d, outputs, t_new):
        """Return the tolerance of the loops' residuals at the end of a step that reaches t_new.

        Drift grows from step to step. When a step contains several outputs, closing its end as tightly as outputs are
        closed when they are observed costs less than closing each of them.
        """
        second = d.next_output + 1
        several = second < outputs.shape[0] and outputs[second] <= t_new
        return (recording.share_of_records(d.rtol) if several else 1.0) * d.rtol * d.length

    @kernel
    def finish(d, t_new, tolerance):
        """Close the loops of the evaluated state Y_NEW to a tolerance; return False when that fails."""
        slope = d.at_slopes + d.ny * last
        if d.evaluation != m.OK:
            return False
        if not (finite(d, slope) and finite(d, d.at_y_new)):
            d.evaluation = m.NOT_FINITE
            return False
        d.drift = max(d.drift, largest(d.residual, d.n_closure_rows))
        d.rate_drift = max(d.rate_drift, largest(d.residual_rate, d.n_closure_rows))
        used = project(d.h, d.f, d.w, d.n, t_new, d.at_y_new, slope, tolerance)
        if loops:
            poses.note(d)
        if used > 0:
            d.evaluations += used
            d.projection_evaluations += used
            d.projections += 1
        return used >= 0

    @kernel
    def carry_on(d, step, t_new, outputs):
        """Continue the step to Y_NEW up to the next evaluation; return PENDING, or the result of `try_step`."""
        if d.stage < ENDING:
            come = proceed(d, step)
            if come == AWAITS:
                return PENDING
            if come == LOST:
                return FAILED
            norm = error_norm(d, step)
            if norm != norm:
                d.evaluation = m.NOT_FINITE
                return FAILED
            if norm > 1.0:
                return min(norm, FAILED)
            d.norm = norm
            if not ends:
                await_rates(d, t_new, d.at_y_new, d.at_slopes + d.ny * last)
                d.stage = ENDING
                return PENDING
        if not finish(d, t_new, open_loops(d, outputs, t_new)):
            return FAILED
        detect_stiffness(d, step)
        return d.norm

    @kernel
    def try_step(d, step, t_new, outputs):
        """Return the error norm of the step to Y_NEW, 1 at the tolerance; FAILED when the step fails, or PENDING."""
        if loops and poses.ready(d):
            arrive(d, step, t_new)
            return 0.0
        norm = carry_on(d, step, t_new, outputs)
        if norm != PENDING:
            d.stage = 0
        return norm

    @kernel
    def accept(d, t_new):
        """Make the end of the step the start of the next."""
        slope = d.at_slopes
        final = slope + d.ny * last
        for k in range(d.ny):
            d.y[k] = d.y_new[k]
            d.w[slope + k] = d.w[final + k]
        d.time = t_new
        keep_scales(d)

    @kernel
    def start(d):
        """Initialise a segment, or the motion after an event; return False when the equations have no solution."""
        evaluate(d, d.time, d.at_y, d.at_slopes)
        d.evaluations += 1
        along = loops and poses.ready(d)
        if along:  # where the polynomial begins nothing need be solvable
            d.evaluation = m.OK
        elif d.evaluation != m.OK or not finite(d, d.at_slopes):
            d.status = m.NOT_A_NUMBER if d.evaluation == m.OK else m.NO_START
            return False
        watch_start(d)
        d.fresh = 0
        if not along:
            d.step = first_step(d)
            begin(d)
            if loops:
                poses.note(d)
                poses.keep_independence(d, d.time)
        return True

    @kernel
    def choose_step(d, t):
        """Return the length of the step to attempt from t; 0, with the reason in `status`, when no step is possible."""
        step = d.step
        if loops:
            step = d.collocated if poses.ready(d) else poses.steer(d, t)
        if step == 0.0:
            d.status = m.SINGULAR_AHEAD
            return 0.0
        d.knot = d.end if loops and poses.ready(d) else next_knot(d, t)
        if t + 1.0001 * step >= d.knot:
            step = d.knot - t
        # a step below this fraction of the time reached cannot be distinguished from rounding
        if step > 4e-16 * max(abs(t), d.span):
            return step
        if d.evaluation == m.NOT_FINITE:
            d.status = m.NOT_A_NUMBER
        else:
            d.status = m.LOST_CLOSURE if d.evaluation != m.OK else m.STEP_TOO_SMALL
        return 0.0

    @kernel
    def advance(h, f, w, n, outputs, rows, events):
        """Step to the end of the segment or of the budget; the reason of the return is in `status`.

        Return True when an attempt waits for rates (`method.await_rates`): the caller computes them and calls again.
        """
        d = data(h, f, w, n)
        while d.stage > 0 or not must_stop(d, outputs, rows, events):
            t = d.time
            if d.stage == 0:
                if d.fresh and not start(d):
                    return False
                d.tried = choose_step(d, t)
            step = d.tried
            if step == 0.0:
                return False
            final = t + 1.0001 * step >= d.knot
            t_new = d.knot if final else t + step
            norm = try_step(d, step, t_new, outputs)
            if norm == PENDING:
                return True
            if norm > 1.0:
                d.rejected += 1
                if not after_rejection(d, step, norm):
                    return False
                continue
            along = loops and poses.ready(d)
            following = d.step if along else next_step(d, step, norm)
            recording.hold_modes(d)
            happened, known, t_end, step = resolve(d, step, t_new, rows, events)
            if happened == AGAIN and d.fixed == 0.0 and not along:  # a polynomial would be the same again
                d.rejected += 1
                # such a step is tried again with this fraction of its length
                d.step, d.rejected_step = 0.3 * step, 0.0
                continue
            if happened < 0:
                return False
            d.steps += 1
            if along:
                recording.snapshot(d, rows, t, d.at_y)
            record_outputs(d, step, known, outputs, rows, t_end)
            keep(d, step)
            accept(d, t_end)
            recording.keep_largest(d, rows, t_end, d.at_y)
            plan(d, step, following)
            if d.fixed > 0.0 and t_end == d.knot:  # without error control, slopes from before it would go unnoticed
                begin(d)
            if loops:
                if along:
                    poses.done(d, t_end)
                elif t_end == t_new:  # how independent the rows are has been noted at the end that was tried
                    foresee(d, t_end)
            if happened > 0 or along:
                recording.hold_modes(d)
                recording.snapshot(d, rows, t_end, d.at_y)
                d.fresh = 1 if along or happened == RESTART else 0
        return False

    return advance
