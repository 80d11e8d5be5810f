"""Forces of the contacts: geometry of two nested surfaces, laws by their kinds.

gap = c - |p_OI|, with p_OI from the centre of the outer surface (socket, journal) to that of the
inner one (ball, pin), where the surfaces part; depth d = -gap; d' = n . (velocity of the inner
centre as seen from the outer body), n along p_OI. Both forces act at one point Q on the line of
centres, on the inner surface (Wang & Wang 2019, eq. 23); the sliding velocity is that of the
material points there, so that rolling is no sliding. Acting at one point keeps angular momentum.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics.tables import (
    AXES,
    BENT,
    BRISTLE,
    CLEARANCE,
    CONTACT_SLOTS,
    DAMPING_LOSS,
    DAMPING_POWER,
    FLEX_C0,
    FLOOR,
    FRICTION_KIND,
    FRICTION_LAW,
    FRICTION_LOSS,
    FRICTION_POWER,
    GAP,
    IMPULSE,
    INNER,
    LATCHED,
    LEDGER_RATE,
    MODAL_BIAS,
    MODE,
    N_CONTACTS,
    N_MODES,
    NORMAL_FORCE,
    NORMAL_KIND,
    NORMAL_LAW,
    NQ,
    NV,
    OMEGA,
    ORIGIN,
    OUTER,
    PER_CONTACT,
    PORT_COLUMN,
    PORT_FLEX,
    RADIUS,
    RATE,
    SLIP,
    STATE,
    STORED,
    SURFACES,
    TOUCH_FORCE,
    TOUCH_OFFSET,
    TOUCH_POINT,
    VELOCITY,
    column,
    contact,
    contact_numbers,
    flex,
    port,
    site_frame,
    site_link,
    site_port,
    touch,
    wrench,
)
from pipeline.dynamics.vectors import accumulate, add, at, at9, cross, dot, kernel, put, scale, sub, turn, turn_back


@kernel
def contact_slots(h, c):
    """Where w holds the rates of contact c's slots in the ledger."""
    return h[LEDGER_RATE] + CONTACT_SLOTS + PER_CONTACT * c


@kernel
def push(h, w, s, point, force):
    """Apply a force [N] at a point, both world, on the link (and its modes) that carries site s."""
    moment = cross(point, force)
    o = wrench(h, site_link(h, s))
    accumulate(w, o, scale(-1.0, moment))
    accumulate(w, o + 3, scale(-1.0, force))
    p = site_port(h, s)
    if p >= 0:
        k = port(h, p, PORT_FLEX)
        bias, first = h[MODAL_BIAS] + flex(h, k, FLEX_C0), port(h, p, PORT_COLUMN)
        for j in range(flex(h, k, N_MODES)):
            a = column(h, first + j)
            w[bias + j] -= dot(at(w, a), moment) + dot(at(w, a + 3), force)


@kernel
def point_velocity(w, frame, point):
    """Velocity of the material point of a frame's body that is at `point`."""
    arm = sub(point, at(w, frame + ORIGIN))
    return add(at(w, frame + VELOCITY), cross(at(w, frame + OMEGA), arm))


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
        place = contact(h, c, BRISTLE)
        transported = sub(tangential(normal, z_rate), scale(dot(turning, z), normal))
        put(w, h[LEDGER_RATE] + place - h[NQ] - h[NV], turn_back(axes, transported))

    @kernel
    def rub(h, f, w, n, c, normal, turning, p_WQ, f_n):
        o, numbers, kind = touch(h, c), contact_numbers(h, c), contact(h, c, FRICTION_KIND)
        if kind < 0:
            return (0.0, 0.0, 0.0)
        outer, inner = site_frame(h, contact(h, c, OUTER)), site_frame(h, contact(h, c, INNER))
        slip = tangential(normal, sub(point_velocity(w, inner, p_WQ), point_velocity(w, outer, p_WQ)))
        place, axes, z = contact(h, c, BRISTLE), at9(w, outer + AXES), (0.0, 0.0, 0.0)
        if place >= 0:
            z = tangential(normal, turn(axes, at(w, n[STATE] + place)))
        force, loss, bent, z_rate = traction(kind, z, slip, f_n, _friction_law(f, numbers + FRICTION_LAW))
        if place >= 0:
            bristle_rate(h, w, n, c, axes, normal, turning, z, z_rate)
        w[o + FRICTION_POWER], w[o + BENT], w[o + SLIP] = -loss, bent, np.sqrt(dot(slip, slip))
        w[contact_slots(h, c) + FRICTION_LOSS] = -dot(force, slip)
        return force

    return rub


def compose(separation: Callable, normal: Callable, stored: Callable, rub: Callable) -> Callable:
    """The kernel that applies all contacts; separation, normal and stored choose by a kind, their first argument."""

    @kernel
    def measure(h, f, w, c):
        """Gap, rate and offset of contact c, no force; returns the normal, its rate seen from the outer body."""
        outer, inner, o = site_frame(h, contact(h, c, OUTER)), site_frame(h, contact(h, c, INNER)), touch(h, c)
        p_OI = sub(at(w, inner + ORIGIN), at(w, outer + ORIGIN))
        v_OI = sub(sub(at(w, inner + VELOCITY), at(w, outer + VELOCITY)), cross(at(w, outer + OMEGA), p_OI))
        kind = contact(h, c, SURFACES)
        p, v = separation(kind, w, outer, p_OI), separation(kind, w, outer, v_OI)
        distance = np.sqrt(dot(p, p))
        # concentric surfaces have no normal; any does, since there is no force
        known = distance > 0.0
        axis = scale(1.0 / distance, p) if known else (0.0, 0.0, 1.0)
        rate = dot(axis, v)
        turning = scale(1.0 / distance, sub(v, scale(rate, axis))) if known else (0.0, 0.0, 0.0)
        w[o + GAP] = f[contact_numbers(h, c) + CLEARANCE] - distance
        w[o + RATE] = rate
        for k in range(NORMAL_FORCE, TOUCH_OFFSET):
            w[o + k] = 0.0
        put(w, o + TOUCH_OFFSET, turn_back(at9(w, outer + AXES), p_OI))
        return axis, turning

    @kernel
    def forces(h, f, w, n, c, axis, turning):
        """Forces of a closed contact, on both bodies, and their powers."""
        o, numbers = touch(h, c), contact_numbers(h, c)
        depth, rate = max(0.0, -w[o + GAP]), w[o + RATE]
        law, kind = _law(f, numbers + NORMAL_LAW), contact(h, c, NORMAL_KIND)
        impact_rate = max(w[h[LATCHED] + c], f[numbers + FLOOR])
        elastic, damping = normal(kind, depth, rate, impact_rate, law)
        f_n = max(0.0, elastic + damping)
        w[o + NORMAL_FORCE], w[o + STORED] = f_n, stored(kind, depth, law)
        w[o + DAMPING_POWER] = damping * rate
        slots = contact_slots(h, c)
        w[slots + DAMPING_LOSS], w[slots + IMPULSE] = damping * rate, f_n
        outer, inner = contact(h, c, OUTER), contact(h, c, INNER)
        p_WQ = add(at(w, site_frame(h, inner) + ORIGIN), scale(f[numbers + RADIUS], axis))
        force = add(scale(-f_n, axis), rub(h, f, w, n, c, axis, turning, p_WQ, f_n))
        put(w, o + TOUCH_FORCE, force)
        put(w, o + TOUCH_POINT, p_WQ)
        push(h, w, inner, p_WQ, force)
        push(h, w, outer, p_WQ, scale(-1.0, force))

    @kernel
    def contacts(h, f, w, n):
        for c in range(h[N_CONTACTS]):
            axis, turning = measure(h, f, w, c)
            if n[n[MODE] + c] == 1:
                forces(h, f, w, n, c, axis, turning)

    return contacts
