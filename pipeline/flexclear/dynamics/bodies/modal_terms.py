"""Terms of the equations of a flexible body that do not depend on its stiffening by loads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    add,
    add_twist,
    at6,
    cross,
    dot,
    scale,
    turn_symmetric,
)

#: SCRATCH: second moment int rho r r^T (9), D = int rho r rdot^T (9), int rho r (q'^T G q')^T (9)
RATE, DRIFT = 9, 18


@kernel
def of_mode(numbers, first, n, j):
    """Return column j of a 3 x n matrix, the values of a table from row `first` on."""
    return (numbers[first + j].value, numbers[first + n + j].value, numbers[first + 2 * n + j].value)


@kernel
def tensor(Q):
    """Return the inertia tensor tr(Q) 1 - Q, as (xx, yy, zz, xy, xz, yz), of the symmetric part of the start of Q."""
    across = (-0.5 * (Q[1] + Q[3]), -0.5 * (Q[2] + Q[6]), -0.5 * (Q[5] + Q[7]))
    return (Q[4] + Q[8], Q[0] + Q[8], Q[0] + Q[4], *across)


@kernel
def spin(P, first, n, j):
    """Return the antisymmetric part of column j of P (or V), from `first` on: int rho r x S_j (or rdot x S_j)."""
    return (
        P[first + 5 * n + j] - P[first + 7 * n + j],
        P[first + 6 * n + j] - P[first + 2 * n + j],
        P[first + n + j] - P[first + 3 * n + j],
    )


@kernel
def spatial(own, mass, p, c, J):
    """Store a spatial inertia (a row of OWN); c, J: first moment and inertia about p, world axes."""
    own.mass, own.moment = mass, add(scale(mass, p), c)
    square = mass * dot(p, p) + 2.0 * dot(p, c)
    for k in range(3):
        own.inertia[k] = J[k] + square - mass * p[k] * p[k] - 2.0 * p[k] * c[k]
    own.inertia[3] = J[3] - mass * p[0] * p[1] - p[0] * c[1] - p[1] * c[0]
    own.inertia[4] = J[4] - mass * p[0] * p[2] - p[0] * c[2] - p[2] * c[0]
    own.inertia[5] = J[5] - mass * p[1] * p[2] - p[1] * c[2] - p[2] * c[1]


@kernel
def stiffness(d, k):
    """Add elastic and damping forces to those on the modes, and the power lost to damping to the ledger."""
    body = d.flexes[k]
    n = body.n_modes
    K, bias = body.data0 + 12 * n + n * n, 18 * n
    for j in range(n):
        speed = d.u[body.c0 + j]
        damping = d.flex_data[K + n + j].value * speed
        d.modal[bias + j] += d.flex_data[K + j].value * d.x[body.q0 + j] + damping
        d.position_rate[body.q0 + j] = speed
        d.ledger_rate[body.book] += damping * speed


def make_carrying(tree: Any) -> tuple[Callable, Callable]:
    """Build carried(d, k, moment, force) and body_mass_matrix(d, k), about the reference point of `tree`."""
    column = tree.column

    @kernel
    def carried(d, k, moment, force):
        """Add the body's own wrench and inertia to the columns of shapes that also move the body frame."""
        body = d.flexes[k]
        own = d.own[body.link]
        c, J, mass = own.moment, at6(own.inertia, 0), own.mass
        for j in range(body.c0, body.c0 + body.n_modes):
            momentum, deformation = d.momenta[j], d.deformation[j]
            # the mass matrix needs the momentum of the deformation alone
            deformation.angular, deformation.linear = momentum.angular, momentum.linear
            if j < body.c0 + body.n_held:
                continue
            omega, v = column(d, j)
            d.modal_bias[j] += dot(moment, omega) + dot(force, v)
            add_twist(momentum, add(turn_symmetric(J, omega), cross(c, v)), add(scale(mass, v), cross(omega, c)))

    @kernel
    def body_mass_matrix(d, k):
        """Add the body's own part of the modal block of the mass matrix to the envelope; right after `inertia`."""
        body = d.flexes[k]
        n, c0, held = body.n_modes, body.c0, body.n_held
        mass = body.interface0 + 3 * n
        for i in range(n):
            start = d.envelope[c0 + i].origin + c0
            for j in range(0 if body.coupled and i >= held else i, i + 1):
                value = d.interface_data[mass + i * n + j].value
                if body.inboard and j >= held:
                    omega, v = column(d, c0 + j)
                    value += dot(d.momenta[c0 + i].angular, omega) + dot(d.momenta[c0 + i].linear, v)
                if body.inboard and i >= held:
                    omega, v = column(d, c0 + i)
                    value += dot(omega, d.deformation[c0 + j].angular) + dot(v, d.deformation[c0 + j].linear)
                d.mass[start + j] += value

    return carried, body_mass_matrix
