r"""Elimination along the tree by articulated inertias: linear cost, and rounding that does not grow with its depth.

From the leaves to the ground, each link has the inertia with which it resists while all links beyond it move freely.
Each coordinate is eliminated from it: with the column s of coordinate k and the inertia I,

.. math:: g = I s, \quad D_k = s\cdot g, \quad K_k = g/\sqrt{D_k}, \qquad I \leftarrow I - K_k K_k^T ,

and the rest is added to the parent's inertia. This is the Cholesky factor of the mass matrix, M = LL^T with
:math:`L_{jk} = s_j\cdot K_k` for k beyond j, without the matrix itself: summing the inertia of all that a coordinate
moves would lose the digits of M's condition number. All vectors of a link refer to its own origin.

The modes of a flexible link come before the coordinates of its joint (`equations.articulated_modes`).

Source: Rodriguez, Jain & Kreutz-Delgado (1991), International Journal of Robotics Research 10, 371-381 (innovations
factorisation); Featherstone (2008), *Rigid Body Dynamics Algorithms*, ch. 7.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics.bodies.rigid import FlexibleBodies
from flexclear.dynamics.equations import articulated_modes
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    add6,
    add9,
    at,
    at6,
    cross,
    dot,
    product,
    put,
    put6,
    scale,
    sub,
    turn,
    turn_back,
    turn_symmetric,
)

#: pivots at most this fraction of the largest that all inertia beyond could give in any pose mean a coordinate that
#: moves no mass; rounding leaves a few times 1e-16 of it
MASSLESS_ARTICULATED = 1e-14

NONE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def origin(d, i):
    """Return the reference point of link i's inertia: its own origin, since a distant point costs digits."""
    return ZERO


@kernel
def demand_of(d, i, moment, force):
    """Store the wrench that the accelerations of link i need; WRENCH then has all other wrenches on the link."""
    wrench, body = d.wrench[i], d.articulated[i]
    body.own_moment, body.own_force = moment, force
    wrench.moment, wrench.force = ZERO, ZERO


@kernel
def column(d, k):
    """Return angular and linear part of a column about the origin of its link."""
    return d.local[k].angular, d.local[k].linear


@kernel
def skewed(v):
    """Return the matrix of v x."""
    return (0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0)


@kernel
def outer_symmetric(s, a):
    """Return the matrix s a a^T as (xx, yy, zz, xy, xz, yz)."""
    x, y, z = scale(s, a)
    return (x * a[0], y * a[1], z * a[2], x * a[1], x * a[2], y * a[2])


@kernel
def less(a, b):
    """Return a - b of symmetric matrices of six entries."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5])


@kernel
def less9(a, b):
    """Return a - b of matrices of nine entries."""
    return (
        *(a[0] - b[0], a[1] - b[1], a[2] - b[2]),
        *(a[3] - b[3], a[4] - b[4], a[5] - b[5]),
        *(a[6] - b[6], a[7] - b[7], a[8] - b[8]),
    )


@kernel
def localise(d, k, angular, linear):
    """Store a column about the origin of its link."""
    d.local[k].angular, d.local[k].linear = angular, linear


@kernel
def localise_shape(d, k, base, angular, linear):
    """Store a shape's column about the origin of its link, with column `base` of the same shape unless that is -1."""
    local = d.local[k]
    local.angular, local.linear = angular, linear
    if base >= 0:
        local.angular, local.linear = add(d.local[base].angular, angular), add(d.local[base].linear, linear)


@kernel
def step(d, i, arm):
    """Store the vector from the origin of link i's parent to its own; a difference of positions would lose digits."""
    d.articulated[i].arm = arm


@kernel
def shift(d, i, arm):
    """Refer that vector and the joint's columns to link i's origin; arm: vector from there to the joint's frame."""
    link, body = d.links[i], d.articulated[i]
    body.arm = sub(body.arm, arm)
    for k in range(link.c0, link.c0 + link.n_speeds):
        local = d.local[k]
        local.linear = sub(local.linear, cross(local.angular, arm))


@kernel
def reduce(d, i):
    """Eliminate the modes of link i and the coordinates of its joint, and add the remaining inertia to its parent's.

    Stores the factor's part of each coordinate (MASS: 1/sqrt(D), GAIN: K) and L^-1 of minus the bias (FORCE).  Returns
    whether all pivots are sound.
    """
    link, own, body, p, sound = d.links[i], d.own[i], d.articulated[i], d.link_frames[i].origin, True
    mass, polar = d.link_numbers[i].borne, d.link_numbers[i].reaching
    A, B, C, wrench = (
        at6(own.inertia, 0),
        skewed(own.moment),
        (own.mass, own.mass, own.mass, 0.0, 0.0, 0.0),
        d.wrench[i],
    )
    M = add(body.own_moment, sub(wrench.moment, cross(p, wrench.force)))
    F = add(body.own_force, wrench.force)
    if link.leaf == 0:
        A, B, C = add6(A, at6(body.turning, 0)), add9(B, body.mixed), add6(C, at6(body.moving, 0))
        M, F = add(M, body.moment), add(F, body.force)
    if link.flex >= 0:
        sound = articulated_modes.factor_modes(d, link.flex, MASSLESS_ARTICULATED)
        M, F = articulated_modes.forward_modes(d, link.flex, d.at_force, M, F)
        first = d.flexes[link.flex].c0
        for k in range(first, first + d.flexes[link.flex].n_modes):
            gain = d.gain[k]
            A = less(A, outer_symmetric(1.0, gain.moment))
            B = less9(B, articulated_modes.outer(1.0, gain.moment, gain.force))
            C = less(C, outer_symmetric(1.0, gain.force))
    if link.c0 < d.nv:
        for k in range(link.c0, link.c0 + link.n_speeds):
            gain, angular, linear = d.gain[k], d.local[k].angular, d.local[k].linear
            moment = add(turn_symmetric(A, angular), turn(B, linear))
            force = add(turn_back(B, angular), turn_symmetric(C, linear))
            pivot = dot(angular, moment) + dot(linear, force)
            least = MASSLESS_ARTICULATED * (polar * dot(angular, angular) + mass * dot(linear, linear))
            sound = sound & (pivot > least)  # not so of NaN
            inverse = 1.0 / pivot
            root, rest = np.sqrt(inverse), -dot(angular, M) - dot(linear, F)
            d.mass[k], d.force[k] = root, root * rest
            gain.moment, gain.force = scale(root, moment), scale(root, force)
            M, F = add(M, scale(inverse * rest, moment)), add(F, scale(inverse * rest, force))
            A = less(A, outer_symmetric(inverse, moment))
            B = less9(B, articulated_modes.outer(inverse, moment, force))
            C = less(C, outer_symmetric(inverse, force))
    if link.parent > 0:
        # about the parent's origin, from which a leads to the link's
        a = body.arm
        x, y, z = cross(a, (B[0], B[1], B[2])), cross(a, (B[3], B[4], B[5])), cross(a, (B[6], B[7], B[8]))
        A = add6(A, (x[0], y[1], z[2], x[1], x[2], y[2]))
        x, y, z = cross(a, (C[0], C[3], C[4])), cross(a, (C[3], C[1], C[5])), cross(a, (C[4], C[5], C[2]))
        B = add9(B, (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]))
        x, y, z = cross(a, (B[0], B[1], B[2])), cross(a, (B[3], B[4], B[5])), cross(a, (B[6], B[7], B[8]))
        A = add6(A, (x[0], y[1], z[2], y[0], z[0], z[1]))
        M = add(M, cross(a, F))
        if link.carried_by >= 0:
            articulated_modes.load_modes(d, link.carried_by, A, B, C)
            articulated_modes.push_modes(d, link.carried_by, d.at_force, M, F)
        above = d.articulated[link.parent]
        if link.first == 0:
            A, B, C = add6(A, at6(above.turning, 0)), add9(B, above.mixed), add6(C, at6(above.moving, 0))
            M, F = add(M, above.moment), add(F, above.force)
        put6(above.turning, 0, A)
        above.mixed = B
        put6(above.moving, 0, C)
        above.moment, above.force = M, F
    return sound


@kernel
def forward(d, b):
    """Apply L^-1 to the generalised forces in w from index b."""
    for i in range(d.n_links - 1, 0, -1):
        link, body = d.links[i], d.articulated[i]
        moment, force = ZERO, ZERO
        if link.leaf == 0:
            moment, force = body.moment, body.force
        if link.flex >= 0:
            moment, force = articulated_modes.forward_modes(d, link.flex, b, moment, force)
        if link.c0 < d.nv:
            for k in range(link.c0, link.c0 + link.n_speeds):
                local, gain = d.local[k], d.gain[k]
                value = d.mass[k] * (d.w[b + k] - dot(local.angular, moment) - dot(local.linear, force))
                d.w[b + k] = value
                moment, force = add(moment, scale(value, gain.moment)), add(force, scale(value, gain.force))
        if link.parent > 0:
            above, moment = d.articulated[link.parent], add(moment, cross(body.arm, force))
            if link.carried_by >= 0:
                articulated_modes.push_modes(d, link.carried_by, b, moment, force)
            if link.first == 0:
                moment, force = add(moment, above.moment), add(force, above.force)
            above.moment, above.force = moment, force


@kernel
def carried(d, i, b):
    """Return the acceleration of link i with its parent, about its own origin, at those in w from index b."""
    link, angular, linear = d.links[i], ZERO, ZERO
    if link.parent > 0:
        above = d.articulated[link.parent]
        angular, linear = above.angular, above.linear
        if link.carried_by >= 0:
            angular, linear = articulated_modes.at_port(d, link.carried_by, b, angular, linear)
        linear = add(linear, cross(angular, d.articulated[i].arm))
    return angular, linear


@kernel
def backward(d, b):
    """Apply L^-T to the vector in w from index b; store the accelerations of all links, about their origins.

    Accelerations of flexible links are those of a rigid motion with the frame of their joint.
    """
    for i in range(1, d.n_links):
        link, body = d.links[i], d.articulated[i]
        angular, linear = carried(d, i, b)
        if link.c0 < d.nv:
            for k in range(link.c0 + link.n_speeds - 1, link.c0 - 1, -1):
                local, gain = d.local[k], d.gain[k]
                value = d.mass[k] * (d.w[b + k] - dot(gain.moment, angular) - dot(gain.force, linear))
                d.w[b + k] = value
                angular, linear = add(angular, scale(value, local.angular)), add(linear, scale(value, local.linear))
        if link.flex >= 0:
            articulated_modes.backward_modes(d, link.flex, b, angular, linear)
        body.angular, body.linear = angular, linear


@kernel
def spread(d, c):
    """Compute L^-1 J^T of closure c, stored like J^T: along the paths of its two sides to the ground."""
    closure = d.closures[c]
    for t in range(closure.threes):
        start = closure.jacobian0 + 3 * t * closure.n_support
        for e in range(closure.path0, closure.path0 + closure.n_path):
            path = d.paths[e]
            none = d.transmitted[path.link]
            none.moments, none.forces = NONE, NONE
            if path.shapes >= 0:
                articulated_modes.begin_shapes(d, path, start)
        for e in range(closure.path0, closure.path0 + closure.n_path):
            path = d.paths[e]
            link, moments, forces = (
                d.links[path.link],
                d.transmitted[path.link].moments,
                d.transmitted[path.link].forces,
            )
            if path.shapes >= 0:
                moments, forces = articulated_modes.spread_shapes(d, path, start, moments, forces)
            if path.slot >= 0:
                for k in range(link.n_speeds):
                    local, gain, place = d.local[link.c0 + k], d.gain[link.c0 + k], start + 3 * (path.slot + k)
                    against = add(turn_back(moments, local.angular), turn_back(forces, local.linear))
                    values = scale(d.mass[link.c0 + k], sub(at(d.jacobian, place), against))
                    put(d.spread, place, values)
                    moments = add9(moments, articulated_modes.outer(1.0, gain.moment, values))
                    forces = add9(forces, articulated_modes.outer(1.0, gain.force, values))
            if link.parent > 0:
                above, lever = d.transmitted[link.parent], product(skewed(d.articulated[path.link].arm), forces)
                moments = add9(moments, lever)
                above.moments = add9(above.moments, moments)
                above.forces = add9(above.forces, forces)
                if path.carrier >= 0:
                    articulated_modes.push_shapes(d, link.carried_by, start + 3 * path.carrier, moments, forces)


@kernel
def transmit(d, b, biased):
    """Compute the wrench that each link needs through its joint, about its origin, for accelerations at index b.

    biased: 1.0 includes applied forces and velocity-dependent terms, 0.0 takes the accelerations alone.
    """
    for i in range(1, d.n_links):
        link, body = d.links[i], d.articulated[i]
        angular, linear = carried(d, i, b)
        if link.c0 < d.nv:
            for k in range(link.c0, link.c0 + link.n_speeds):
                local = d.local[k]
                angular = add(angular, scale(d.w[b + k], local.angular))
                linear = add(linear, scale(d.w[b + k], local.linear))
        body.angular, body.linear = angular, linear
        own, wrench, p = d.own[i], d.wrench[i], d.link_frames[i].origin
        turning, pushing = ZERO, ZERO
        if link.flex >= 0:
            angular, linear, turning, pushing = articulated_modes.deforming(d, link.flex, b, angular, linear)
        moment = add(turn_symmetric(at6(own.inertia, 0), angular), cross(own.moment, linear))
        force = add(scale(own.mass, linear), cross(angular, own.moment))
        needed = add(body.own_moment, sub(wrench.moment, cross(p, wrench.force)))
        body.moment = add(add(moment, turning), scale(biased, needed))
        body.force = add(add(force, pushing), scale(biased, add(body.own_force, wrench.force)))
    for i in range(d.n_links - 1, 0, -1):
        link, body = d.links[i], d.articulated[i]
        if link.parent > 0:
            above = d.articulated[link.parent]
            above.moment = add(above.moment, add(body.moment, cross(body.arm, body.force)))
            above.force = add(above.force, body.force)


@kernel
def demand(d, j, b, biased):
    """Return the wrench through joint j with friction, about the kernels' origin; use after `transmit`."""
    i = d.rubbing[j].link
    moment, force = d.articulated[i].moment, d.articulated[i].force
    return add(moment, cross(d.link_frames[i].origin, force)), force


@kernel
def along(d, k, i):
    """Return the component along coordinate k of the wrench that link i's joint transmits."""
    local, body = d.local[k], d.articulated[i]
    return dot(local.angular, body.moment) + dot(local.linear, body.force)


@kernel
def drive_forces(d):
    """Compute the forces of the prescribed coordinates: wrenches through their joints at the accelerations in DU."""
    if d.n_drives == 0:
        return
    transmit(d, d.at_du, 1.0)
    for i in range(1, d.n_links):
        link = d.links[i]
        if link.c0 >= d.nv:
            for k in range(link.c0, link.c0 + link.n_speeds):
                d.drive_force[k - d.nv] = along(d, k, i)


def make_eliminate(flexible: FlexibleBodies) -> Callable:
    """Build the kernel eliminate(d): factor of the mass matrix, L^-1 of minus the bias (FORCE); True if regular."""

    @kernel
    def eliminate(d):
        sound = True
        articulated_modes.begin_modes(d)
        for i in range(d.n_links - 1, 0, -1):
            sound = reduce(d, i) & sound
        return sound

    return eliminate
