r"""A modally reduced body in the floating frame of reference, without neglected coupling terms.

A point is at :math:`r = X + S q + \tfrac12 q^T G q` in the body frame. The quadratic part is the motion of
sections that turn, and in solids that of the stresses of a spin; it counts where it multiplies rigid motion, as
:math:`L_{kl} = \int\rho X_k G_l`. All terms of the equations follow from two families of vectors that are linear in the
state, with the invariants of the bundle,

.. math:: P_{kl} = \int\rho\, r_k \frac{\partial r_l}{\partial q} = E_{kl} + (F_{kl} + L_{kl}) q, \qquad
          V_{kl} = \int\rho\, \dot r_k S_l = F_{kl}\dot q

after Shabana, *Dynamics of Multibody Systems*, ch. 5, and Wang & Wang (2019), eqs. (9)-(15). They come from a
Lagrangian, so power and energy agree to rounding.
Where loads stiffen the body, the quadratic part also moves its centre and its frames (see `bodies.stiffening`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from flexclear.dynamics.bodies.interface import all_in_interface, deform, modal_rates
from flexclear.dynamics.bodies.modal_terms import (
    DRIFT,
    RATE,
    make_carrying,
    of_mode,
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
    at6,
    at9,
    congruence,
    cross,
    dot,
    scale,
    sub,
    turn,
    turn_back,
    turn_symmetric,
)


@kernel
def _still(d, k, j, vector, first):
    """Return zero: loads do not stiffen the body."""
    return ZERO


@kernel
def _still_frame(d, p, j, vector, first):
    """Return zero displacement and rotation of a frame."""
    return ZERO, ZERO


@kernel
def _uncoupled(d):
    """Leave the forces on the modes."""


LINEAR = SimpleNamespace(first_moment=_still, at_port=_still_frame, couple=_uncoupled)


def of_each(body: Callable) -> Callable:
    """Return the kernel that applies body(d, k) to every flexible body k."""

    @kernel
    def bodies(d):
        for k in range(d.n_flex):
            body(d, k)

    return bodies


def flexible_bodies(stiffening: Any = LINEAR) -> Callable[[Any], FlexibleBodies]:
    """Return the factory of the kernels of flexible bodies; its argument says about which points
    (`equations.articulated`, `equations.observation.ABOUT_ORIGIN`).

    stiffening: linear motion of frames, or with the part of `bodies.stiffening`.
    """
    return partial(_flexible_bodies, stiffening)


def _flexible_bodies(stiffening: Any, tree: Any) -> FlexibleBodies:
    first_moment, couple = stiffening.first_moment, stiffening.couple
    site, inboard = make_ports(stiffening.at_port, tree)
    carried, body_mass_matrix = make_carrying(tree)
    reference, demand_of = tree.origin, tree.demand_of

    @kernel
    def invariants(d, k):
        """Fill MODAL with P (first 9 n) and V (next 9 n); row (3k + l) holds n values.

        Also store int rho r_k (q'^T G q')_l in SCRATCH, up to a part that is symmetric in k and l.
        """
        body = d.flexes[k]
        n, e = body.n_modes, body.moment0
        for pair in range(9):
            drift, across = 0.0, pair % 4 != 0  # terms of equal axes are symmetric
            for j in range(n):
                row = pair * n + j
                P_row, V_row, bent = d.flex_data[body.data0 + 3 * n + row].value, 0.0, 0.0
                end = d.moment_rows[body.moment_row0 + row].end
                while e < end:
                    i, moment = d.moments[e].mode, d.moment_values[e]
                    P_row += moment.position * d.x[body.q0 + i]
                    V_row += moment.rate * d.u[body.c0 + i]
                    if across:
                        bent += moment.position * d.u[body.c0 + i]
                    e += 1
                d.modal[row], d.modal[9 * n + row] = P_row, V_row
                drift += bent * d.u[body.c0 + j]
            d.scratch[DRIFT + pair] = drift

    @kernel
    def shape(d, k, j):
        """Return the first moment of mode j's displacement per unit rate: int rho S_j, plus the part of stiffening."""
        body = d.flexes[k]
        return add(of_mode(d.flex_data, body.data0, body.n_modes, j), first_moment(d, k, j, d.x, body.q0))

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
            C = of_mode(d.interface_data, body.interface0, n, j)
            # if the second part is not zero, shapes are eigenmodes
            linear = turn(R, add(C, first_moment(d, k, j, d.x, body.q0)))
            angular = turn(R, (d.modal[T + j], d.modal[T + n + j], d.modal[T + 2 * n + j]))
            momentum = d.momenta[c0 + j]
            momentum.angular = add(angular, cross(p, linear))
            momentum.linear = linear
        if body.inboard:
            carried(d, k, moment, force)

    @kernel
    def body_inertia(d, k):
        """Store spatial inertia, wrench, modal forces and modal momenta of flexible body k.

        Like `rigid.inertia`, with zero modal accelerations.
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
            # the quadratic part accelerates points also at constant modal rates
            force = add(force, scale(d.u[body.c0 + j], first_moment(d, k, j, d.u, body.c0)))
        moment = add(add(cross(first, a), spin(d.scratch, DRIFT, 1, 0)), turn_symmetric(J, alpha))
        untilted = at6(d.flex_numbers[k].untilted, 0)
        moment = add(moment, cross(omega, sub(turn_symmetric(J, omega), turn_symmetric(untilted, omega))))
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
    def inertia(d):
        for k in range(d.n_flex):
            body_inertia(d, k)
        couple(d)

    before = (deform, site, inboard, inertia, of_each(body_mass_matrix))
    return FlexibleBodies(*before, modal_rates)
