"""Forces of the contacts: geometry of two nested surfaces, laws by their kinds.

gap = c - |p_OI|, with p_OI from the centre of the outer surface (socket, journal) to that of the
inner one (ball, pin), where the surfaces part (a slot and a plane measure the gap otherwise, see
`joints`); depth d = -gap; d' = n . (velocity of the inner centre as seen from the outer body), n
along p_OI. Both forces act at one point Q on the line of centres, on the inner surface (Wang & Wang
2019, eq. 23); the sliding velocity is that of the material points there, so that rolling is no
sliding. Acting at one point keeps angular momentum.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.rigid import apply_wrench
from flexclear.pipeline.dynamics.choice import choose
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import add, at, at9, cross, dot, put, scale, sub, turn, turn_back


@kernel
def contact_slots(h, c):
    """Where w holds the rates of contact c's slots in the ledger."""
    return h[m.LEDGER_RATE] + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * c


@kernel
def push(h, w, s, point, force):
    """Apply a force [N] at a point, both world, on the link that carries site s."""
    apply_wrench(h, w, s, cross(point, force), force)


@kernel
def point_velocity(w, frame, point):
    """Velocity of the material point of a frame's body that is at `point`."""
    arm = sub(point, at(w, frame + m.FRAME.origin))
    return add(at(w, frame + m.FRAME.velocity), cross(at(w, frame + m.FRAME.omega), arm))


@kernel
def _law(f, o):
    """Four numbers of a normal law."""
    return (f[o], f[o + 1], f[o + 2], f[o + 3])


@kernel
def _friction_law(f, o):
    """Six numbers of a friction law."""
    return (f[o], f[o + 1], f[o + 2], f[o + 3], f[o + 4], f[o + 5])


@kernel
def tangential(normal, v):
    """The part of v normal to `normal`."""
    return sub(v, scale(dot(normal, v), normal))


def frictionless() -> Callable:
    """The kernel `rub` of a scene without friction."""

    @kernel
    def rub(h, f, w, n, c, normal, turning, p_WQ, f_n):
        return (0.0, 0.0, 0.0)

    return rub


def rubbing(traction: Callable) -> Callable:
    """The kernel rub(..., normal, turning, p_WQ, f_n) -> friction on the inner body [N].

    traction(kind, z, slip, f_n, p): see `contact.friction`.
    turning: rate of the normal as seen from the outer body [1/s], world axes.
    """

    @kernel
    def bristle_rate(h, w, n, c, axes, normal, turning, z, z_rate):
        """Rate of the deflection z, which the outer body carries and which stays tangent to the surface."""
        place = m.CONTACTS.bristle(h, c)
        transported = sub(tangential(normal, z_rate), scale(dot(turning, z), normal))
        put(w, h[m.LEDGER_RATE] + place - h[m.NQ] - h[m.NV], turn_back(axes, transported))

    @kernel
    def rub(h, f, w, n, c, normal, turning, p_WQ, f_n):
        o, numbers, kind = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c), m.CONTACTS.friction(h, c)
        if kind < 0:
            return (0.0, 0.0, 0.0)
        outer, inner = m.SITE_FRAMES.row(h, m.CONTACTS.outer(h, c)), m.SITE_FRAMES.row(h, m.CONTACTS.inner(h, c))
        slip = tangential(normal, sub(point_velocity(w, inner, p_WQ), point_velocity(w, outer, p_WQ)))
        place, axes, z = m.CONTACTS.bristle(h, c), at9(w, outer + m.FRAME.axes), (0.0, 0.0, 0.0)
        if place >= 0:
            z = tangential(normal, turn(axes, at(w, n[m.STATE] + place)))
        force, loss, bent, z_rate = traction(
            kind, z, slip, f_n, _friction_law(f, numbers + m.CONTACT_NUMBERS.friction_law)
        )
        if place >= 0:
            bristle_rate(h, w, n, c, axes, normal, turning, z, z_rate)
        w[o + m.TOUCH.friction_power], w[o + m.TOUCH.bent], w[o + m.TOUCH.slip] = -loss, bent, np.sqrt(dot(slip, slip))
        w[contact_slots(h, c) + m.CONTACT_LEDGER.friction] = -dot(force, slip)
        return force

    return rub


def make_normal_force(forms: tuple[Any, ...]) -> Callable:
    """The kernel normal_force(h, f, w, c) -> normal force of a closed contact [N], from its gap and rate, booked.

    forms: of normal forces, with `force` and `stored`.
    """
    normal, stored = choose(tuple(form.force for form in forms)), choose(tuple(form.stored for form in forms))

    @kernel
    def normal_force(h, f, w, c):
        o, numbers = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c)
        depth, rate = max(0.0, -w[o + m.TOUCH.gap]), w[o + m.TOUCH.rate]
        law, kind = _law(f, numbers + m.CONTACT_NUMBERS.normal_law), m.CONTACTS.normal(h, c)
        impact_rate = max(w[h[m.LATCHED] + c], f[numbers + m.CONTACT_NUMBERS.floor])
        elastic, damping = normal(kind, depth, rate, impact_rate, law)
        f_n = max(0.0, elastic + damping)
        w[o + m.TOUCH.normal_force], w[o + m.TOUCH.stored] = f_n, stored(kind, depth, law)
        w[o + m.TOUCH.damping_power] = damping * rate
        slots = contact_slots(h, c)
        w[slots + m.CONTACT_LEDGER.damping], w[slots + m.CONTACT_LEDGER.impulse] = damping * rate, f_n
        return f_n

    return normal_force


def make_contacts(surfaces: tuple[Any, ...], forms: tuple[Any, ...], frictions: tuple[Any, ...]) -> Callable:
    """The kernel contacts(h, f, w, n) that applies all contacts, given the modules of their kinds.

    surfaces: with `separation`.  forms: of normal forces, with `force` and `stored`.  frictions: laws with `traction`.
    """
    separation = choose(tuple(kind.separation for kind in surfaces))
    normal_force = make_normal_force(forms)
    rub = rubbing(choose(tuple(law.traction for law in frictions))) if frictions else frictionless()

    @kernel
    def measure(h, f, w, c):
        """Gap, rate and offset of contact c, no force; returns the normal, its rate seen from the outer body."""
        outer, inner, o = (
            m.SITE_FRAMES.row(h, m.CONTACTS.outer(h, c)),
            m.SITE_FRAMES.row(h, m.CONTACTS.inner(h, c)),
            m.TOUCH.row(h, c),
        )
        p_OI = sub(at(w, inner + m.FRAME.origin), at(w, outer + m.FRAME.origin))
        v_OI = sub(
            sub(at(w, inner + m.FRAME.velocity), at(w, outer + m.FRAME.velocity)),
            cross(at(w, outer + m.FRAME.omega), p_OI),
        )
        kind, numbers = m.CONTACTS.surfaces(h, c), m.CONTACT_NUMBERS.row(h, c)
        gap, rate, axis, turning, offset = separation(kind, f, w, outer, numbers, p_OI, v_OI)
        w[o + m.TOUCH.gap], w[o + m.TOUCH.rate] = gap, rate
        for k in range(m.TOUCH.normal_force, m.TOUCH.offset):
            w[o + k] = 0.0
        put(w, o + m.TOUCH.offset, turn_back(at9(w, outer + m.FRAME.axes), offset))
        return axis, turning

    @kernel
    def forces(h, f, w, n, c, axis, turning):
        """Forces of a closed contact, on both bodies, and their powers."""
        o, numbers = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c)
        f_n = normal_force(h, f, w, c)
        outer, inner = m.CONTACTS.outer(h, c), m.CONTACTS.inner(h, c)
        p_WQ = add(
            at(w, m.SITE_FRAMES.row(h, inner) + m.FRAME.origin), scale(f[numbers + m.CONTACT_NUMBERS.radius], axis)
        )
        force = add(scale(-f_n, axis), rub(h, f, w, n, c, axis, turning, p_WQ, f_n))
        put(w, o + m.TOUCH.force, force)
        put(w, o + m.TOUCH.point, p_WQ)
        push(h, w, inner, p_WQ, force)
        push(h, w, outer, p_WQ, scale(-1.0, force))

    @kernel
    def contact(h, f, w, n, c):
        axis, turning = measure(h, f, w, c)
        if n[n[m.MODE] + c] == 1:
            forces(h, f, w, n, c, axis, turning)

    @kernel
    def contacts(h, f, w, n):
        for c in range(h[m.N_SURFACES]):
            contact(h, f, w, n, c)

    return contacts
