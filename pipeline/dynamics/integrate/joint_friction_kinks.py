"""Steps end where the friction of an ideal joint bends.

It does so at the sliding speeds that its law names, where sliding reverses if the law has bristles, and where something
that presses reverses, since loads are sums of magnitudes: the force along an axis, the moment about it, and the forces
at both ends where they lie in a plane. A vector that reverses passes zero; one that passes zero at a distance turns
smoothly.

A joint that is driven to and fro passes its speeds twice within a step that its error estimate may accept, when the
sliding speeds at both ends are the same. So they are looked for on the straight way between the sliding velocities.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.friction_kinks import (
    NONE,
    SPEEDS,
    Kinks,
    nearness,
    passes,
    sooner,
)
from flexclear.pipeline.dynamics.kernels import kernel

#: a vector reverses that passes zero within this share of its way: where a mechanism moves in a plane that is rounding
REVERSES = 1e-6


@kernel
def now(d, e):
    """Where w holds what bends the friction of bearing e."""
    return d.at_bends + m.BENDS.size * e


@kernel
def at_start(d, e):
    """Row of BENDS of bearing e at the start of the step."""
    return now(d, d.n_bearings + e)


@kernel
def at_end(d, e):
    """The same at its end."""
    return now(d, 2 * d.n_bearings + e)


@kernel
def _copy(d, source, target):
    for k in range(m.BENDS.size * d.n_bearings):
        d.w[target + k] = d.w[source + k]


@kernel
def watch_start(d):
    """Note what bends the friction of all bearings where a segment starts, which has just been evaluated."""
    _copy(d, d.at_bends, at_start(d, 0))


@kernel
def watch_end(d):
    """The same at the end of a step."""
    _copy(d, d.at_bends, at_end(d, 0))


@kernel
def end_becomes_start(d):
    """The end of an accepted step is the start of the next."""
    _copy(d, at_end(d, 0), at_start(d, 0))


@kernel
def magnitude(w, a, size):
    """Of a vector in w."""
    square = 0.0
    for k in range(size):
        square += w[a + k] * w[a + k]
    return np.sqrt(square)


@kernel
def closest(w, a, b, size):
    """Share of the straight way between two vectors in w where it is closest to zero, its distance, and its length."""
    way, along, distance = 0.0, 0.0, 0.0
    for k in range(size):
        change = w[b + k] - w[a + k]
        way, along = way + change * change, along - change * w[a + k]
    share = along / way if way > 0.0 else 0.0
    for k in range(size):
        there = w[a + k] + share * (w[b + k] - w[a + k])
        distance += there * there
    return share, np.sqrt(distance), np.sqrt(way)


@kernel
def speed_passed(d, e, level):
    """The kink of bearing e at a sliding speed (`Kinks.first`)."""
    a, b, near = at_start(d, e) + m.BENDS.sliding, at_end(d, e) + m.BENDS.sliding, nearness(d, level)
    place = d.at_bearing + m.BEARING.size * e + m.BEARING.slip
    first, second = magnitude(d.w, a, 3) - level, magnitude(d.w, b, 3) - level
    if passes(first, second, near):
        return first / (first - second), place, level, near, 0.0, 1.0, first, second
    share, distance, _ = closest(d.w, a, b, 3)
    inside = distance - level
    if not (0.0 < share < 1.0 and inside < -near and min(first, second) > -near):
        return NONE
    if first > near:
        return share * first / (first - inside), place, level, near, 0.0, share, first, inside
    if second > near:
        back = (1.0 - share) * second / (second - inside)
        return 1.0 - back, place, level, near, share, 1.0, inside, second
    return NONE


@kernel
def reversal(d, e, field, size, near):
    """The kink of bearing e where a vector of BENDS reverses (`Kinks.first`)."""
    current, a, b = now(d, e) + field, at_start(d, e) + field, at_end(d, e) + field
    share, distance, way = closest(d.w, a, b, size)
    apart = min(magnitude(d.w, a, size), magnitude(d.w, b, size)) > near
    if not (0.0 < share < 1.0 and distance <= REVERSES * way and apart):
        return NONE
    k = 0
    for i in range(1, size):
        if abs(d.w[b + i] - d.w[a + i]) > abs(d.w[b + k] - d.w[a + k]):
            k = i
    return share, current + k, 0.0, near, 0.0, 1.0, d.w[a + k], d.w[b + k]


@kernel
def first_of_bearings(d):
    """The kink that a bearing passes first (`Kinks.first`)."""
    found = NONE
    for e in range(d.n_bearings):
        numbers, load = d.bearing_numbers[e], nearness(d, d.bearing[e].load)
        for k in range(SPEEDS):
            level = numbers.kinks[k]
            if level > 0.0:
                found = sooner(found, speed_passed(d, e, level))
        turning = numbers.turning_kink
        if turning > 0.0:
            found = sooner(found, reversal(d, e, m.BENDS.sliding, 3, nearness(d, turning)))
        found = sooner(found, reversal(d, e, m.BENDS.along, 1, load))
        found = sooner(found, reversal(d, e, m.BENDS.about, 1, load))
        found = sooner(found, reversal(d, e, m.BENDS.one_end, 2, load))
        found = sooner(found, reversal(d, e, m.BENDS.other_end, 2, load))
    return found


BEARING_KINKS = Kinks(watch_start, watch_end, end_becomes_start, first_of_bearings)
