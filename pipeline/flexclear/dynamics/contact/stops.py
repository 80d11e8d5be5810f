"""Stops: contacts at the ends of joint coordinates; their force, or torque, acts along the coordinate.

gap = sense (limit - coordinate), with full turns of angles counted; depth d = -gap; d' = sense times the rate. The
normal force of the law pushes the joint's second body back along the coordinate, and the first one by the opposite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.bodies.rigid import apply_between
from flexclear.dynamics.contact.forces import make_normal_force
from flexclear.dynamics.gauge import counted
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, scale


def make_stops(forms: tuple[Any, ...]) -> Callable:
    """Build the kernel stops(d) that applies all stops; forms: normal forces, with `force` and `stored`."""
    normal_force = make_normal_force(forms)

    @kernel
    def stop(d, c):
        """Store gap and rate of contact c, an end of a coordinate, and apply its force or torque when closed."""
        contact, numbers, touch = d.contacts[c], d.contact_numbers[c], d.touch[c]
        value, rate, moment, force = counted(d, contact.surfaces)
        limit, sense = numbers.shape[0], numbers.shape[1]
        gap = sense * (limit - value)
        touch.gap, touch.rate, touch.normal_force, touch.friction_power = gap, sense * rate, 0.0, 0.0
        touch.damping_power, touch.stored, touch.bent, touch.slip = 0.0, 0.0, 0.0, 0.0
        touch.force, touch.offset, touch.point = ZERO, (numbers.clearance - gap, 0.0, 0.0), ZERO
        if d.mode[c] == 1:
            size = -sense * normal_force(d, c)
            touch.force = scale(size, moment if d.gauges[contact.surfaces].turning else force)
            apply_between(d, contact.outer, contact.inner, scale(size, moment), scale(size, force))

    @kernel
    def stops(d):
        for c in range(d.n_surfaces, d.n_contacts):
            stop(d, c)

    return stops
