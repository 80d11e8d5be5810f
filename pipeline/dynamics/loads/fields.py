"""Positions of loads in the tables, and the common kernels of loads: measuring and pushing.

A load between two sites acts on both by one wrench, with opposite signs: it leaves no force and no moment over.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import gauge
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.rigid import apply_wrench
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import put, scale

ZERO = (0.0, 0.0, 0.0)


@kernel
def number(h, f, k, which):
    """A number of load k."""
    return f[m.LOAD_NUMBERS.row(h, m.LOADS.number0(h, k)) + which]


@kernel
def law(h, w, k, which):
    """Present value of a law of load k."""
    return w[m.LAW.row(h, m.LOADS.law0(h, k) + which)]


@kernel
def law_rate(h, w, k, which):
    """Its present rate [1/s of it]."""
    return w[m.LAW.row(h, m.LOADS.law0(h, k) + which) + m.LAW.rate]


@kernel
def act(h, w, k, moment, force, value, rate, stored, power, loss):
    """Apply the wrench of load k on b and against it on a; note what it does, and book power and loss."""
    o = m.LOAD.row(h, k)
    put(w, o + m.LOAD.force, force)
    put(w, o + m.LOAD.moment, moment)
    w[o + m.LOAD.value], w[o + m.LOAD.rate], w[o + m.LOAD.stored] = value, rate, stored
    w[o + m.LOAD.power], w[o + m.LOAD.loss] = power, loss
    ledger = h[m.LEDGER_RATE] + m.LOADS.book(h, k)
    w[ledger] += power
    w[ledger + 1] += loss
    apply_wrench(h, w, m.LOADS.b(h, k), moment, force)
    if m.LOADS.a(h, k) >= 0:
        apply_wrench(h, w, m.LOADS.a(h, k), scale(-1.0, moment), scale(-1.0, force))


@kernel
def measure(h, w, k):
    """Joint coordinate of load k, its rate, and the wrench (moment, force) of a unit force along it."""
    return gauge.counted(h, w, m.LOADS.gauge(h, k))
