"""Contacts whose begin and end are noticed at step ends only, as in the paper; the impact rate is latched there.

Nothing is located: the step that ends deep in the wall, or past it, stands, and the next one starts with the
contact's other mode. Kept to show what this costs in accuracy (Wang & Wang 2019, sec. 6.1, steps 5 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.contact_events import any_closed, change_mode, watch_start
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.integrate.stepper import RESTART
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def mode_differs(h, w, n, c):
    """Whether contact c has come to have the other mode."""
    return (w[m.WATCH.row(h, c) + m.WATCH.gap1] < 0.0) != (n[n[m.MODE] + c] == 1)


@kernel
def watch_end(h, w, n, events):
    """Gaps and rates at the step's end, peaks of the closed contacts; whether some mode changes."""
    changes = False
    for c in range(h[m.N_CONTACTS]):
        o, now = m.WATCH.row(h, c), m.TOUCH.row(h, c)
        w[o + m.WATCH.gap1], w[o + m.WATCH.rate1] = w[now + m.TOUCH.gap], w[now + m.TOUCH.rate]
        if n[n[m.MODE] + c] == 1:
            event = events[int(w[o + m.WATCH.event_row])]
            event[m.EVENT.peak_force] = max(event[m.EVENT.peak_force], w[now + m.TOUCH.normal_force])
            event[m.EVENT.peak_depth] = max(event[m.EVENT.peak_depth], -w[o + m.WATCH.gap1])
        changes |= mode_differs(h, w, n, c)
    return changes


def make_resolve_events(
    evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any
) -> Callable:
    """The kernel resolve_events(h, f, w, n, step, t_new, rows, events) -> (event?, dense output ready?, end, step)."""
    last = method.last

    @kernel
    def resolve_events(h, f, w, n, step, t_new, rows, events):
        if not watch_end(h, w, n, events):
            return 0, False, t_new, step
        extend(h, f, w, n, step)  # before the modes change: the outputs of this step belong to the old ones
        for c in range(h[m.N_CONTACTS]):
            if mode_differs(h, w, n, c):
                change_mode(h, w, n, events, c, t_new)
        evaluate(h, f, w, n, t_new, h[m.Y_NEW], slope(h, last))
        n[m.EVALUATIONS] += 1
        if n[m.EVALUATION] != m.OK:
            n[m.STATUS] = m.LOST_CLOSURE
            return -1, True, t_new, step
        return RESTART + 1, True, t_new, step

    return resolve_events


AT_STEP_ENDS = (watch_start, make_resolve_events, any_closed)
