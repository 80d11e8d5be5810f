"""Steps of an integration method from event to event, with projection and a record.

One call advances to the end of a segment between two drive breaks, or until its budget of
evaluations is used, so that the caller can report progress and be interrupted. How long a step is
`adaptive` or `fixed` says; what a step is, the method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.projection import keep_scales, largest
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.integrate.norms import finite
from flexclear.pipeline.dynamics.integrate.poses import NO_POSES, Poses
from flexclear.pipeline.dynamics.integrate.recording import (
    hold_modes,
    holds_outputs,
    make_record_outputs,
    share_of_records,
    snapshot,
)
from flexclear.pipeline.dynamics.integrate.stiffness import make_detect_stiffness
from flexclear.pipeline.dynamics.kernels import kernel

#: what resolve_events returns for an event after which integration starts afresh; another positive number only
#: records it
RESTART = 1
#: for a step of chosen length that cannot be made with its end on the event found in it; other negative numbers end the
#: run
AGAIN = -2
#: share of the planned step below which a step has been cut short
CUT = 0.9
#: such a step is tried again with this share of its length
SHORTER = 0.3
#: steps in a row that end next to a singular pose before it counts as one that the motion does not leave
MOST_BLIND = 20.0
#: error norm of a step that could not be made
FAILED = 1e9
#: a step below this share of the time reached cannot be told from rounding
SMALLEST_STEP = 4e-16


@kernel
def plan(h, w, step, following):
    """The step to try next; one that was cut short says little about how long it may be."""
    planned = h[m.CONTROL] + m.STEP
    least = w[planned] if step < CUT * w[planned] else 0.0
    w[planned] = max(following, least)


@kernel
def watch_nothing(h, w):
    """Nothing is noted, of contacts or of friction."""


@kernel
def none_closed(h, n):
    """No contact to be closed."""
    return False


def make_no_events(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
    """The kernel resolve_events of a stepper that looks for none."""

    @kernel
    def resolve_events(h, f, w, n, step, t_new, rows, events):
        return 0, False, t_new, step

    return resolve_events


#: `events` of scenes without contacts
NO_CONTACTS = (watch_nothing, make_no_events, none_closed)


def make_advance(
    evaluate: Callable,
    project: Callable,
    retract: Callable,
    method: Any,
    stepping: Any,
    events: tuple[Callable, Callable, Callable] = NO_CONTACTS,
    poses: Poses = NO_POSES,
    complete: Callable | None = None,
) -> Callable:
    """The kernel advance(h, f, w, n, outputs, rows, events).

    complete: evaluates like `evaluate`, and leaves all of the evaluation; given to methods that read more than rates.
    stepping: the module `adaptive` or `fixed`.
    events: watch_start, make_resolve_events and any_closed of `contact_events` or `step_end_events`.
    """
    given = (evaluate, retract, complete) if method.traits.reads_all else (evaluate, retract)
    begin, attempt_itself, error, extend_itself, keep = method.make_kernels(*given)
    attempt, extend, interpolate = poses.make_along(method, attempt_itself, extend_itself)
    last, ends = method.last, method.ends
    watch_start, make_resolve_events, any_closed = events
    dense = replace(method, interpolate=interpolate)
    resolve_events = make_resolve_events(evaluate, attempt, extend, project, dense)
    record_outputs = make_record_outputs(extend, interpolate)
    detect_stiffness = make_detect_stiffness(method)
    first_step, error_norm, after_rejection, next_step = stepping.make_step_control(
        evaluate, (watch_start, any_closed), begin, error, method
    )
    note, stand, steer, ready, done = poses.note, poses.stand, poses.steer, poses.ready, poses.done
    foresee, arrive = poses.make_foresee(evaluate), poses.make_arrive(evaluate, project, attempt, method)

    @kernel
    def must_stop(h, w, n, outputs, rows, events):
        """Whether to return now, with the reason in n[STATUS]."""
        c, waiting = h[m.CONTROL], outputs.shape[0] - n[m.NEXT_OUTPUT]
        room = m.ROOM + m.EVENTS_OF_A_CONTACT * h[m.N_CONTACTS]
        if w[c + m.TIME] >= w[c + m.END]:
            n[m.STATUS] = m.SEGMENT_END
        elif n[m.EVALUATIONS] >= n[m.CAP]:
            n[m.STATUS] = m.CAP_REACHED
        elif n[m.EVALUATIONS] >= n[m.BUDGET]:
            n[m.STATUS] = m.PAUSED
        elif w[c + m.BLIND_STEPS] > MOST_BLIND:
            n[m.STATUS] = m.AT_SINGULAR
        elif w[h[m.PIVOT] + m.LAST_PIVOT] < w[h[m.PIVOT] + m.WANTED_PIVOT]:
            n[m.STATUS] = m.WORN_ROWS
        elif n[m.N_RECORDED] + waiting + room > rows.shape[0] or n[m.N_EVENTS] + room > events.shape[0]:
            n[m.STATUS] = m.FULL
        else:
            return False
        return True

    @kernel
    def open_loops(h, w, n, outputs, t_new):
        """How far the loops may be open at the end of a step that reaches t_new.

        Drift grows from step to step. Where a step holds several outputs, closing its end as tightly as they are closed
        when they are observed costs less than closing each of them.
        """
        c = h[m.CONTROL]
        share = share_of_records(w[c + m.RTOL]) if holds_outputs(n, outputs, t_new) else 1.0
        return share * w[c + m.RTOL] * w[c + m.LENGTH]

    @kernel
    def finish(h, f, w, n, t_new, tolerance):
        """Slope at Y_NEW with the loops closed to a tolerance; False when they cannot be."""
        c, slope, d = h[m.CONTROL], h[m.SLOPES] + h[m.NY] * last, data(h, f, w, n)
        if not ends:
            evaluate(h, f, w, n, t_new, h[m.Y_NEW], slope)
            n[m.EVALUATIONS] += 1
        if n[m.EVALUATION] != m.OK:
            return False
        if not (finite(h, w, slope) and finite(h, w, h[m.Y_NEW])):
            n[m.EVALUATION] = m.NOT_FINITE
            return False
        w[c + m.DRIFT] = max(w[c + m.DRIFT], largest(d.residual, d.n_closure_rows))
        w[c + m.RATE_DRIFT] = max(w[c + m.RATE_DRIFT], largest(d.residual_rate, d.n_closure_rows))
        used = project(h, f, w, n, t_new, h[m.Y_NEW], slope, tolerance)
        note(h, w)
        if used > 0:
            n[m.EVALUATIONS] += used
            n[m.PROJECTION_EVALUATIONS] += used
            n[m.PROJECTIONS] += 1
        return used >= 0

    @kernel
    def try_step(h, f, w, n, step, t_new, tolerance):
        """Error norm of the step to Y_NEW, 1 at the tolerance; FAILED when it could not be made."""
        if ready(h, w):
            arrive(h, f, w, n, step, t_new)
            return 0.0
        if not attempt(h, f, w, n, step):
            return FAILED
        norm = error_norm(h, f, w, n, step)
        if norm != norm:
            n[m.EVALUATION] = m.NOT_FINITE
            return FAILED
        if norm > 1.0:
            return min(norm, FAILED)
        if not finish(h, f, w, n, t_new, tolerance):
            return FAILED
        detect_stiffness(h, w, n, step)
        return norm

    @kernel
    def accept(h, f, w, n, t_new):
        """Make the end of the step the start of the next."""
        slope = h[m.SLOPES]
        final = slope + h[m.NY] * last
        for k in range(h[m.NY]):
            w[h[m.Y] + k] = w[h[m.Y_NEW] + k]
            w[slope + k] = w[final + k]
        w[h[m.CONTROL] + m.TIME] = t_new
        keep_scales(data(h, f, w, n))

    @kernel
    def set_off(h, f, w, n):
        """What `first_step` does for the contacts, before a step along a polynomial; True, for it can be made."""
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y], h[m.SLOPES])
        n[m.EVALUATIONS] += 1
        watch_start(h, w)
        n[m.EVALUATION], n[m.FRESH] = m.OK, 0
        return True

    @kernel
    def start(h, f, w, n):
        """Begin at the start of a segment or after an event; False when that cannot be."""
        if ready(h, w):
            return set_off(h, f, w, n)
        if not first_step(h, f, w, n):
            return False
        note(h, w)
        stand(h, w, w[h[m.CONTROL] + m.TIME])
        return True

    @kernel
    def choose_step(h, w, n, t):
        """Length of the step to try from t; 0, with the reason in n[STATUS], when none can be."""
        c = h[m.CONTROL]
        step = w[c + m.COLLOCATED] if ready(h, w) else steer(h, w, t)
        if step == 0.0:
            n[m.STATUS] = m.SINGULAR_AHEAD
            return 0.0
        if t + 1.0001 * step >= w[c + m.END]:
            step = w[c + m.END] - t
        if step > SMALLEST_STEP * max(abs(t), w[c + m.SPAN]):
            return step
        if n[m.EVALUATION] == m.NOT_FINITE:
            n[m.STATUS] = m.NOT_A_NUMBER
        else:
            n[m.STATUS] = m.LOST_CLOSURE if n[m.EVALUATION] != m.OK else m.STEP_TOO_SMALL
        return 0.0

    @kernel
    def advance(h, f, w, n, outputs, rows, events):
        """Step to the end of the segment or of the budget; n[STATUS] says why it came back."""
        c = h[m.CONTROL]
        while not must_stop(h, w, n, outputs, rows, events):
            t = w[c + m.TIME]
            if n[m.FRESH] and not start(h, f, w, n):
                return
            step = choose_step(h, w, n, t)
            if step == 0.0:
                return
            final = t + 1.0001 * step >= w[c + m.END]
            t_new = w[c + m.END] if final else t + step
            norm = try_step(h, f, w, n, step, t_new, open_loops(h, w, n, outputs, t_new))
            if norm > 1.0:
                n[m.REJECTED] += 1
                if not after_rejection(h, w, n, step, norm):
                    return
                continue
            along = ready(h, w)
            following = w[c + m.STEP] if along else next_step(h, w, n, step, norm)
            hold_modes(h, w, n)
            happened, known, t_end, step = resolve_events(h, f, w, n, step, t_new, rows, events)
            if happened == AGAIN and w[c + m.FIXED] == 0.0 and not along:  # a polynomial would be the same again
                n[m.REJECTED] += 1
                w[c + m.STEP], w[c + m.REJECTED_STEP] = SHORTER * step, 0.0
                continue
            if happened < 0:
                return
            n[m.STEPS] += 1
            if along:
                snapshot(h, w, n, rows, t, h[m.Y])
            record_outputs(h, f, w, n, step, known, outputs, rows, t_end)
            keep(h, f, w, n, step)
            accept(h, f, w, n, t_end)
            plan(h, w, step, following)
            if along:
                done(h, w, t_end)
            elif t_end == t_new:  # how independent the rows are has been noted at the end that was tried
                foresee(h, f, w, n, t_end)
            if happened > 0 or along:
                hold_modes(h, w, n)
                snapshot(h, w, n, rows, t_end, h[m.Y])
                n[m.FRESH] = 1 if along or happened == RESTART else 0

    return advance
