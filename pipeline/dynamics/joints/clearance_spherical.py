"""Ball in a socket with clearance: geometry of the contact, force laws by their kinds.

gap = c - |p_SB|; depth d = -gap; d' = n . (v_ball - v_socket), n from the socket's centre to the
ball's. Both forces act at one point Q on the line of centres, on the ball's surface
(Wang & Wang 2019, eq. 23); the sliding velocity is that of the material points there, so that
rolling is no sliding. Acting at one point keeps angular momentum.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics.tables import (
    AXES,
    BALL,
    BALL_RADIUS,
    CLEARANCE,
    CONTACT_LOSS,
    CONTACT_NUMBERS,
    DAMPING_POWER,
    FLEX_C0,
    FLOOR,
    FRICTION_KIND,
    FRICTION_LAW,
    FRICTION_POWER,
    GAP,
    LATCHED,
    LEDGER_RATE,
    MODAL_BIAS,
    MODE,
    N_CONTACTS,
    N_MODES,
    NORMAL_FORCE,
    NORMAL_KIND,
    NORMAL_LAW,
    OMEGA,
    ORIGIN,
    PORT_COLUMN,
    PORT_FLEX,
    RATE,
    SOCKET,
    STORED,
    TOUCH_FORCE,
    TOUCH_OFFSET,
    TOUCH_POINT,
    VELOCITY,
    column,
    contact,
    flex,
    port,
    site_frame,
    site_link,
    site_port,
    touch,
    wrench,
)
from pipeline.dynamics.vectors import accumulate, add, at, at9, cross, dot, kernel, put, scale, sub, turn_back

NUMBERS = 11  # fields of CONTACT_NUMBERS


@kernel
def measure(h, f, w, c):
    """Gap, rate and offset of contact c from the sites of socket and ball, no force; returns the normal."""
    socket, ball, o = site_frame(h, contact(h, c, SOCKET)), site_frame(h, contact(h, c, BALL)), touch(h, c)
    p_SB = sub(at(w, ball + ORIGIN), at(w, socket + ORIGIN))
    v_SB = sub(at(w, ball + VELOCITY), at(w, socket + VELOCITY))
    distance = np.sqrt(dot(p_SB, p_SB))
    # a concentric ball has no normal; any does, since there is no force
    normal = scale(1.0 / distance, p_SB) if distance > 0.0 else (0.0, 0.0, 1.0)
    w[o + GAP] = f[h[CONTACT_NUMBERS] + NUMBERS * c + CLEARANCE] - distance
    w[o + RATE] = dot(normal, v_SB)
    for k in (NORMAL_FORCE, FRICTION_POWER, DAMPING_POWER, STORED):
        w[o + k] = 0.0
    put(w, o + TOUCH_FORCE, (0.0, 0.0, 0.0))
    put(w, o + TOUCH_OFFSET, turn_back(at9(w, socket + AXES), p_SB))
    return normal


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
    """Four parameters of a law."""
    return (f[o], f[o + 1], f[o + 2], f[o + 3])


def compose(normal: Callable, stored: Callable, friction: Callable) -> Callable:
    """The kernel that applies all contacts; normal(kind, ...), stored(kind, ...), friction(kind, ...)."""

    @kernel
    def forces(h, f, w, c, normal_axis):
        """Forces of a closed contact, on ball and socket, and their powers."""
        o, numbers = touch(h, c), h[CONTACT_NUMBERS] + NUMBERS * c
        depth, rate = max(0.0, -w[o + GAP]), w[o + RATE]
        law, kind = _law(f, numbers + NORMAL_LAW), contact(h, c, NORMAL_KIND)
        impact_rate = max(w[h[LATCHED] + c], f[numbers + FLOOR])
        f_n = normal(kind, depth, rate, impact_rate, law)
        w[o + NORMAL_FORCE], w[o + STORED] = f_n, stored(kind, depth, law)
        w[o + DAMPING_POWER] = (f_n - normal(kind, depth, 0.0, impact_rate, law)) * rate
        s, b = contact(h, c, SOCKET), contact(h, c, BALL)
        socket, ball = site_frame(h, s), site_frame(h, b)
        p_WQ = add(at(w, ball + ORIGIN), scale(f[numbers + BALL_RADIUS], normal_axis))
        slip = sub(point_velocity(w, ball, p_WQ), point_velocity(w, socket, p_WQ))
        slip = sub(slip, scale(dot(normal_axis, slip), normal_axis))
        speed = np.sqrt(dot(slip, slip))
        force = scale(-f_n, normal_axis)
        if speed > 0.0:
            f_t = f_n * friction(contact(h, c, FRICTION_KIND), speed, _law(f, numbers + FRICTION_LAW))
            force = sub(force, scale(f_t / speed, slip))
            w[o + FRICTION_POWER] = -f_t * speed
        put(w, o + TOUCH_FORCE, force)
        put(w, o + TOUCH_POINT, p_WQ)
        loss = h[LEDGER_RATE] + CONTACT_LOSS + 2 * c
        w[loss], w[loss + 1] = w[o + DAMPING_POWER], -w[o + FRICTION_POWER]
        push(h, w, b, p_WQ, force)
        push(h, w, s, p_WQ, scale(-1.0, force))

    @kernel
    def contacts(h, f, w, n):
        for c in range(h[N_CONTACTS]):
            normal_axis = measure(h, f, w, c)
            if n[n[MODE] + c] == 1:
                forces(h, f, w, c, normal_axis)

    return contacts


class ClearanceSpherical:
    """See the module's text."""

    compose = staticmethod(compose)
