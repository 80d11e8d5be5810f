"""Access to the tables of loads, and the common kernels of loads: measuring and applying forces.

A load between two sites applies one wrench to both, with opposite signs: total force and moment are zero.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import gauge
from flexclear.dynamics.bodies.rigid import apply_between, apply_wrench
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, cross, dot, scale, sub, turn


@kernel
def number(d, k, which):
    """Return number `which` of load k."""
    return d.load_numbers[d.loads[k].number0 + which].value


@kernel
def law(d, k, which):
    """Return the present value of law `which` of load k."""
    return d.law[d.loads[k].law0 + which].value


@kernel
def laws(d, k):
    """Return the present values of three laws of load k, as a vector."""
    return (law(d, k, 0), law(d, k, 1), law(d, k, 2))


@kernel
def law_rate(d, k, which):
    """Return the present rate of law `which` of load k [1/s of its value]."""
    return d.law[d.loads[k].law0 + which].rate


@kernel
def act(d, k, moment, force, value, rate, stored, power, loss):
    """Apply the wrench of load k to b and its opposite to a; store the results; add power and loss to the ledger."""
    load, now = d.loads[k], d.load[k]
    now.force, now.moment, now.value, now.rate = force, moment, value, rate
    now.stored, now.power, now.loss = stored, power, loss
    d.ledger_rate[load.book] += power
    d.ledger_rate[load.book + 1] += loss
    if load.a >= 0:
        apply_between(d, load.a, load.b, moment, force)
    else:
        apply_wrench(d, load.b, moment, force)


@kernel
def measure(d, k):
    """Return the joint coordinate of load k, its rate, and the wrench (moment, force) of a unit force along it."""
    return gauge.counted(d, d.loads[k].gauge)


@kernel
def line(d, k):
    """Return the distance between the two origins of load k, its rate, and the direction from the first to the second.

    The direction is zero where the origins coincide.
    """
    a, b = d.site_frames[d.loads[k].a], d.site_frames[d.loads[k].b]
    r = sub(b.origin, a.origin)
    length = np.sqrt(dot(r, r))
    along = scale(1.0 / length, r) if length > 0.0 else ZERO
    return length, dot(along, sub(b.velocity, a.velocity)), along


def along_coordinate(size: Callable) -> Callable:
    """Build `apply` of loads along a joint coordinate with the force size(d, k) [N or N m]; all power is work."""

    @kernel
    def apply(d, k):
        value, rate, moment, force = measure(d, k)
        pushing = size(d, k)
        act(d, k, scale(pushing, moment), scale(pushing, force), value, rate, 0.0, pushing * rate, 0.0)

    return apply


def at_origin(given: Callable) -> Callable:
    """Build `apply` of loads at the origin of a frame with the force given(d, k) [N]; all power is work."""

    @kernel
    def apply(d, k):
        frame, force = d.site_frames[d.loads[k].b], given(d, k)
        if d.loads[k].follows:
            force = turn(frame.axes, force)
        act(d, k, cross(frame.origin, force), force, 0.0, 0.0, 0.0, dot(force, frame.velocity), 0.0)

    return apply
