"""Contacts whose begin and end are noticed at step ends only, as in the paper; the impact rate is latched there.

Nothing is located: the step that ends deep in the wall, or past it, stands, and the next one starts with the
contact's other mode. Kept to show what this costs in accuracy (Wang & Wang 2019, sec. 6.1, steps 5 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics.integrate.events import closed, start_watch, switch
from pipeline.dynamics.integrate.state import (
    EVALUATIONS,
    EVENT_ROW,
    GAP1,
    LOST_CLOSURE,
    PEAK_DEPTH,
    PEAK_FORCE,
    RATE1,
    STATUS,
)
from pipeline.dynamics.integrate.stepper import RESTART
from pipeline.dynamics.integrate.trace import watch
from pipeline.dynamics.tables import (
    EVALUATION,
    GAP,
    MODE,
    N_CONTACTS,
    NORMAL_FORCE,
    NY,
    OK,
    RATE,
    SLOPES,
    Y_NEW,
    touch,
)
from pipeline.dynamics.vectors import kernel


@kernel
def differs(h, w, n, c):
    """Whether contact c has come to have the other mode."""
    return (w[watch(h, c) + GAP1] < 0.0) != (n[n[MODE] + c] == 1)


def make_settle(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
    """The kernel settle(h, f, w, n, step, t_new, events) -> (event?, dense output ready?, end, step)."""
    last = method.last

    @kernel
    def look(h, w, n, events):
        """Gaps and rates at the step's end, peaks of the closed contacts; whether some mode changes."""
        found = False
        for c in range(h[N_CONTACTS]):
            o = watch(h, c)
            w[o + GAP1], w[o + RATE1] = w[touch(h, c) + GAP], w[touch(h, c) + RATE]
            if n[n[MODE] + c] == 1:
                event = events[int(w[o + EVENT_ROW])]
                event[PEAK_FORCE] = max(event[PEAK_FORCE], w[touch(h, c) + NORMAL_FORCE])
                event[PEAK_DEPTH] = max(event[PEAK_DEPTH], -w[o + GAP1])
            found |= differs(h, w, n, c)
        return found

    @kernel
    def settle(h, f, w, n, step, t_new, events):
        if not look(h, w, n, events):
            return 0, False, t_new, step
        extend(h, f, w, n, step)  # before the modes change: the outputs of this step belong to the old ones
        for c in range(h[N_CONTACTS]):
            if differs(h, w, n, c):
                switch(h, w, n, events, c, t_new)
        evaluate(h, f, w, n, t_new, h[Y_NEW], h[SLOPES] + h[NY] * last)
        n[EVALUATIONS] += 1
        if n[EVALUATION] != OK:
            n[STATUS] = LOST_CLOSURE
            return -1, True, t_new, step
        return RESTART + 1, True, t_new, step

    return settle


EVENTS_OF_CONTACTS = (start_watch, make_settle, closed)
