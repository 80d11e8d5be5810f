"""Joint coordinates measured from the joint's two frames, so that it does not matter whether the joint closes a loop.

What a part needs beyond positions and speeds is an internal state of its own, at the end of the ledger: of an angle,
the full turns that it has made.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, add, at, at9, axis, cross, dot, scale, sub


@kernel
def measure(h, w, g):
    """Coordinate of gauge g, its rate, and the wrench (moment, force) of a unit force along it on the second body."""
    a, b = m.SITE_FRAMES.row(h, m.GAUGES.a(h, g)), m.SITE_FRAMES.row(h, m.GAUGES.b(h, g))
    F, G = at9(w, a + m.FRAME.axes), at9(w, b + m.FRAME.axes)
    along = axis(F if m.GAUGES.side(h, g) == 0 else G, m.GAUGES.axis(h, g))
    omega = at(w, a + m.FRAME.omega)
    if m.GAUGES.turning(h, g):
        sine = dot(axis(F, m.GAUGES.sine_f(h, g)), axis(G, m.GAUGES.sine_g(h, g)))
        cosine = dot(axis(F, m.GAUGES.cosine_f(h, g)), axis(G, m.GAUGES.cosine_g(h, g)))
        return np.arctan2(sine, cosine), dot(along, sub(at(w, b + m.FRAME.omega), omega)), along, ZERO
    p = at(w, b + m.FRAME.origin)
    r = sub(p, at(w, a + m.FRAME.origin))
    slide = sub(at(w, b + m.FRAME.velocity), add(at(w, a + m.FRAME.velocity), cross(omega, r)))
    return dot(along, r), dot(along, slide), cross(p, along), along


@kernel
def internal_rate(h, k):
    """Place in w of the rate of internal state k."""
    return h[m.LEDGER_RATE] + h[m.N_LEDGER] - h[m.N_INTERNAL] + k


@kernel
def unwound(h, w, g, angle, rate):
    """The angle of gauge g with the full turns that it has made; its state follows the rate."""
    turn = m.GAUGES.turns(h, g)
    w[internal_rate(h, turn)] = rate
    return angle + 2.0 * np.pi * np.round((w[h[m.INTERNAL] + turn] - angle) / (2.0 * np.pi))


@kernel
def counted(h, w, g):
    """As `measure`, an angle with the full turns that it has made if the gauge counts them."""
    value, rate, moment, force = measure(h, w, g)
    if m.GAUGES.turns(h, g) >= 0:
        value = unwound(h, w, g, value, rate)
    return value, rate, moment, force


@kernel
def bias(h, w, g):
    """Second rate of the coordinate of gauge g at the accelerations that its sites' frames have now."""
    a, b = m.SITE_FRAMES.row(h, m.GAUGES.a(h, g)), m.SITE_FRAMES.row(h, m.GAUGES.b(h, g))
    side = a if m.GAUGES.side(h, g) == 0 else b
    along, omega, alpha = (
        axis(at9(w, side + m.FRAME.axes), m.GAUGES.axis(h, g)),
        at(w, a + m.FRAME.omega),
        at(w, a + m.FRAME.alpha),
    )
    if m.GAUGES.turning(h, g):
        swing = cross(at(w, side + m.FRAME.omega), along)
        turning = sub(at(w, b + m.FRAME.omega), omega)
        return dot(along, sub(at(w, b + m.FRAME.alpha), alpha)) + dot(swing, turning)
    r = sub(at(w, b + m.FRAME.origin), at(w, a + m.FRAME.origin))
    slide = sub(sub(at(w, b + m.FRAME.velocity), at(w, a + m.FRAME.velocity)), cross(omega, r))
    second = sub(sub(at(w, b + m.FRAME.acceleration), at(w, a + m.FRAME.acceleration)), cross(alpha, r))
    return dot(along, sub(second, add(cross(omega, cross(omega, r)), scale(2.0, cross(omega, slide)))))
