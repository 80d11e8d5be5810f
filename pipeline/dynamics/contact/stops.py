"""Stops: contacts at the ends of joint coordinates, along which their force, or torque, acts.

gap = sense (limit - coordinate), with full turns of angles counted; depth d = -gap; d' = sense times the rate. The
normal force of the law pushes the joint's second body back along the coordinate, and the first one by the opposite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.rigid import apply_wrench
from flexclear.pipeline.dynamics.contact.forces import make_normal_force
from flexclear.pipeline.dynamics.gauge import counted
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import put, scale


def make_stops(forms: tuple[Any, ...]) -> Callable:
    """The kernel stops(h, f, w, n) that applies all stops; forms: of normal forces, with `force` and `stored`."""
    normal_force = make_normal_force(forms)

    @kernel
    def stop(h, f, w, n, c):
        """Gap and rate of contact c, which is an end of a coordinate, and its force when it is closed."""
        o, numbers = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c)
        value, rate, moment, force = counted(h, w, m.CONTACTS.surfaces(h, c))
        limit, sense = f[numbers + m.CONTACT_NUMBERS.shape], f[numbers + m.CONTACT_NUMBERS.shape + 1]
        gap = sense * (limit - value)
        w[o + m.TOUCH.gap], w[o + m.TOUCH.rate] = gap, sense * rate
        for k in range(m.TOUCH.normal_force, m.TOUCH.size):
            w[o + k] = 0.0
        w[o + m.TOUCH.offset] = f[numbers + m.CONTACT_NUMBERS.clearance] - gap
        if n[n[m.MODE] + c] == 1:
            size = -sense * normal_force(h, f, w, c)
            put(w, o + m.TOUCH.force, scale(size, force))
            apply_wrench(h, w, m.CONTACTS.inner(h, c), scale(size, moment), scale(size, force))
            apply_wrench(h, w, m.CONTACTS.outer(h, c), scale(-size, moment), scale(-size, force))

    @kernel
    def stops(h, f, w, n):
        for c in range(h[m.N_SURFACES], h[m.N_CONTACTS]):
            stop(h, f, w, n, c)

    return stops
