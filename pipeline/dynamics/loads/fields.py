"""Where loads stand in the tables, and what the kernels of all loads share: measuring and pushing.

A load between two sites acts on both by one wrench, with opposite signs: it leaves no force and no moment over.
"""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.tables import (
    AXES,
    FLEX_C0,
    LAW,
    LAW_SIZE,
    LEDGER_RATE,
    LOAD,
    LOAD_SIZE,
    LOAD_STORED,
    MODAL_BIAS,
    N_MODES,
    OMEGA,
    ORIGIN,
    PORT_COLUMN,
    PORT_FLEX,
    TURN,
    VELOCITY,
    column,
    flex,
    place,
    port,
    site_frame,
    site_link,
    site_port,
    wrench,
)
from pipeline.dynamics.vectors import accumulate, add, at, at9, axis, cross, dot, kernel, put, scale, sub

LOADS, LOAD_KINDS, LOAD_NUMBERS, LOAD_SLOT = (
    place(name) for name in ("LOADS", "LOAD_KINDS", "LOAD_NUMBERS", "LOAD_SLOT")
)
# fields of a load: sites (a is -1 where the world holds against it), its first law, the angle that it follows or -1,
# whether it turns with its frame, and how its coordinate is measured: turning, frame and axis, entries of R_FG
A, B, LAW0, TURNS, FOLLOWS, TURNING, SIDE, AXIS, SINE, COSINE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10
WIDTH, NUMBERS = 12, 5
# what it does now: force on b, its moment about the kernels' origin, length or coordinate, its rate, stored energy
# (tables.LOAD_STORED), power that it brings in, power that it loses
FORCE, MOMENT, VALUE, RATE, STORED, POWER, LOSS = 0, 3, 6, 7, LOAD_STORED, 9, 10
ZERO = (0.0, 0.0, 0.0)


@kernel
def field(h, k, which):
    """A field of load k."""
    return h[h[LOADS] + WIDTH * k + which]


@kernel
def number(h, f, k, which):
    """A number of load k."""
    return f[h[LOAD_NUMBERS] + NUMBERS * k + which]


@kernel
def law(h, w, k, which):
    """Present value of a law of load k."""
    return w[h[LAW] + LAW_SIZE * (field(h, k, LAW0) + which)]


@kernel
def push(h, w, s, moment, force):
    """Apply a wrench (moment about the kernels' origin, force; world) on the link, and its modes, of site s."""
    o = wrench(h, site_link(h, s))
    accumulate(w, o, scale(-1.0, moment))
    accumulate(w, o + 3, scale(-1.0, force))
    p = site_port(h, s)
    if p >= 0:
        b = port(h, p, PORT_FLEX)
        bias, first = h[MODAL_BIAS] + flex(h, b, FLEX_C0), port(h, p, PORT_COLUMN)
        for j in range(flex(h, b, N_MODES)):
            o = column(h, first + j)
            w[bias + j] -= dot(at(w, o), moment) + dot(at(w, o + 3), force)


@kernel
def act(h, w, k, moment, force, value, rate, stored, power, loss):
    """Apply the wrench of load k on b and against it on a; note what it does, and book power and loss."""
    o = h[LOAD] + LOAD_SIZE * k
    put(w, o + FORCE, force)
    put(w, o + MOMENT, moment)
    w[o + VALUE], w[o + RATE], w[o + STORED] = value, rate, stored
    w[o + POWER], w[o + LOSS] = power, loss
    ledger = h[LEDGER_RATE] + h[LOAD_SLOT]
    w[ledger] += power
    w[ledger + 1] += loss
    push(h, w, field(h, k, B), moment, force)
    if field(h, k, A) >= 0:
        push(h, w, field(h, k, A), scale(-1.0, moment), scale(-1.0, force))


@kernel
def measure(h, w, k):
    """Coordinate of load k, its rate, and the wrench (moment, force) of a unit force along it."""
    a, b = site_frame(h, field(h, k, A)), site_frame(h, field(h, k, B))
    F, G = at9(w, a + AXES), at9(w, b + AXES)
    along = axis(F if field(h, k, SIDE) == 0 else G, field(h, k, AXIS))
    omega = at(w, a + OMEGA)
    if field(h, k, TURNING):
        sine = dot(axis(F, field(h, k, SINE)), axis(G, field(h, k, SINE + 1)))
        cosine = dot(axis(F, field(h, k, COSINE)), axis(G, field(h, k, COSINE + 1)))
        return np.arctan2(sine, cosine), dot(along, sub(at(w, b + OMEGA), omega)), along, ZERO
    p = at(w, b + ORIGIN)
    r = sub(p, at(w, a + ORIGIN))
    slide = sub(at(w, b + VELOCITY), add(at(w, a + VELOCITY), cross(omega, r)))
    return dot(along, r), dot(along, slide), cross(p, along), along


@kernel
def unwound(h, w, k, angle, rate):
    """The angle of load k with the full turns that it has made; its state follows the rate."""
    turn = field(h, k, TURNS)
    w[h[LEDGER_RATE] + h[LOAD_SLOT] + 2 + turn] = rate
    return angle + 2.0 * np.pi * np.round((w[h[TURN] + turn] - angle) / (2.0 * np.pi))
