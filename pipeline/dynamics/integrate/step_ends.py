"""Contacts whose begin and end are noticed at step ends only, as in the paper; the impact rate is latched there.

Nothing is located: the step that ends deep in the wall, or past it, stands, and the next one starts with the
contact's other mode. Kept to show what this costs in accuracy (Wang & Wang 2019, sec. 6.1, steps 5 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate.events import closed, start_watch, switch
from pipeline.dynamics.integrate.stepper import RESTART
from pipeline.dynamics.integrate.trace import watch
from pipeline.dynamics.kernels import kernel


@kernel
def differs(h, w, n, c):
    """Whether contact c has come to have the other mode."""
    return (w[watch(h, c) + m.WATCH.gap1] < 0.0) != (n[n[m.MODE] + c] == 1)


def make_settle(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
    """The kernel settle(h, f, w, n, step, t_new, events) -> (event?, dense output ready?, end, step)."""
    last = method.last

    @kernel
    def look(h, w, n, events):
        """Gaps and rates at the step's end, peaks of the closed contacts; whether some mode changes."""
        found = False
        for c in range(h[m.N_CONTACTS]):
            o = watch(h, c)
            w[o + m.WATCH.gap1], w[o + m.WATCH.rate1] = (
                w[m.TOUCH.row(h, c) + m.TOUCH.gap],
                w[m.TOUCH.row(h, c) + m.TOUCH.rate],
            )
            if n[n[m.MODE] + c] == 1:
                event = events[int(w[o + m.WATCH.event_row])]
                event[m.EVENT.peak_force] = max(event[m.EVENT.peak_force], w[m.TOUCH.row(h, c) + m.TOUCH.normal_force])
                event[m.EVENT.peak_depth] = max(event[m.EVENT.peak_depth], -w[o + m.WATCH.gap1])
            found |= differs(h, w, n, c)
        return found

    @kernel
    def settle(h, f, w, n, step, t_new, events):
        if not look(h, w, n, events):
            return 0, False, t_new, step
        extend(h, f, w, n, step)  # before the modes change: the outputs of this step belong to the old ones
        for c in range(h[m.N_CONTACTS]):
            if differs(h, w, n, c):
                switch(h, w, n, events, c, t_new)
        evaluate(h, f, w, n, t_new, h[m.Y_NEW], h[m.SLOPES] + h[m.NY] * last)
        n[m.EVALUATIONS] += 1
        if n[m.EVALUATION] != m.OK:
            n[m.STATUS] = m.LOST_CLOSURE
            return -1, True, t_new, step
        return RESTART + 1, True, t_new, step

    return settle


EVENTS_OF_CONTACTS = (start_watch, make_settle, closed)
