r"""A modally reduced body in the floating frame of reference, without neglected coupling terms.

A point is at ``r = X + S q`` in the body frame. All terms of the equations follow from two
families of vectors that are linear in the state, with the invariants of the bundle,

.. math:: P_{kl} = \int\rho\, r_k S_l = E_{kl} + F_{kl} q, \qquad V_{kl} = \int\rho\, \dot r_k S_l = F_{kl}\dot q

after Shabana, *Dynamics of Multibody Systems*, ch. 5, and Wang & Wang (2019), eqs. (9)-(15).
Where bending shortens the body, r also moves along x by a quadratic form of q (see `effects.stiffening.bodies`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from flexclear.dynamics.bodies.interface import all_in_interface, deform, modal_rates
from flexclear.dynamics.bodies.modal_terms import (
    RATE,
    make_carrying,
    modal_forces,
    of_mode,
    port_load,
    spatial,
    spin,
    stiffness,
    tensor,
)
from flexclear.dynamics.bodies.ports import make_ports
from flexclear.dynamics.bodies.rigid import FlexibleBodies
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    add_wrench,
    at9,
    congruence,
    cross,
    dot,
    scale,
    turn,
    turn_back,
    turn_symmetric,
)


@kernel
def straight(d, k, j, vector, first):
    """Return 0: shapes are linear, bending does not shorten the body."""
    return 0.0


LINEAR = SimpleNamespace(first_moment=straight, second_moment=straight, at_port=straight)


def of_each(body: Callable) -> Callable:
    """Return the kernel that applies body(d, k) to every flexible body k."""

    @kernel
    def bodies(d):
        for k in range(d.n_flex):
            body(d, k)

    return bodies


def flexible_bodies(shortening: Any = LINEAR) -> Callable[[Any], FlexibleBodies]:
    """Return the factory of the kernels of flexible bodies; its argument is the mass matrix module, `articulated` or
    `composite`. `shortening`: linear shapes, or those that bending shortens (`effects.stiffening.bodies`)."""
    return partial(_flexible_bodies, shortening)


def _flexible_bodies(shortening: Any, tree: Any) -> FlexibleBodies:
    first_moment, second_moment = shortening.first_moment, shortening.second_moment
    site, inboard = make_ports(shortening.at_port, tree)
    carried, body_mass_matrix = make_carrying(tree)
    reference, demand_of = tree.origin, tree.demand_of

    @kernel
    def invariants(d, k):
        """Fill MODAL with P (first 9 n) and V (next 9 n); row (3k + l) holds n values."""
        body = d.flexes[k]
        n, e = body.n_modes, body.moment0
        for row in range(9 * n):
            P_row, V_row, end = (
                d.flex_data[body.data0 + 3 * n + row].value,
                0.0,
                d.moment_rows[body.moment_row0 + row].end,
            )
            while e < end:
                i, F = d.moments[e].mode, d.moment_values[e].value
                P_row += F * d.x[body.q0 + i]
                V_row += F * d.u[body.c0 + i]
                e += 1
            d.modal[row], d.modal[9 * n + row] = P_row, V_row
        for j in range(n):
            d.modal[j] += second_moment(d, k, j, d.x, body.q0)

    @kernel
    def shape(d, k, j):
        """Return the first moment of mode j's displacement per unit rate: int rho S_j, plus the part of shortening."""
        body = d.flexes[k]
        C = of_mode(d.flex_data, body.data0, body.n_modes, j)
        return (C[0] + first_moment(d, k, j, d.x, body.q0), C[1], C[2])

    @kernel
    def sums(d, k):
        """Return the first moment and its rate; store the second moment and D in SCRATCH (after `invariants`)."""
        body, numbers = d.flexes[k], d.flex_numbers[k]
        n = body.n_modes
        c, v = numbers.first_moment, ZERO
        for j in range(n):
            straight, bent = of_mode(d.flex_data, body.data0, n, j), shape(d, k, j)
            c = add(c, scale(0.5 * d.x[body.q0 + j], add(straight, bent)))
            v = add(v, scale(d.u[body.c0 + j], bent))
        undeformed = numbers.second_moment
        for a in range(3):
            for b in range(3):
                both, rate = undeformed[3 * a + b], 0.0
                row, mirrored = (3 * a + b) * n, body.data0 + 3 * n + (3 * b + a) * n
                for j in range(n):
                    # int r_a r_b = int X_a X_b + int X_b S_a q + int r_a S_b q
                    both += (d.flex_data[mirrored + j].value + d.modal[row + j]) * d.x[body.q0 + j]
                    rate += d.modal[row + j] * d.u[body.c0 + j]
                d.scratch[3 * a + b], d.scratch[RATE + 3 * a + b] = both, rate
        return c, v

    @kernel
    def modes(d, k, a, alpha, omega):
        """Store the inertial forces on the modes, and int rho r x S_j of each, in MODAL, for eigenmodes.

        Source: Wang & Wang (2019), eqs. (9), (14), (15).
        """
        P, n = d.modal, d.flexes[k].n_modes
        V, bias, S = 9 * n, 18 * n, 19 * n
        x, y, z = omega
        xx, yy, zz = y * y + z * z, x * x + z * z, x * x + y * y
        for j in range(n):
            angular = spin(P, 0, n, j)
            centrifugal = x * y * (P[n + j] + P[3 * n + j]) + x * z * (P[2 * n + j] + P[6 * n + j])
            centrifugal += y * z * (P[5 * n + j] + P[7 * n + j])
            centrifugal -= xx * P[j] + yy * P[4 * n + j] + zz * P[8 * n + j]
            coriolis = 2.0 * dot(spin(P, V, n, j), omega)
            d.modal[bias + j] = dot(shape(d, k, j), a) + dot(angular, alpha) + centrifugal + coriolis
            d.modal[S + j], d.modal[S + n + j], d.modal[S + 2 * n + j] = angular

    @kernel
    def shapes(d, k, R, p, moment, force):
        """Store the forces on the shapes of the interface basis, and the momentum per rate of each shape.

        moment, force: wrench that the body needs without modal accelerations, about its reference point; p: from there.
        """
        body = d.flexes[k]
        n, c0, bias = body.n_modes, body.c0, 18 * body.n_modes
        T = bias + 4 * n
        all_in_interface(d, k, d.at_modal + bias, d.at_modal_bias + c0, d.at_modal + T)
        for j in range(n):
            drawn = first_moment(d, k, j, d.x, body.q0)  # if not zero, shapes are eigenmodes
            C = of_mode(d.interface_data, body.interface0, n, j)
            linear = turn(R, (C[0] + drawn, C[1], C[2]))
            angular = turn(R, (d.modal[T + j], d.modal[T + n + j], d.modal[T + 2 * n + j]))
            momentum = d.momenta[c0 + j]
            momentum.angular = add(angular, cross(p, linear))
            momentum.linear = linear
        if body.inboard:
            carried(d, k, moment, force)

    @kernel
    def body_inertia(d, k):
        """Store spatial inertia, wrench, modal forces and modal momenta of flexible body k.

        Like `rigid.inertia`, with zero modal accelerations; `modal_inertia` adds their part.
        Source: Wang & Wang (2019), eqs. (9), (14), (15).
        """
        body, mass = d.flexes[k], d.flex_numbers[k].mass
        frame = d.link_frames[body.link]
        invariants(d, k)
        first, first_rate = sums(d, k)
        R, p, J = frame.axes, reference(d, body.link), tensor(d.scratch)
        omega, alpha, a = turn_back(R, frame.omega), turn_back(R, frame.alpha), turn_back(R, frame.acceleration)
        spatial(d.own[body.link], mass, p, turn(R, first), congruence(R, J))
        force = add(scale(mass, a), cross(alpha, first))
        force = add(force, cross(omega, add(cross(omega, first), scale(2.0, first_rate))))
        for j in range(body.n_modes):
            # shortening accelerates points along x also at constant modal rates
            force = add(force, (d.u[body.c0 + j] * first_moment(d, k, j, d.u, body.c0), 0.0, 0.0))
        moment = add(cross(first, a), turn_symmetric(J, alpha))
        moment = add(moment, cross(omega, turn_symmetric(J, omega)))
        # 2 int rho r x (omega x rdot) = 2 (tr(D) omega - D^T omega)
        D = at9(d.scratch, RATE)
        twice = add(scale(D[0] + D[4] + D[8], omega), scale(-1.0, turn_back(D, omega)))
        moment, force = add(moment, scale(2.0, twice)), turn(R, force)
        moment = add(turn(R, moment), cross(p, force))
        demand_of(d, body.link, moment, force)
        modes(d, k, a, alpha, omega)
        stiffness(d, k)
        shapes(d, k, R, p, moment, force)

    @kernel
    def body_modal_inertia(d, k):
        """Add the effect of the modal accelerations in DU to the wrench on the body's link (right after `inertia`)."""
        body = d.flexes[k]
        for j in range(body.c0, body.c0 + body.n_modes):
            # the part of the body frame, which such shapes move, is in the frame's own acceleration
            angular = d.deformation[j].angular if body.inboard else d.momenta[j].angular
            linear = d.deformation[j].linear if body.inboard else d.momenta[j].linear
            add_wrench(d.wrench[body.link], scale(d.du[j], angular), scale(d.du[j], linear))

    @kernel
    def body_energies(d, k):
        """Return kinetic and elastic energy [J] of flexible body k."""
        body = d.flexes[k]
        n, frame = body.n_modes, d.link_frames[body.link]
        invariants(d, k)
        first, first_rate = sums(d, k)
        R = frame.axes
        omega, v = turn_back(R, frame.omega), turn_back(R, frame.velocity)
        kinetic = 0.5 * d.flex_numbers[k].mass * dot(v, v) + dot(v, add(cross(omega, first), first_rate))
        kinetic += 0.5 * dot(omega, turn_symmetric(tensor(d.scratch), omega))
        elastic, M = 0.0, body.data0 + 12 * n
        K = M + n * n
        for i in range(n):
            rate = d.u[body.c0 + i]
            kinetic += dot(omega, spin(d.modal, 0, n, i)) * rate
            elastic += 0.5 * d.flex_data[K + i].value * d.x[body.q0 + i] ** 2
            for j in range(n):
                kinetic += 0.5 * d.flex_data[M + i * n + j].value * rate * d.u[body.c0 + j]
        return kinetic, elastic

    @kernel
    def energies(d, component):
        kinetic = elastic = 0.0
        for k in range(d.n_flex):
            if d.links[d.flexes[k].link].component == component:
                moving, bent = body_energies(d, k)
                kinetic += moving
                elastic += bent
        return kinetic, elastic

    inertia, mass_matrix, modal_inertia = map(of_each, (body_inertia, body_mass_matrix, body_modal_inertia))
    before = (deform, site, inboard, inertia, mass_matrix, modal_inertia)
    return FlexibleBodies(*before, port_load, modal_forces, modal_rates, energies)
