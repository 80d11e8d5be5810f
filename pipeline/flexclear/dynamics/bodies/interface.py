r"""The interface basis of a flexible body, in which the equations use its modes; the state keeps eigenmodes.

Most combinations of many modes move none of the frames where a body is held and loaded. With an orthogonal T,
:math:`q = T\,p`, the coordinates p come in two kinds: first those of held shapes, which leave every such frame at rest,
then those of the few moving shapes. T keeps the modal masses at one. The mass matrix does not couple held shapes
with each other nor with the bodies that the body carries: eliminated first, they cost in proportion to their
number. An orthogonal change of coordinates loses no digits, however heavy the carried bodies.

The state keeps eigenmodes, whose stiffness and damping are diagonal. Forces and momenta are taken to the interface
basis after their evaluation, accelerations back to eigenmodes.

Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319 (held shapes are fixed-interface modes).
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, scale


@kernel
def in_interface(d, k, source, out):
    """Apply T^T of body k: values of its modes in w, from `source` on, give values of its shapes, from `out` on."""
    body = d.flexes[k]
    e, end = body.basis0, body.basis0 + body.n_basis
    for j in range(body.n_modes):
        total = 0.0
        while e < end and d.basis[e].shape == j:
            total += d.basis_values[e].value * d.w[source + d.basis[e].mode]
            e += 1
        d.w[out + j] = total


@kernel
def all_in_interface(d, k, source, out, more):
    """Apply `in_interface` to four arrays: the first from `source` to `out`, the next three from there to `more`."""
    body = d.flexes[k]
    n, e, end = body.n_modes, body.basis0, body.basis0 + body.n_basis
    for j in range(n):
        total, rest = 0.0, ZERO
        while e < end and d.basis[e].shape == j:
            value, i = d.basis_values[e].value, source + d.basis[e].mode
            total += value * d.w[i]
            rest = add(rest, scale(value, (d.w[i + n], d.w[i + 2 * n], d.w[i + 3 * n])))
            e += 1
        d.w[out + j], d.w[more + j], d.w[more + n + j], d.w[more + 2 * n + j] = total, rest[0], rest[1], rest[2]


@kernel
def in_modes(d, k, source, out):
    """Apply T of body k: values of its shapes in w, from `source` on, give values of its modes, from `out` on."""
    body = d.flexes[k]
    for i in range(body.n_modes):
        d.w[out + i] = 0.0
    for e in range(body.basis0, body.basis0 + body.n_basis):
        entry = d.basis[e]
        d.w[out + entry.mode] += d.basis_values[e].value * d.w[source + entry.shape]


@kernel
def deform(d):
    """Compute INTERFACE_X and INTERFACE_U, coordinates and rates of the moving shapes, from X and U."""
    for k in range(d.n_flex):
        body = d.flexes[k]
        e, end = body.moving0, body.basis0 + body.n_basis
        for j in range(body.n_held, body.n_modes):
            place = rate = 0.0
            while e < end and d.basis[e].shape == j:
                value, i = d.basis_values[e].value, d.basis[e].mode
                place += value * d.x[body.q0 + i]
                rate += value * d.u[body.c0 + i]
                e += 1
            d.interface_x[body.c0 + j], d.interface_u[body.c0 + j] = place, rate


@kernel
def modal_rates(d, dy):
    """Store the accelerations of the eigenmodes, from DU, in the rates dy of the state."""
    for k in range(d.n_flex):
        c0 = d.flexes[k].c0
        in_modes(d, k, d.at_du + c0, dy + d.nq + c0)
