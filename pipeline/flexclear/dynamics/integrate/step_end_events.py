"""Contacts whose begin and end are detected at step ends only, as in the paper; the impact rate is latched there.

No event is located: a step that ends deep in the wall, or past it, is accepted, and the next one starts with the
contact's other mode. This shows the cost in accuracy (Wang & Wang 2019, sec. 6.1, steps 5 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.contact_events import any_closed, change_mode, watch_start
from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.integrate.stepper import RESTART
from flexclear.dynamics.kernels import kernel


@kernel
def mode_differs(d, c):
    """Return True when contact c must change its mode."""
    return (d.watch[c].gap1 < 0.0) != (d.mode[c] == 1)


@kernel
def watch_end(d, events):
    """Store gaps, rates and peaks of the contacts at the step's end; return True when a mode changes."""
    changes = False
    for c in range(d.n_contacts):
        watch, now = d.watch[c], d.touch[c]
        watch.gap1, watch.rate1 = now.gap, now.rate
        if d.mode[c] == 1:
            event = events[int(watch.event_row)]
            event[m.EVENT.peak_force] = max(event[m.EVENT.peak_force], now.normal_force)
            event[m.EVENT.peak_depth] = max(event[m.EVENT.peak_depth], -watch.gap1)
        changes |= mode_differs(d, c)
    return changes


def make_resolve_events(
    evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any
) -> Callable:
    """Build the kernel resolve_events(d, step, t_new, rows, events) -> (event?, dense output ready?, end, step)."""
    last = method.last

    @kernel
    def resolve_events(d, step, t_new, rows, events):
        if not watch_end(d, events):
            return 0, False, t_new, step
        extend(d, step)  # before the modes change: the outputs of this step belong to the old ones
        for c in range(d.n_contacts):
            if mode_differs(d, c):
                change_mode(d, events, c, t_new)
        evaluate(d, t_new, d.at_y_new, slope(d, last))
        d.evaluations += 1
        if d.evaluation != m.OK:
            d.status = m.LOST_CLOSURE
            return -1, True, t_new, step
        return RESTART + 1, True, t_new, step

    return resolve_events


AT_STEP_ENDS = (watch_start, make_resolve_events, any_closed)
