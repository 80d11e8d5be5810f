"""Steps end where friction along a joint coordinate bends: at the speeds that its load names, in both directions.

Between the ends of a step the speed is taken to go straight on, as that of contacts is.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.friction_kinks import NONE, SPEEDS, Kinks, nearness, passes, sooner
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def _copy(h, w, source, target):
    for k in range(h[m.N_LOADS]):
        o = m.LOAD_SPEEDS.row(h, k)
        w[o + target] = w[o + source]


@kernel
def note_start(h, w):
    """Note the speeds along which loads bend where a segment starts, which has just been evaluated."""
    _copy(h, w, m.LOAD_SPEEDS.now, m.LOAD_SPEEDS.start)


@kernel
def note_end(h, w):
    """The same at the end of a step."""
    _copy(h, w, m.LOAD_SPEEDS.now, m.LOAD_SPEEDS.end)


@kernel
def end_is_start(h, w):
    """The end of an accepted step is the start of the next."""
    _copy(h, w, m.LOAD_SPEEDS.end, m.LOAD_SPEEDS.start)


@kernel
def speed_passed(w, o, level, near):
    """The kink of a load at a speed (`Kinks.first`); o: its row of LOAD_SPEEDS."""
    first, second = w[o + m.LOAD_SPEEDS.start] - level, w[o + m.LOAD_SPEEDS.end] - level
    if not passes(first, second, near):
        return NONE
    return first / (first - second), o + m.LOAD_SPEEDS.now, level, near, 0.0, 1.0, first, second


@kernel
def first_of_loads(h, f, w, n):
    """The kink that a load passes first (`Kinks.first`)."""
    found = NONE
    for k in range(h[m.N_LOADS]):
        o, kinks = m.LOAD_SPEEDS.row(h, k), m.LOAD_KINKS.row(h, k)
        for i in range(SPEEDS):
            level = f[kinks + i]
            if level > 0.0:
                near = nearness(h, w, level)
                found = sooner(found, speed_passed(w, o, level, near))
                found = sooner(found, speed_passed(w, o, -level, near))
    return found


LOAD_FRICTION_KINKS = Kinks(note_start, note_end, end_is_start, first_of_loads)
