"""Closed contacts as springs between two links, linearised in the present state.

A contact that has closed pushes along its force with a stiffness and a damping. What an integration method needs of it
is the row J that gives the rate of its depth from the speeds, which is also what a unit force does to the coordinates;
and the row that gives the change of its depth from that of the positions. Both are taken along the force as it is,
friction included: to friction's share only they differ from those of the depth. Stops are left out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.interface import to_modes
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import at, cross, dot, dot6, put, scale

#: wrench, and damping per elastic force [s/m], of a spring
WRENCH, LOSS, FIXED = 0, 6, 7
#: rates below this share of the impact rate do not tell the damping
RESTING = 1e-3
#: largest change of a coordinate by which the positions' rates are asked for
A_LITTLE = 1e-9


def floats(h: np.ndarray) -> int:
    """Floats of the work space that springs take."""
    return int(3 * h[m.NQ] + h[m.NV] + h[m.N_SURFACES] * (FIXED + h[m.NQ] + h[m.NV] + h[m.N_DRIVES]))


@kernel
def measure(h, o):
    """Where w holds, for each position, its entry of N^T N."""
    return o


@kernel
def scratch(h, o):
    """Where w holds a displacement, then the positions that it leads to and their change."""
    return o + h[m.NQ]


@kernel
def spring(h, o, c):
    """Where w holds what contact c is as a spring."""
    size = FIXED + h[m.NQ] + h[m.NV] + h[m.N_DRIVES]
    return o + 3 * h[m.NQ] + h[m.NV] + size * c


@kernel
def gradient(h, o, c):
    """Where w holds the depth of contact c per position."""
    return spring(h, o, c) + FIXED


@kernel
def row(h, o, c):
    """Where w holds the rate of its depth per speed, those of the drives last; modes as eigenmodes."""
    return gradient(h, o, c) + h[m.NQ]


@kernel
def reaches(h, w, s, sign, wrench, out):
    """Add to w from `out` on what a wrench on the link of site s does on each coordinate; modes as shapes."""
    i, port = m.SITES.link(h, s), m.SITES.port(h, s)
    while i != 0:
        if port >= 0:
            k = m.PORTS.flex(h, port)
            held, first = m.FLEXES.n_held(h, k), m.PORTS.column(h, port)
            for j in range(m.FLEXES.n_modes(h, k) - held):
                w[out + m.FLEXES.c0(h, k) + held + j] += sign * dot6(w, wrench, w, m.COLUMNS.row(h, first + j))
        for c in range(m.LINKS.c0(h, i), m.LINKS.c0(h, i) + m.LINKS.n_speeds(h, i)):
            w[out + c] += sign * dot6(w, wrench, w, m.COLUMNS.row(h, c))
        port = m.LINKS.carried_by(h, i)
        i = m.LINKS.parent(h, i)


@kernel
def stiffen(h, f, w, n, o, c):
    """Stiffness of contact c and its damping per stiffness [s], of the state just evaluated; 0 where it bears nothing.

    Every form of normal forces has a coefficient and an exponent as its first numbers. The damping follows from its
    power; where the surfaces rest, from what it was before.
    """
    touch, numbers, place = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c), spring(h, o, c)
    law, depth, rate = numbers + m.CONTACT_NUMBERS.normal_law, -w[touch + m.TOUCH.gap], w[touch + m.TOUCH.rate]
    if n[n[m.MODE] + c] != 1 or not (w[touch + m.TOUCH.normal_force] > 0.0 and depth > 0.0):
        w[place + LOSS] = 0.0
        return 0.0, 0.0
    elastic = f[law] * depth ** f[law + 1]
    stiffness = f[law + 1] * elastic / depth
    if abs(rate) > RESTING * max(w[h[m.LATCHED] + c], f[numbers + m.CONTACT_NUMBERS.floor]):
        w[place + LOSS] = max(w[touch + m.TOUCH.damping_power], 0.0) / (rate * rate * elastic)
    return stiffness, w[place + LOSS] * elastic / stiffness


@kernel
def find_row(h, f, w, o, c):
    """The row of contact c, which pushes."""
    touch, wrench, out = m.TOUCH.row(h, c), spring(h, o, c) + WRENCH, row(h, o, c)
    force = at(w, touch + m.TOUCH.force)
    direction = scale(-1.0 / np.sqrt(dot(force, force)), force)
    put(w, wrench, cross(at(w, touch + m.TOUCH.point), direction))
    put(w, wrench + 3, direction)
    for k in range(h[m.NV] + h[m.N_DRIVES]):
        w[out + k] = 0.0
    reaches(h, w, m.CONTACTS.inner(h, c), 1.0, wrench, out)
    reaches(h, w, m.CONTACTS.outer(h, c), -1.0, wrench, out)
    to_modes(h, f, w, out)


@kernel
def direct_power(h, w, o, c, motion):
    """Power that drives bring in against a unit force of contact c; motion: U, or DU for the rate at which it grows."""
    power, known = 0.0, row(h, o, c) + h[m.NV]
    for d in range(h[m.N_DRIVES]):
        power -= w[known + d] * w[motion + h[m.NV] + d]
    return power


@kernel
def change(h, w, o, c, state):
    """Of what w holds for each variable from place `state` on: of the depth by positions, and by speeds."""
    nq, depth, rate = h[m.NQ], 0.0, 0.0
    by_position, by_speed = gradient(h, o, c), row(h, o, c)
    for k in range(nq):
        depth += w[by_position + k] * w[state + k]
    for k in range(h[m.NV]):
        rate += w[by_speed + k] * w[state + nq + k]
    return depth, rate


def make_gradients(retract: Callable) -> tuple[Callable, Callable]:
    """The kernels find_measures(h, w, o, state) and find_gradient(h, w, o, c, state); needs `find_row`.

    Rates of positions are qdot = N u with N^T N diagonal, 1 or, of the four numbers of a quaternion, 1/4; the change of
    a depth J du is m^T dq with m = N (N^T N)^-1 J^T.
    """

    @kernel
    def rates(h, w, o, state, longest):
        """Positions' rates at the displacement in the scratch, whose largest entry is given, made small."""
        place = scratch(h, o)
        for k in range(h[m.NV]):
            w[place + k] *= A_LITTLE / longest
        retract(h, w, state, place, place + h[m.NV], place + h[m.NV] + h[m.NQ])
        for k in range(h[m.NQ]):
            w[place + h[m.NV] + h[m.NQ] + k] *= longest / A_LITTLE

    @kernel
    def find_measures(h, w, o, state):
        """N^T N of all positions, from what the first speed of each link does."""
        place, total = scratch(h, o), scratch(h, o) + h[m.NV] + h[m.NQ]
        for k in range(h[m.NQ]):
            w[measure(h, o) + k] = 1.0
        for i in range(1, h[m.N_LINKS]):
            c0, q0, size = m.LINKS.c0(h, i), m.LINKS.q0(h, i), 0.0
            if c0 >= h[m.NV] or m.LINKS.n_speeds(h, i) < 3:
                continue
            for k in range(h[m.NV]):
                w[place + k] = 0.0
            w[place + c0] = 1.0
            rates(h, w, o, state, 1.0)
            for k in range(h[m.NQ]):
                size += w[total + k] * w[total + k]
            if size < 0.5:
                for k in range(4):
                    w[measure(h, o) + q0 + k] = 0.25

    @kernel
    def find_gradient(h, w, o, c, state):
        """The gradient of contact c over the positions."""
        place, total, longest = scratch(h, o), scratch(h, o) + h[m.NV] + h[m.NQ], 0.0
        for k in range(h[m.NV]):
            w[place + k] = w[row(h, o, c) + k]
            longest = max(longest, abs(w[place + k]))
        if longest > 0.0:
            rates(h, w, o, state, longest)
        for k in range(h[m.NQ]):
            w[gradient(h, o, c) + k] = w[total + k] / w[measure(h, o) + k] if longest > 0.0 else 0.0

    return find_measures, find_gradient
