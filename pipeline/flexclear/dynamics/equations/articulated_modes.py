"""The modes of flexible links in the elimination along the tree (`equations.articulated`).

They precede the coordinates of the link's joint. Together with the twist of its joint's frame they have the inertia
:math:`(I, P; P^T, m)`. Each link that the body carries adds its inertia, transformed by the columns of its port. The
block m has its own factor, m = ll^T in its envelope, and :math:`K = P l^{-T}`. Shapes with held interfaces move no
port; no closure and no link beyond contributes to them.
"""

from __future__ import annotations

from flexclear.dynamics.bodies.ports import moving
from flexclear.dynamics.equations import envelope
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    add9,
    add_wrench,
    at,
    dot,
    put,
    scale,
    sub,
    turn,
    turn_back,
    turn_symmetric,
)


@kernel
def outer(s, a, b):
    """Return the matrix s a b^T."""
    x, y, z = scale(s, a)
    return (x * b[0], x * b[1], x * b[2], y * b[0], y * b[1], y * b[2], z * b[0], z * b[1], z * b[2])


@kernel
def begin_modes(d):
    """Initialise the forces on the modes and the momenta of their rates, before carried links add theirs."""
    for f in range(d.n_flex):
        body = d.flexes[f]
        for k in range(body.c0, body.c0 + body.n_modes):
            gain, momentum = d.gain[k], d.momenta[k]
            d.force[k], gain.moment, gain.force = -d.modal_bias[k], momentum.angular, momentum.linear


@kernel
def load_modes(d, p, A, B, C):
    """Add the inertia (A B; B^T C) that port p carries, about the link's origin, to that of the shapes that move it."""
    port = d.ports[p]
    n, c = moving(d.flexes[port.flex])
    for j in range(n):
        local, gain, row = d.local[port.column + j], d.gain[c + j], d.envelope[c + j].origin + c
        moment = add(turn_symmetric(A, local.angular), turn(B, local.linear))
        force = add(turn_back(B, local.angular), turn_symmetric(C, local.linear))
        add_wrench(gain, moment, force)
        for k in range(j + 1):
            other = d.local[port.column + k]
            d.mass[row + k] += dot(other.angular, moment) + dot(other.linear, force)


@kernel
def push_modes(d, p, b, moment, force):
    """Subtract a wrench through port p, about the link's origin, from the forces on its modes in w from index b."""
    port = d.ports[p]
    n, c = moving(d.flexes[port.flex])
    for j in range(n):
        local = d.local[port.column + j]
        d.w[b + c + j] -= dot(local.angular, moment) + dot(local.linear, force)


@kernel
def forward_modes(d, f, b, moment, force):
    """Apply L^-1 to the forces on the modes of body f in w from index b; return the carried wrench with theirs."""
    body = d.flexes[f]
    begin, end = body.c0, body.c0 + body.n_modes
    envelope.forward(d.h, d.at_envelope, d.w, d.at_mass, begin, end, b)
    for k in range(begin, end):
        gain, value = d.gain[k], d.w[b + k]
        moment, force = add(moment, scale(value, gain.moment)), add(force, scale(value, gain.force))
    return moment, force


@kernel
def factor_modes(d, f, least):
    """Factorise the modal block of body f, and K of its modes; return True when pivots are large enough."""
    body = d.flexes[f]
    begin, end = body.c0, body.c0 + body.n_modes
    sound = envelope.factor(d.h, d.at_envelope, d.w, d.at_mass, begin, end, least)
    for k in range(begin, end):
        row, gain = d.envelope[k], d.gain[k]
        moment, force = gain.moment, gain.force
        for j in range(row.first, k):
            before, value = d.gain[j], -d.mass[row.origin + j]
            moment, force = add(moment, scale(value, before.moment)), add(force, scale(value, before.force))
        inverse = d.mass[row.origin + k]
        gain.moment, gain.force = scale(inverse, moment), scale(inverse, force)
    return sound


@kernel
def backward_modes(d, f, b, angular, linear):
    """Apply L^-T to the modes of body f in w from index b, for given accelerations of its joint's frame."""
    begin, end = d.flexes[f].c0, d.flexes[f].c0 + d.flexes[f].n_modes
    for k in range(begin, end):
        d.w[b + k] -= dot(d.gain[k].moment, angular) + dot(d.gain[k].force, linear)
    envelope.backward(d.h, d.at_envelope, d.w, d.at_mass, begin, end, b)


@kernel
def at_port(d, p, b, angular, linear):
    """Return a link's acceleration at port p, with the part of its shapes' accelerations in w from index b."""
    port = d.ports[p]
    n, c = moving(d.flexes[port.flex])
    for j in range(n):
        local, value = d.local[port.column + j], d.w[b + c + j]
        angular, linear = add(angular, scale(value, local.angular)), add(linear, scale(value, local.linear))
    return angular, linear


@kernel
def deforming(d, f, b, angular, linear):
    """Return the acceleration of body f's frame from that of its joint's frame and its modes' in w from index b, and
    the wrench that its deformation needs."""
    body, moment, force = d.flexes[f], ZERO, ZERO
    for k in range(body.c0, body.c0 + body.n_modes):
        value, momentum = d.w[b + k], d.momenta[k]
        turning, pushing = momentum.angular, momentum.linear
        if body.inboard:
            turning, pushing = d.deformation[k].angular, d.deformation[k].linear
            if k >= body.c0 + body.n_held:
                local = d.local[k]
                angular, linear = add(angular, scale(value, local.angular)), add(linear, scale(value, local.linear))
        moment, force = add(moment, scale(value, turning)), add(force, scale(value, pushing))
    return angular, linear, moment, force


@kernel
def begin_shapes(d, path, start):
    """Initialise three rows of J^T for the shapes of a link on a closure's path to the ground."""
    n, _ = moving(d.flexes[d.links[path.link].flex])
    for place in range(start + 3 * path.shapes, start + 3 * (path.shapes + n)):
        d.spread[place] = d.jacobian[place]


@kernel
def spread_shapes(d, path, start, moments, forces):
    """Compute L^-1 J^T of three rows for these shapes; return the wrenches that the link transmits."""
    n, c = moving(d.flexes[d.links[path.link].flex])
    first = start + 3 * path.shapes
    for j in range(n):
        gain, row, values = d.gain[c + j], d.envelope[c + j], at(d.spread, first + 3 * j)
        for k in range(max(row.first - c, 0), j):
            values = sub(values, scale(d.mass[row.origin + c + k], at(d.spread, first + 3 * k)))
        values = scale(d.mass[row.origin + c + j], values)
        put(d.spread, first + 3 * j, values)
        moments, forces = add9(moments, outer(1.0, gain.moment, values)), add9(forces, outer(1.0, gain.force, values))
    return moments, forces


@kernel
def push_shapes(d, p, first, moments, forces):
    """Subtract the wrenches through port p, about the link's origin, from three rows for its shapes from `first` on."""
    port = d.ports[p]
    n, _ = moving(d.flexes[port.flex])
    for j in range(n):
        local, place = d.local[port.column + j], first + 3 * j
        against = add(turn_back(moments, local.angular), turn_back(forces, local.linear))
        put(d.spread, place, sub(at(d.spread, place), against))
