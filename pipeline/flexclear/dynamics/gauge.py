"""Gauges: joint coordinates measured from the joint's two frames, for joints in the tree and in closures alike.

An angle with full turns needs more than positions and speeds: an internal state at the end of the ledger holds
the angle including its full turns.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, axis, cross, dot, scale, sub


@kernel
def relative_twist(a, b):
    """Return the angular velocity of frame b relative to frame a, and the velocity of its origin there."""
    omega, r = a.omega, sub(b.origin, a.origin)
    slide = sub(b.velocity, add(a.velocity, cross(omega, r)))
    return sub(b.omega, omega), slide


@kernel
def measure(d, g):
    """Return coordinate of gauge g, its rate, moment and force of a unit force along it on the second body."""
    gauge = d.gauges[g]
    a, b = d.site_frames[gauge.a], d.site_frames[gauge.b]
    F, G, p = a.axes, b.axes, b.origin
    along = axis(F if gauge.side == 0 else G, gauge.axis)
    if gauge.turning:
        sine = dot(axis(F, gauge.sine_f), axis(G, gauge.sine_g))
        cosine = dot(axis(F, gauge.cosine_f), axis(G, gauge.cosine_g))
        return np.arctan2(sine, cosine), dot(along, sub(b.omega, a.omega)), along, ZERO
    r, (_, slide) = sub(p, a.origin), relative_twist(a, b)
    return dot(along, r), dot(along, slide), cross(p, along), along


@kernel
def internal_rate(d, k):
    """Return the index in LEDGER_RATE of the rate of internal state k."""
    return d.n_ledger - d.n_internal + k


@kernel
def counted(d, g):
    """Return the same as `measure`, with the full turns of an angle if the gauge counts them; store their rate."""
    value, rate, moment, force = measure(d, g)
    turn = d.gauges[g].turns
    if turn >= 0:
        d.ledger_rate[internal_rate(d, turn)] = rate
        value += 2.0 * np.pi * np.round((d.internal[turn] - value) / (2.0 * np.pi))
    return value, rate, moment, force


@kernel
def bias(d, g):
    """Return the second rate of the coordinate of gauge g at the present accelerations of its sites' frames."""
    gauge = d.gauges[g]
    a, b = d.site_frames[gauge.a], d.site_frames[gauge.b]
    side = a if gauge.side == 0 else b
    along, omega, alpha = axis(side.axes, gauge.axis), a.omega, a.alpha
    if gauge.turning:
        swing, turning = cross(side.omega, along), sub(b.omega, omega)
        return dot(along, sub(b.alpha, alpha)) + dot(swing, turning)
    r = sub(b.origin, a.origin)
    slide = sub(sub(b.velocity, a.velocity), cross(omega, r))
    second = sub(sub(b.acceleration, a.acceleration), cross(alpha, r))
    return dot(along, sub(second, add(cross(omega, cross(omega, r)), scale(2.0, cross(omega, slide)))))
