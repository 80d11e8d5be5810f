"""Where loads stand in the tables, and what the kernels of all loads share: measuring and pushing.

A load between two sites acts on both by one wrench, with opposite signs: it leaves no force and no moment over.
"""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.bodies.rigid import apply_wrench
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import add, at, at9, axis, cross, dot, put, scale, sub

ZERO = (0.0, 0.0, 0.0)


@kernel
def number(h, f, k, which):
    """A number of load k."""
    return f[m.LOAD_NUMBERS.row(h, k) + which]


@kernel
def law(h, w, k, which):
    """Present value of a law of load k."""
    return w[m.LAW.row(h, m.LOADS.law0(h, k) + which)]


@kernel
def act(h, w, k, moment, force, value, rate, stored, power, loss):
    """Apply the wrench of load k on b and against it on a; note what it does, and book power and loss."""
    o = m.LOAD.row(h, k)
    put(w, o + m.LOAD.force, force)
    put(w, o + m.LOAD.moment, moment)
    w[o + m.LOAD.value], w[o + m.LOAD.rate], w[o + m.LOAD.stored] = value, rate, stored
    w[o + m.LOAD.power], w[o + m.LOAD.loss] = power, loss
    ledger = h[m.LEDGER_RATE] + h[m.LOAD_SLOT]
    w[ledger] += power
    w[ledger + 1] += loss
    apply_wrench(h, w, m.LOADS.b(h, k), moment, force)
    if m.LOADS.a(h, k) >= 0:
        apply_wrench(h, w, m.LOADS.a(h, k), scale(-1.0, moment), scale(-1.0, force))


@kernel
def measure(h, w, k):
    """Coordinate of load k, its rate, and the wrench (moment, force) of a unit force along it."""
    a, b = m.SITE_FRAMES.row(h, m.LOADS.a(h, k)), m.SITE_FRAMES.row(h, m.LOADS.b(h, k))
    F, G = at9(w, a + m.FRAME.axes), at9(w, b + m.FRAME.axes)
    along = axis(F if m.LOADS.side(h, k) == 0 else G, m.LOADS.axis(h, k))
    omega = at(w, a + m.FRAME.omega)
    if m.LOADS.turning(h, k):
        sine = dot(axis(F, m.LOADS.sine_f(h, k)), axis(G, m.LOADS.sine_g(h, k)))
        cosine = dot(axis(F, m.LOADS.cosine_f(h, k)), axis(G, m.LOADS.cosine_g(h, k)))
        return np.arctan2(sine, cosine), dot(along, sub(at(w, b + m.FRAME.omega), omega)), along, ZERO
    p = at(w, b + m.FRAME.origin)
    r = sub(p, at(w, a + m.FRAME.origin))
    slide = sub(at(w, b + m.FRAME.velocity), add(at(w, a + m.FRAME.velocity), cross(omega, r)))
    return dot(along, r), dot(along, slide), cross(p, along), along


@kernel
def unwound(h, w, k, angle, rate):
    """The angle of load k with the full turns that it has made; its state follows the rate."""
    turn = m.LOADS.turns(h, k)
    w[h[m.LEDGER_RATE] + h[m.LOAD_SLOT] + 2 + turn] = rate
    return angle + 2.0 * np.pi * np.round((w[h[m.TURN] + turn] - angle) / (2.0 * np.pi))
