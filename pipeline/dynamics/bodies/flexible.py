r"""A modally reduced body in the floating frame of reference, no coupling term dropped.

A point is at ``r = X + S q`` in the body frame. Everything the equations need follows from two
families of vectors that are linear in the state, with the invariants of the bundle,

.. math:: P_{kl} = \int\rho\, r_k S_l = E_{kl} + F_{kl} q, \qquad V_{kl} = \int\rho\, \dot r_k S_l = F_{kl}\dot q

after Shabana, *Dynamics of Multibody Systems*, ch. 5, and Wang & Wang (2019), eqs. (9)-(15).
Where bending shortens the body, r also moves along x by a quadratic form of q (see `shortening`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.interface import all_in_interface, deform, modal_rates
from flexclear.pipeline.dynamics.bodies.modal_terms import (
    RATE,
    body_mass_matrix,
    carried,
    modal_forces,
    places,
    port_load,
    spatial,
    spin,
    stiffness,
    tensor,
)
from flexclear.pipeline.dynamics.bodies.ports import make_ports
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import (
    add,
    at,
    at9,
    congruence,
    cross,
    dot,
    put,
    scale,
    turn,
    turn_back,
    turn_symmetric,
)


@kernel
def straight(h, f, w, k, j, vector):
    """Bending shortens nothing: linear shapes."""
    return 0.0


@kernel
def plain(f, data, n, j):
    """Int rho S_j of the linear shape of mode j."""
    return (f[data + j], f[data + n + j], f[data + 2 * n + j])


@dataclass(frozen=True)
class FlexibleBodies:
    """Kernels of all flexible bodies.

    deform(h, f, w): X and U in the interface basis, before all else.  site(h, f, w, s), inboard(h, f, w, i, ...): of
    frames on them (see `ports`).  inertia(h, f, w, n): spatial inertias, wrenches and modal forces, modal accelerations
    taken as zero.  mass_matrix(h, f, w): modal blocks, right after it.  modal_inertia(h, f, w, n): what these add to
    the wrenches.  port_load(h, w, i): a link on a flexible parent loads its moving shapes, too.  modal_forces(h, w):
    generalised forces of the modes.  modal_rates(h, f, w, dy): their accelerations into the state's rates.
    energies(h, f, w): kinetic and elastic [J].
    """

    deform: Callable
    site: Callable
    inboard: Callable
    inertia: Callable
    mass_matrix: Callable
    modal_inertia: Callable
    port_load: Callable
    modal_forces: Callable
    modal_rates: Callable
    energies: Callable


def flexible_bodies(shortening: Any = None) -> FlexibleBodies:
    """The kernels of bodies with linear shapes, or with those that bending shortens (the module `shortening`)."""
    first_moment = straight if shortening is None else shortening.first_moment
    second_moment = straight if shortening is None else shortening.second_moment
    site, inboard = make_ports(straight if shortening is None else shortening.at_port)

    @kernel
    def invariants(h, f, w, k):
        """Fill MODAL with P (first 9 n) and V (next 9 n), row (3k + l) holding n values."""
        n, x, u, data = places(h, k)
        P = h[m.MODAL]
        V = P + 9 * n
        e, first = m.FLEXES.moment0(h, k), m.FLEXES.moment_row0(h, k)
        for row in range(9 * n):
            place, rate, end = f[data + 3 * n + row], 0.0, m.MOMENT_ROWS.end(h, first + row)
            while e < end:
                i, value = m.MOMENTS.mode(h, e), f[m.MOMENT_VALUES.row(h, e)]
                place += value * w[x + i]
                rate += value * w[u + i]
                e += 1
            w[P + row], w[V + row] = place, rate
        for j in range(n):
            w[P + j] += second_moment(h, f, w, k, j, x)

    @kernel
    def shape(h, f, w, k, j):
        """First moment of mode j's displacement per unit rate: int rho S_j, and what shortening adds."""
        n, x, _, data = places(h, k)
        C = plain(f, data, n, j)
        return (C[0] + first_moment(h, f, w, k, j, x), C[1], C[2])

    @kernel
    def sums(h, f, w, k):
        """First moment and its rate; into SCRATCH the second moment and D (after `invariants`)."""
        n, x, u, data = places(h, k)
        P, numbers, Q = h[m.MODAL], m.FLEX_NUMBERS.row(h, k), h[m.SCRATCH]
        c, v = at(f, numbers + m.FLEX_NUMBERS.first_moment), (0.0, 0.0, 0.0)
        for j in range(n):
            straight, bent = plain(f, data, n, j), shape(h, f, w, k, j)
            c = add(c, scale(0.5 * w[x + j], add(straight, bent)))
            v = add(v, scale(w[u + j], bent))
        for a in range(3):
            for b in range(3):
                both, rate = f[numbers + m.FLEX_NUMBERS.second_moment + 3 * a + b], 0.0
                row, mirrored = P + (3 * a + b) * n, data + 3 * n + (3 * b + a) * n
                for j in range(n):
                    # int r_a r_b = int X_a X_b + int X_b S_a q + int r_a S_b q
                    both += (f[mirrored + j] + w[row + j]) * w[x + j]
                    rate += w[row + j] * w[u + j]
                w[Q + 3 * a + b] = both
                w[Q + RATE + 3 * a + b] = rate
        return c, v

    @kernel
    def modes(h, f, w, k, a, alpha, omega):
        """Inertial forces on the modes, and int rho r x S_j of each, into MODAL, as eigenmodes."""
        n, P = m.FLEXES.n_modes(h, k), h[m.MODAL]
        V, bias, S = P + 9 * n, P + 18 * n, P + 19 * n
        x, y, z = omega
        xx, yy, zz = y * y + z * z, x * x + z * z, x * x + y * y
        for j in range(n):
            angular = spin(w, P, n, j)
            centrifugal = x * y * (w[P + n + j] + w[P + 3 * n + j]) + x * z * (w[P + 2 * n + j] + w[P + 6 * n + j])
            centrifugal += y * z * (w[P + 5 * n + j] + w[P + 7 * n + j])
            centrifugal -= xx * w[P + j] + yy * w[P + 4 * n + j] + zz * w[P + 8 * n + j]
            coriolis = 2.0 * dot(spin(w, V, n, j), omega)
            w[bias + j] = dot(shape(h, f, w, k, j), a) + dot(angular, alpha) + centrifugal + coriolis
            w[S + j], w[S + n + j], w[S + 2 * n + j] = angular

    @kernel
    def shapes(h, f, w, k, R, p):
        """Forces on the shapes of the interface basis, and the momentum that each one's rate carries."""
        n, x, c0 = m.FLEXES.n_modes(h, k), h[m.X] + m.FLEXES.q0(h, k), m.FLEXES.c0(h, k)
        bias, C = h[m.MODAL] + 18 * n, h[m.INTERFACE_DATA.place] + m.FLEXES.interface0(h, k)
        T = bias + 4 * n
        all_in_interface(h, f, w, k, bias, h[m.MODAL_BIAS] + c0, T)
        for j in range(n):
            drawn = first_moment(h, f, w, k, j, x)  # if not zero, shapes are eigenmodes
            linear = turn(R, (f[C + j] + drawn, f[C + n + j], f[C + 2 * n + j]))
            angular = turn(R, (w[T + j], w[T + n + j], w[T + 2 * n + j]))
            put(w, m.MOMENTA.row(h, c0 + j), add(angular, cross(p, linear)))
            put(w, m.MOMENTA.row(h, c0 + j) + 3, linear)
        if m.FLEXES.inboard(h, k):
            carried(h, w, k)

    @kernel
    def body_inertia(h, f, w, k):
        """Spatial inertia, wrench, modal forces and modal momenta of flexible body k.

        As `rigid.inertia`, with the modal accelerations taken as zero; `modal_inertia` adds theirs.
        """
        i, n, u = m.FLEXES.link(h, k), m.FLEXES.n_modes(h, k), h[m.U] + m.FLEXES.c0(h, k)
        invariants(h, f, w, k)
        first, first_rate = sums(h, f, w, k)
        mass = f[m.FLEX_NUMBERS.row(h, k)]
        frame, Q = m.LINK_FRAMES.row(h, i), h[m.SCRATCH]
        R, p = at9(w, frame + m.FRAME.axes), at(w, frame + m.FRAME.origin)
        J = tensor(w, Q)
        omega, alpha = turn_back(R, at(w, frame + m.FRAME.omega)), turn_back(R, at(w, frame + m.FRAME.alpha))
        a = turn_back(R, at(w, frame + m.FRAME.acceleration))
        spatial(w, m.OWN.row(h, i), mass, p, turn(R, first), congruence(R, J))
        force = add(scale(mass, a), cross(alpha, first))
        force = add(force, cross(omega, add(cross(omega, first), scale(2.0, first_rate))))
        for j in range(n):
            # a point that bending draws in is accelerated also at constant modal rates
            force = add(force, (w[u + j] * first_moment(h, f, w, k, j, u), 0.0, 0.0))
        moment = add(cross(first, a), turn_symmetric(J, alpha))
        moment = add(moment, cross(omega, turn_symmetric(J, omega)))
        # 2 int rho r x (omega x rdot) = 2 (tr(D) omega - D^T omega)
        D = at9(w, Q + RATE)
        twice = add(scale(D[0] + D[4] + D[8], omega), scale(-1.0, turn_back(D, omega)))
        moment = add(moment, scale(2.0, twice))
        o, force = m.WRENCH.row(h, i), turn(R, force)
        put(w, o, add(turn(R, moment), cross(p, force)))
        put(w, o + 3, force)
        modes(h, f, w, k, a, alpha, omega)
        stiffness(h, f, w, k)
        shapes(h, f, w, k, R, p)

    @kernel
    def body_modal_inertia(h, f, w, k):
        """Add what the modal accelerations in DU demand to the wrench on the body's link (right after `inertia`)."""
        c0, o = m.FLEXES.c0(h, k), m.WRENCH.row(h, m.FLEXES.link(h, k))
        for j in range(c0, c0 + m.FLEXES.n_modes(h, k)):
            # not that of the body frame, which such shapes move: it is in the frame's own acceleration
            momentum = m.DEFORMATION.row(h, j) if m.FLEXES.inboard(h, k) else m.MOMENTA.row(h, j)
            for e in range(6):
                w[o + e] += w[h[m.DU] + j] * w[momentum + e]

    @kernel
    def body_energies(h, f, w, k):
        """Kinetic and elastic energy [J] of flexible body k."""
        n, x, u, data = places(h, k)
        invariants(h, f, w, k)
        first, first_rate = sums(h, f, w, k)
        frame, P = m.LINK_FRAMES.row(h, m.FLEXES.link(h, k)), h[m.MODAL]
        R = at9(w, frame + m.FRAME.axes)
        omega, v = turn_back(R, at(w, frame + m.FRAME.omega)), turn_back(R, at(w, frame + m.FRAME.velocity))
        kinetic = 0.5 * f[m.FLEX_NUMBERS.row(h, k)] * dot(v, v) + dot(v, add(cross(omega, first), first_rate))
        kinetic += 0.5 * dot(omega, turn_symmetric(tensor(w, h[m.SCRATCH]), omega))
        elastic, M = 0.0, data + 12 * n
        K = M + n * n
        for i in range(n):
            kinetic += dot(omega, spin(w, P, n, i)) * w[u + i]
            elastic += 0.5 * f[K + i] * w[x + i] ** 2
            for j in range(n):
                kinetic += 0.5 * f[M + i * n + j] * w[u + i] * w[u + j]
        return kinetic, elastic

    @kernel
    def inertia(h, f, w, n):
        for k in range(h[m.N_FLEX]):
            body_inertia(h, f, w, k)

    @kernel
    def mass_matrix(h, f, w):
        for k in range(h[m.N_FLEX]):
            body_mass_matrix(h, f, w, k)

    @kernel
    def modal_inertia(h, f, w, n):
        for k in range(h[m.N_FLEX]):
            body_modal_inertia(h, f, w, k)

    @kernel
    def energies(h, f, w, component):
        kinetic = elastic = 0.0
        for k in range(h[m.N_FLEX]):
            if m.LINKS.component(h, m.FLEXES.link(h, k)) == component:
                moving, bent = body_energies(h, f, w, k)
                kinetic += moving
                elastic += bent
        return kinetic, elastic

    before = (deform, site, inboard, inertia, mass_matrix, modal_inertia)
    return FlexibleBodies(*before, port_load, modal_forces, modal_rates, energies)
