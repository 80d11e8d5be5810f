"""Steps end where friction along a joint coordinate bends: at the speeds that its load names, in both directions.

Between the ends of a step the speed is taken to go straight on, as that of contacts is.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.friction_kinks import NONE, SPEEDS, Kinks, nearness, passes, sooner
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def note_start(d):
    """Note the speeds along which loads bend where a segment starts, which has just been evaluated."""
    for k in range(d.n_loads):
        d.load_speeds[k].start = d.load_speeds[k].now


@kernel
def note_end(d):
    """The same at the end of a step."""
    for k in range(d.n_loads):
        d.load_speeds[k].end = d.load_speeds[k].now


@kernel
def end_is_start(d):
    """The end of an accepted step is the start of the next."""
    for k in range(d.n_loads):
        d.load_speeds[k].start = d.load_speeds[k].end


@kernel
def speed_passed(d, k, level, near):
    """The kink of load k at a speed (`Kinks.first`)."""
    first, second = d.load_speeds[k].start - level, d.load_speeds[k].end - level
    if not passes(first, second, near):
        return NONE
    now = d.at_load_speeds + m.LOAD_SPEEDS.size * k + m.LOAD_SPEEDS.now
    return first / (first - second), now, level, near, 0.0, 1.0, first, second


@kernel
def first_of_loads(d):
    """The kink that a load passes first (`Kinks.first`)."""
    found = NONE
    for k in range(d.n_loads):
        for i in range(SPEEDS):
            level = d.load_kinks[k].speeds[i]
            if level > 0.0:
                near = nearness(d, level)
                found = sooner(found, speed_passed(d, k, level, near))
                found = sooner(found, speed_passed(d, k, -level, near))
    return found


LOAD_FRICTION_KINKS = Kinks(note_start, note_end, end_is_start, first_of_loads)
