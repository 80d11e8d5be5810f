"""Steps of an integration method from event to event, with projection and a record.

One call advances to the end of a segment between two drive breaks, or until its budget of
evaluations is used, so that the caller can report progress and be interrupted. How long a step is
`adaptive` or `fixed` says; what a step is, the method.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics import memory as m
from pipeline.dynamics.equations.projection import keep_scales, largest
from pipeline.dynamics.integrate.norms import finite
from pipeline.dynamics.integrate.recording import hold_modes, make_record_outputs, snapshot
from pipeline.dynamics.integrate.singular_step import allowed, forget, near, note, plan
from pipeline.dynamics.integrate.stiffness import make_detect_stiffness
from pipeline.dynamics.kernels import kernel

#: what resolve_events returns for an event after which integration starts afresh; another positive number only
#: records it
RESTART = 1
#: share of the mechanism's size to which closures are closed before a singular pose
TIGHTLY = 1e-15
#: steps in a row that end next to a singular pose before it counts as one that the motion does not leave
MOST_BLIND = 20.0
#: error norm of a step that could not be made
FAILED = 1e9
#: a step below this share of the time reached cannot be told from rounding
SMALLEST_STEP = 4e-16


@kernel
def watch_nothing(h, w):
    """No contact to watch."""


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
) -> Callable:
    """The kernel advance(h, f, w, n, outputs, rows, events).

    stepping: the module `adaptive` or `fixed`.
    events: watch_start, make_resolve_events and any_closed of `contact_events` or `step_end_events`.
    """
    begin, attempt, error, extend, keep = method.make_kernels(evaluate, retract)
    last, ends = method.last, method.ends
    watch_start, make_resolve_events, any_closed = events
    resolve_events = make_resolve_events(evaluate, attempt, extend, project, method)
    record_outputs = make_record_outputs(extend, method.interpolate)
    detect_stiffness = make_detect_stiffness(method)
    first_step, error_norm, after_rejection, next_step, choose_step, foresee = stepping.make_step_control(
        evaluate, (watch_start, any_closed), begin, error, method
    )

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
    def finish(h, f, w, n, t_new):
        """Slope at Y_NEW with the loops closed; False when they cannot be."""
        c, slope = h[m.CONTROL], h[m.SLOPES] + h[m.NY] * last
        if not ends:
            evaluate(h, f, w, n, t_new, h[m.Y_NEW], slope)
            n[m.EVALUATIONS] += 1
        if n[m.EVALUATION] != m.OK:
            return False
        if not (finite(h, w, slope) and finite(h, w, h[m.Y_NEW])):
            n[m.EVALUATION] = m.NOT_FINITE
            return False
        w[c + m.DRIFT] = max(w[c + m.DRIFT], largest(w, h[m.RESIDUAL], h[m.N_CLOSURE_ROWS]))
        w[c + m.RATE_DRIFT] = max(w[c + m.RATE_DRIFT], largest(w, h[m.RESIDUAL_RATE], h[m.N_CLOSURE_ROWS]))
        share = TIGHTLY if near(h, w, t_new) else w[c + m.RTOL]
        used = project(h, f, w, n, t_new, h[m.Y_NEW], slope, share * w[c + m.LENGTH])
        note(h, w)
        if used > 0:
            n[m.EVALUATIONS] += used
            n[m.PROJECTION_EVALUATIONS] += used
            n[m.PROJECTIONS] += 1
        return used >= 0

    @kernel
    def try_step(h, f, w, n, step, t_new):
        """Error norm of the step to Y_NEW, 1 at the tolerance; FAILED when it could not be made."""
        if not attempt(h, f, w, n, step):
            return FAILED
        norm = error_norm(h, f, w, n, step)
        if norm != norm:
            n[m.EVALUATION] = m.NOT_FINITE
            return FAILED
        if norm > allowed(h, w):
            return min(norm, FAILED)
        if not finish(h, f, w, n, t_new):
            return FAILED
        detect_stiffness(h, w, n, step)
        return norm

    @kernel
    def accept(h, w, t_new):
        """Make the end of the step the start of the next."""
        slope = h[m.SLOPES]
        final = slope + h[m.NY] * last
        for k in range(h[m.NY]):
            w[h[m.Y] + k] = w[h[m.Y_NEW] + k]
            w[slope + k] = w[final + k]
        w[h[m.CONTROL] + m.TIME] = t_new
        keep_scales(h, w)

    @kernel
    def advance(h, f, w, n, outputs, rows, events):
        """Step to the end of the segment or of the budget; n[STATUS] says why it came back."""
        c = h[m.CONTROL]
        while not must_stop(h, w, n, outputs, rows, events):
            t = w[c + m.TIME]
            if n[m.FRESH]:
                if not first_step(h, f, w, n):
                    return
                note(h, w)
                forget(h, w, t)
            step = choose_step(h, w, t)
            final = t + 1.0001 * step >= w[c + m.END]
            if final:
                step = w[c + m.END] - t
            if not step > SMALLEST_STEP * max(abs(t), w[c + m.SPAN]):
                if n[m.EVALUATION] == m.NOT_FINITE:
                    n[m.STATUS] = m.NOT_A_NUMBER
                else:
                    n[m.STATUS] = m.LOST_CLOSURE if n[m.EVALUATION] != m.OK else m.STEP_TOO_SMALL
                return
            t_new = w[c + m.END] if final else t + step
            norm = try_step(h, f, w, n, step, t_new)
            if norm > allowed(h, w):
                n[m.REJECTED] += 1
                if not after_rejection(h, w, n, step, norm):
                    return
                continue
            following = next_step(h, w, n, step, norm)
            hold_modes(h, w, n)
            happened, ready, t_new, step = resolve_events(h, f, w, n, step, t_new, rows, events)
            if happened < 0:
                return
            n[m.STEPS] += 1
            straddling = w[c + m.STRADDLING] > 0.0
            if straddling:
                snapshot(h, w, n, rows, t, h[m.Y])
            record_outputs(h, f, w, n, step, ready, outputs, rows, t_new)
            keep(h, f, w, n, step)
            accept(h, w, t_new)
            plan(h, w, step, following)
            foresee(h, f, w, n, t_new)
            if happened > 0 or straddling:
                hold_modes(h, w, n)
                snapshot(h, w, n, rows, t_new, h[m.Y])
            if happened > 0:
                n[m.FRESH] = 1 if happened == RESTART else 0

    return advance
