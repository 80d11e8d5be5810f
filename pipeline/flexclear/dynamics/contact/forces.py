"""Contact forces: geometry of two nested surfaces, with the laws that a scene uses.

gap = c - |p_OI|, with p_OI from the centre of the outer surface (socket, journal) to that of the inner one (ball, pin);
slots and planes measure the gap differently (see `surfaces`). Penetration d = -gap; its rate d' = n . (velocity of the
inner centre as seen from the outer body), n along p_OI. Both forces act at one point Q on the line of centres, on the
inner surface (Wang & Wang 2019, eq. 23). The sliding velocity is that of the material points at Q, so that rolling is
no sliding. A common point of action conserves angular momentum.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.bodies.rigid import apply_between
from flexclear.dynamics.choice import choose
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, at, at6, cross, dot, put, scale, sub, turn, turn_back


@kernel
def contact_slots(c):
    """Return the index in LEDGER_RATE of contact c's variables."""
    return m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * c


@kernel
def point_velocity(frame, point):
    """Return the velocity of the material point of a frame's body at `point`; Wang & Wang (2019), eqs. (23), (24)."""
    arm = sub(point, frame.origin)
    return add(frame.velocity, cross(frame.omega, arm))


@kernel
def tangential(normal, v):
    """Return the component of v across `normal`; Wang & Wang (2019), eqs. (23), (24)."""
    return sub(v, scale(dot(normal, v), normal))


@kernel
def frictionless(d, c, normal, turning, p_WQ, f_n):
    """Return no friction: the kernel `rub` of a scene without friction."""
    return ZERO


def rubbing(traction: Callable) -> Callable:
    """Build the kernel rub(d, c, normal, turning, p_WQ, f_n) -> friction on the inner body [N].

    traction(kind, z, slip, f_n, p): see `contact.friction`.
    turning: rate of the normal as seen from the outer body [1/s], world axes.
    """

    @kernel
    def bristle_rate(d, c, axes, normal, turning, z, z_rate):
        """Store the rate of the deflection z, which the outer body carries and which stays tangent to the surface."""
        transported = sub(tangential(normal, z_rate), scale(dot(turning, z), normal))
        put(d.ledger_rate, d.contacts[c].bristle - d.nq - d.nv, turn_back(axes, transported))

    @kernel
    def rub(d, c, normal, turning, p_WQ, f_n):
        contact, numbers, touch = d.contacts[c], d.contact_numbers[c], d.touch[c]
        if contact.friction < 0:
            return ZERO
        outer, inner = d.site_frames[contact.outer], d.site_frames[contact.inner]
        slip = tangential(normal, sub(point_velocity(inner, p_WQ), point_velocity(outer, p_WQ)))
        axes, z = outer.axes, ZERO
        if contact.bristle >= 0:
            z = tangential(normal, turn(axes, at(d.w, d.state + contact.bristle)))
        force, loss, bent, z_rate = traction(contact.friction, z, slip, f_n, at6(numbers.friction_law, 0))
        if contact.bristle >= 0:
            bristle_rate(d, c, axes, normal, turning, z, z_rate)
        touch.friction_power, touch.bent, touch.slip = -loss, bent, np.sqrt(dot(slip, slip))
        d.ledger_rate[contact_slots(c) + m.CONTACT_LEDGER.friction] = -dot(force, slip)
        return force

    return rub


def make_normal_force(forms: tuple[Any, ...]) -> Callable:
    """Build normal_force(d, c) -> normal force of a closed contact [N], from gap and rate; it also fills the ledger.

    forms: modules of normal forces, with `force` and `stored`.
    """
    normal, stored = choose(tuple(form.force for form in forms)), choose(tuple(form.stored for form in forms))

    @kernel
    def normal_force(d, c):
        contact, numbers, touch = d.contacts[c], d.contact_numbers[c], d.touch[c]
        depth, rate = max(0.0, -touch.gap), touch.rate
        elastic, damping = normal(contact.normal, depth, rate, max(d.latched[c], numbers.floor), numbers)
        f_n, slots = max(0.0, elastic + damping), contact_slots(c)
        touch.normal_force, touch.stored = f_n, stored(contact.normal, depth, numbers)
        touch.damping_power = damping * rate
        d.ledger_rate[slots + m.CONTACT_LEDGER.damping] = damping * rate
        d.ledger_rate[slots + m.CONTACT_LEDGER.impulse] = f_n
        return f_n

    return normal_force


def make_contacts(surfaces: tuple[Any, ...], forms: tuple[Any, ...], frictions: tuple[Any, ...]) -> Callable:
    """Build the kernel contacts(d) that applies all contacts, from the modules of their kinds.

    surfaces: with `separation`.  forms: normal forces, with `force` and `stored`.  frictions: laws with `traction`.
    """
    separation = choose(tuple(kind.separation for kind in surfaces))
    normal_force = make_normal_force(forms)
    rub = rubbing(choose(tuple(law.traction for law in frictions))) if frictions else frictionless

    @kernel
    def measure(d, c):
        """Store gap, rate and offset of contact c, no force; return the normal and its rate in the outer body."""
        contact, touch = d.contacts[c], d.touch[c]
        outer, inner = d.site_frames[contact.outer], d.site_frames[contact.inner]
        p_OI = sub(inner.origin, outer.origin)
        v_OI = sub(sub(inner.velocity, outer.velocity), cross(outer.omega, p_OI))
        gap, rate, axis, turning, offset = separation(contact.surfaces, outer.axes, d.contact_numbers[c], p_OI, v_OI)
        touch.gap, touch.rate, touch.normal_force, touch.friction_power = gap, rate, 0.0, 0.0
        touch.damping_power, touch.stored, touch.bent, touch.slip = 0.0, 0.0, 0.0, 0.0
        touch.force, touch.offset = ZERO, turn_back(outer.axes, offset)
        return axis, turning

    @kernel
    def forces(d, c, axis, turning):
        """Apply a closed contact's forces to both bodies, store their powers; Wang & Wang (2019), eqs. (23), (24)."""
        contact, touch = d.contacts[c], d.touch[c]
        f_n = normal_force(d, c)
        p_WQ = add(d.site_frames[contact.inner].origin, scale(d.contact_numbers[c].radius, axis))
        force = add(scale(-f_n, axis), rub(d, c, axis, turning, p_WQ, f_n))
        touch.force, touch.point = force, p_WQ
        apply_between(d, contact.outer, contact.inner, cross(p_WQ, force), force)

    @kernel
    def contact(d, c):
        axis, turning = measure(d, c)
        if d.mode[c] == 1:
            forces(d, c, axis, turning)

    @kernel
    def contacts(d):
        for c in range(d.n_surfaces):
            contact(d, c)

    return contacts
