r"""The interface basis of a flexible body: where the equations have its modes, while the state has eigenmodes.

Most combinations of many modes move none of the frames by which a body is held and loaded. With an orthogonal T,
:math:`q = T\,p`, the coordinates p come in two kinds: first those of held shapes, which leave every such frame at rest,
then those of the few moving shapes. Modal masses are one, so that T leaves them so, and held shapes share no entry of
the mass matrix with each other nor with what the body carries: eliminated first, they cost as much as there are of
them. An orthogonal change of coordinates loses no digits, however heavy what is carried.

The state keeps eigenmodes, whose stiffness and damping are diagonal. Forces and momenta are taken to the interface
basis after they have been found, accelerations back from there.

Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319 (held shapes are fixed-interface modes).
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, add, scale


@kernel
def in_interface(h, f, w, k, source, out):
    """T^T of body k: what w holds of each mode from `source` on, of each shape from `out` on."""
    e, end = m.FLEXES.basis0(h, k), m.FLEXES.basis0(h, k) + m.FLEXES.n_basis(h, k)
    for j in range(m.FLEXES.n_modes(h, k)):
        total = 0.0
        while e < end and m.BASIS.shape(h, e) == j:
            total += f[m.BASIS_VALUES.row(h, e)] * w[source + m.BASIS.mode(h, e)]
            e += 1
        w[out + j] = total


@kernel
def all_in_interface(h, f, w, k, source, out, more):
    """The same of four times as much: what stands from `source` on goes to `out`, the three after it from `more` on."""
    n, e, end = m.FLEXES.n_modes(h, k), m.FLEXES.basis0(h, k), m.FLEXES.basis0(h, k) + m.FLEXES.n_basis(h, k)
    for j in range(n):
        total, rest = 0.0, ZERO
        while e < end and m.BASIS.shape(h, e) == j:
            value, i = f[m.BASIS_VALUES.row(h, e)], source + m.BASIS.mode(h, e)
            total += value * w[i]
            rest = add(rest, scale(value, (w[i + n], w[i + 2 * n], w[i + 3 * n])))
            e += 1
        w[out + j], w[more + j], w[more + n + j], w[more + 2 * n + j] = total, rest[0], rest[1], rest[2]


@kernel
def in_modes(h, f, w, k, source, out):
    """T of body k: what w holds of each shape from `source` on, of each mode from `out` on."""
    for i in range(m.FLEXES.n_modes(h, k)):
        w[out + i] = 0.0
    first = m.FLEXES.basis0(h, k)
    for e in range(first, first + m.FLEXES.n_basis(h, k)):
        w[out + m.BASIS.mode(h, e)] += f[m.BASIS_VALUES.row(h, e)] * w[source + m.BASIS.shape(h, e)]


@kernel
def deform(h, f, w):
    """Coordinates of the moving shapes and their rates, INTERFACE_X and INTERFACE_U, from X and U."""
    for k in range(h[m.N_FLEX]):
        c0, x, u = m.FLEXES.c0(h, k), h[m.X] + m.FLEXES.q0(h, k), h[m.U] + m.FLEXES.c0(h, k)
        e, end = m.FLEXES.moving0(h, k), m.FLEXES.basis0(h, k) + m.FLEXES.n_basis(h, k)
        for j in range(m.FLEXES.n_held(h, k), m.FLEXES.n_modes(h, k)):
            place = rate = 0.0
            while e < end and m.BASIS.shape(h, e) == j:
                value, i = f[m.BASIS_VALUES.row(h, e)], m.BASIS.mode(h, e)
                place += value * w[x + i]
                rate += value * w[u + i]
                e += 1
            w[h[m.INTERFACE_X] + c0 + j], w[h[m.INTERFACE_U] + c0 + j] = place, rate


@kernel
def to_interface(h, f, w, b):
    """What w holds of each coordinate from place b on, modes as eigenmodes: now in the interface basis."""
    for k in range(h[m.N_FLEX]):
        place = b + m.FLEXES.c0(h, k)
        in_interface(h, f, w, k, place, h[m.MODAL])
        for j in range(m.FLEXES.n_modes(h, k)):
            w[place + j] = w[h[m.MODAL] + j]


@kernel
def to_modes(h, f, w, b):
    """What w holds of each coordinate from place b on, modes in the interface basis: now as eigenmodes."""
    for k in range(h[m.N_FLEX]):
        place = b + m.FLEXES.c0(h, k)
        in_modes(h, f, w, k, place, h[m.MODAL])
        for j in range(m.FLEXES.n_modes(h, k)):
            w[place + j] = w[h[m.MODAL] + j]


@kernel
def modal_rates(h, f, w, dy):
    """Accelerations of the eigenmodes into the rates dy of the state, from DU."""
    for k in range(h[m.N_FLEX]):
        c0 = m.FLEXES.c0(h, k)
        in_modes(h, f, w, k, h[m.DU] + c0, dy + h[m.NQ] + c0)
