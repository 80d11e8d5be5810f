"""Spatial inertia and inertial wrench of a rigid link, about the kernels' origin."""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import (
    ZERO,
    accumulate,
    add,
    at,
    at6,
    at9,
    congruence,
    cross,
    dot,
    put,
    scale,
    turn,
    turn_symmetric,
)


@kernel
def spatial(w, o, mass, c, J):
    """Store the spatial inertia of a mass at c with inertia J about it, world axes."""
    x, y, z = c
    w[o] = mass
    put(w, o + 1, scale(mass, c))
    w[o + 4] = J[0] + mass * (y * y + z * z)
    w[o + 5] = J[1] + mass * (x * x + z * z)
    w[o + 6] = J[2] + mass * (x * x + y * y)
    w[o + 7] = J[3] - mass * x * y
    w[o + 8] = J[4] - mass * x * z
    w[o + 9] = J[5] - mass * y * z


@kernel
def demand(h, f, w, i):
    """Return mass of link i, its centre from its origin, inertia about the centre, and the moment there and force.

    World axes.  Moment and force are what the accelerations now in its frame need, gravity being an acceleration of the
    ground.
    """
    frame, numbers = m.LINK_FRAMES.row(h, i), m.LINK_NUMBERS.row(h, i)
    R = at9(w, frame + m.FRAME.axes)
    omega, alpha = at(w, frame + m.FRAME.omega), at(w, frame + m.FRAME.alpha)
    arm = turn(R, at(f, numbers + m.LINK_NUMBERS.com))
    mass = f[numbers + m.LINK_NUMBERS.mass]
    J = congruence(R, at6(f, numbers + m.LINK_NUMBERS.inertia))
    a = add(at(w, frame + m.FRAME.acceleration), add(cross(alpha, arm), cross(omega, cross(omega, arm))))
    return mass, arm, J, add(turn_symmetric(J, alpha), cross(omega, turn_symmetric(J, omega))), scale(mass, a)


@kernel
def inertia(h, f, w, i):
    """Spatial inertia of link i and the wrench on it, about the kernels' origin (OWN, WRENCH)."""
    mass, arm, J, moment, force = demand(h, f, w, i)
    c, o = add(at(w, m.LINK_FRAMES.row(h, i) + m.FRAME.origin), arm), m.WRENCH.row(h, i)
    spatial(w, m.OWN.row(h, i), mass, c, J)
    put(w, o, add(moment, cross(c, force)))
    put(w, o + 3, force)


@kernel
def inertia_about_itself(h, f, w, i):
    """The same about the link's origin (OWN, ARTICULATED): far from the kernels' origin both lose digits there.

    The wrench about the kernels' origin is then that of all else that acts on the link.
    """
    mass, arm, J, moment, force = demand(h, f, w, i)
    o, body = m.WRENCH.row(h, i), m.ARTICULATED.row(h, i)
    spatial(w, m.OWN.row(h, i), mass, arm, J)
    put(w, body + m.ARTICULATED.own_moment, add(moment, cross(arm, force)))
    put(w, body + m.ARTICULATED.own_force, force)
    put(w, o, ZERO)
    put(w, o + 3, ZERO)


@kernel
def kinetic_energy(h, f, w, i):
    """Kinetic energy [J] of a rigid link."""
    frame, numbers = m.LINK_FRAMES.row(h, i), m.LINK_NUMBERS.row(h, i)
    R = at9(w, frame + m.FRAME.axes)
    omega = at(w, frame + m.FRAME.omega)
    v = add(at(w, frame + m.FRAME.velocity), cross(omega, turn(R, at(f, numbers + m.LINK_NUMBERS.com))))
    J = congruence(R, at6(f, numbers + m.LINK_NUMBERS.inertia))
    return 0.5 * (f[numbers + m.LINK_NUMBERS.mass] * dot(v, v) + dot(omega, turn_symmetric(J, omega)))


@kernel
def carry(h, w, i, k):
    """Store the momentum of the subtree of link i moving with column k."""
    I, s, o = m.INERTIA.row(h, i), m.COLUMNS.row(h, k), m.MOMENTA.row(h, k)
    omega, v, c = at(w, s), at(w, s + 3), at(w, I + m.INERTIA.moment)
    put(w, o, add(turn_symmetric(at6(w, I + m.INERTIA.inertia), omega), cross(c, v)))
    put(w, o + 3, add(scale(w[I + m.INERTIA.mass], v), cross(omega, c)))


@kernel
def apply_wrench(h, w, s, moment, force):
    """Apply a wrench (moment about the kernels' origin, force; world) on the link, and its modes, of site s."""
    o = m.WRENCH.row(h, m.SITES.link(h, s))
    accumulate(w, o, scale(-1.0, moment))
    accumulate(w, o + 3, scale(-1.0, force))
    p = m.SITES.port(h, s)
    if p >= 0:
        b = m.PORTS.flex(h, p)
        held, first = m.FLEXES.n_held(h, b), m.PORTS.column(h, p)
        bias = h[m.MODAL_BIAS] + m.FLEXES.c0(h, b) + held
        for j in range(m.FLEXES.n_modes(h, b) - held):
            o = m.COLUMNS.row(h, first + j)
            w[bias + j] -= dot(at(w, o), moment) + dot(at(w, o + 3), force)
