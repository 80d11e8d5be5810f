"""Elimination by the mass matrix itself: composite inertias give its entries, an envelope Cholesky its factor.

The composite rigid body algorithm (Featherstone, *Rigid Body Dynamics Algorithms*, ch. 6); for shallow trees, where it
takes fewer operations than articulated inertias do (`equations.articulated`).
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.bodies.rigid import FlexibleBodies, carry
from flexclear.dynamics.choice import nothing
from flexclear.dynamics.equations import envelope
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, at, at6, cross, dot, put, scale, sub, turn_symmetric


@kernel
def origin(d, i):
    """Return the origin of link i from the kernels' origin, to which its inertia refers."""
    return d.link_frames[i].origin


@kernel
def demand_of(d, i, moment, force):
    """Store the wrench that the accelerations of link i need, about the kernels' origin."""
    wrench = d.wrench[i]
    wrench.moment, wrench.force = moment, force


@kernel
def column(d, k):
    """Return angular and linear part of a column about the kernels' origin."""
    return d.columns[k].angular, d.columns[k].linear


# columns and positions about the kernels' origin suffice; `demand` uses momenta and wrenches summed towards the ground
localise = localise_shape = step = shift = transmit = nothing


@kernel
def copy_inertia(d):
    """Initialise the inertia of each link's subtree with its own; the links beyond add theirs later."""
    for i in range(d.n_links):
        tree, own = d.inertia[i], d.own[i]
        tree.mass, tree.moment = own.mass, own.moment
        for e in range(6):
            tree.inertia[e] = own.inertia[e]


@kernel
def gather(d, i):
    """Compute force and momentum of link i's coordinates, and add its subtree to its parent's."""
    link, wrench = d.links[i], d.wrench[i]
    for k in range(link.c0, link.c0 + link.n_speeds):
        carry(d, i, k)
        column = d.columns[k]
        d.bias[k] = dot(column.angular, wrench.moment) + dot(column.linear, wrench.force)
    above = d.wrench[link.parent]
    above.moment = add(above.moment, wrench.moment)
    above.force = add(above.force, wrench.force)
    tree, branch = d.inertia[link.parent], d.inertia[i]
    tree.mass += branch.mass
    tree.moment = add(tree.moment, branch.moment)
    for e in range(6):
        tree.inertia[e] += branch.inertia[e]


@kernel
def assemble_mass(d):
    """Assemble the mass matrix in its envelope, from momenta and columns."""
    for p in range(d.n_pairs):
        pair = d.pairs[p]
        momentum, column = d.momenta[pair.momentum], d.columns[pair.column]
        d.mass[pair.entry] += dot(momentum.angular, column.angular) + dot(momentum.linear, column.linear)


@kernel
def forward(d, b):
    """Apply L^-1 to the generalised forces in w from index b."""
    envelope.forward(d.h, d.at_envelope, d.w, d.at_mass, 0, d.nv, b)


@kernel
def backward(d, b):
    """Apply L^-T to the vector in w from index b."""
    envelope.backward(d.h, d.at_envelope, d.w, d.at_mass, 0, d.nv, b)


@kernel
def spread(d, c):
    """Compute L^-1 J^T of closure c, stored like J^T."""
    closure = d.closures[c]
    for t in range(closure.threes):
        start = closure.jacobian0 + 3 * t * closure.n_support
        for a in range(closure.n_support):
            i = d.support[closure.support0 + a].coordinate
            first, row, value = d.envelope[i].first, d.envelope[i].origin, at(d.jacobian, start + 3 * a)
            for b in range(a - 1, -1, -1):
                k = d.support[closure.support0 + b].coordinate
                if k < first:
                    break  # in increasing order
                value = sub(value, scale(d.mass[row + k], at(d.spread, start + 3 * b)))
            put(d.spread, start + 3 * a, scale(d.mass[row + i], value))


@kernel
def demand(d, j, b, biased):
    """Return the wrench through joint j with friction for accelerations in w from index b.

    biased: 1.0 includes applied forces and velocity-dependent terms, 0.0 takes the accelerations alone.
    """
    joint, moment, force, angular, linear = d.rubbing[j], ZERO, ZERO, ZERO, ZERO
    for k in range(joint.momentum0, joint.momentum0 + joint.n_momenta):
        momentum, size = d.momenta[d.reaction_terms[k].column], d.w[b + d.reaction_terms[k].coordinate]
        moment, force = add(moment, scale(size, momentum.angular)), add(force, scale(size, momentum.linear))
    for k in range(joint.column0, joint.column0 + joint.n_columns):
        column, size = d.columns[d.reaction_terms[k].column], d.w[b + d.reaction_terms[k].coordinate]
        angular, linear = add(angular, scale(size, column.angular)), add(linear, scale(size, column.linear))
    tree, wrench = d.inertia[joint.link], d.wrench[joint.link]
    turned = add(turn_symmetric(at6(tree.inertia, 0), angular), cross(tree.moment, linear))
    moved = add(scale(tree.mass, linear), cross(angular, tree.moment))
    moment, force = add(moment, turned), add(force, moved)
    return add(moment, scale(biased, wrench.moment)), add(force, scale(biased, wrench.force))


@kernel
def drive_forces(d):
    """Compute the forces of the prescribed coordinates: their rows of the equations of motion."""
    for k in range(d.n_drives):
        d.drive_force[k] = d.bias[d.nv + k]
    for p in range(d.n_known_pairs):
        pair = d.known_pairs[p]
        momentum, column = d.momenta[pair.momentum], d.columns[pair.column]
        inertia = dot(momentum.angular, column.angular) + dot(momentum.linear, column.linear)
        d.drive_force[pair.drive] += inertia * d.du[pair.coordinate]


@kernel
def drive_power(d, b, motion):
    """Return the drives' power at accelerations in w from index b; motion: index of the rates of all coordinates."""
    power = 0.0
    for p in range(d.n_known_pairs):
        pair = d.known_pairs[p]
        momentum, column = d.momenta[pair.momentum], d.columns[pair.column]
        inertia = dot(momentum.angular, column.angular) + dot(momentum.linear, column.linear)
        power += inertia * d.w[b + pair.coordinate] * d.w[motion + d.nv + pair.drive]
    return power


def make_again(flexible: FlexibleBodies) -> tuple[Callable, Callable]:
    """Build the kernels unfactor(d), which restores the mass matrix so that more can be added, and refactor(d)."""

    @kernel
    def unfactor(d):
        envelope.multiply(d.h, d.at_envelope, d.w, d.at_mass, d.nv)

    @kernel
    def refactor(d):
        envelope.factor(d.h, d.at_envelope, d.w, d.at_mass, 0, d.nv, 0.0)

    return unfactor, refactor


def make_eliminate(flexible: FlexibleBodies) -> Callable:
    """Build the kernel eliminate(d): factor of the mass matrix, L^-1 of minus the bias (FORCE); True if regular."""
    port_load, modal = flexible.port_load, flexible.modal_forces

    @kernel
    def eliminate(d):
        copy_inertia(d)
        for i in range(d.n_links - 1, 0, -1):
            port_load(d, i)
            gather(d, i)
        modal(d)
        assemble_mass(d)
        # 1e-15: pivots of M below this fraction of their diagonal mean a coordinate that moves no mass
        sound = envelope.factor(d.h, d.at_envelope, d.w, d.at_mass, 0, d.nv, 1e-15)
        for k in range(d.nv):
            d.force[k] = -d.bias[k]
        forward(d, d.at_force)
        return sound

    return eliminate
