"""Frames on flexible bodies: deformation, its rates, and the twists that the moving shapes give them.

A frame turns by the rotation vector theta = Psi q and moves by Phi q; its rotation is exp(theta)
in full, so that angular velocity and energy agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import (
    accumulate,
    add,
    at,
    at9,
    cross,
    exponential,
    product,
    put,
    put9,
    scale,
    sub,
    tangent,
    tangent_matrix,
    tangent_rate,
    transpose,
    turn,
)


@kernel
def _shape(f, first, n, j):
    """Column j of a 3 x n shape stored from `first`."""
    return (f[first + j], f[first + n + j], f[first + 2 * n + j])


@kernel
def moving(h, k):
    """Number of moving shapes of body k, and the first of their coordinates."""
    held = m.FLEXES.n_held(h, k)
    return m.FLEXES.n_modes(h, k) - held, m.FLEXES.c0(h, k) + held


def make_ports(shortening: Callable) -> tuple[Callable, Callable]:
    """The kernels `site` and `inboard`; shortening(h, f, w, p, j, vector) is what bending adds along x, or zero."""

    @kernel
    def relative_motion(h, f, w, p):
        """Pose, twist and acceleration of port p's frame in the body frame, and its rotation vector theta.

        Body components.  The accelerations hold what the known modal accelerations give.
        """
        k = m.PORTS.flex(h, p)
        n, first = moving(h, k)
        x, u, du = h[m.INTERFACE_X] + first, h[m.INTERFACE_U] + first, h[m.DU] + first
        move = h[m.PORT_DATA.place] + m.PORTS.shapes(h, p)
        spin = move + 3 * n
        zero = (0.0, 0.0, 0.0)
        s, s_rate, s_acc, theta, theta_rate, theta_acc = zero, zero, zero, zero, zero, zero
        for j in range(n):
            phi, psi, drawn = _shape(f, move, n, j), _shape(f, spin, n, j), shortening(h, f, w, p, j, x)
            bent = (phi[0] + drawn, phi[1], phi[2])
            s = add(s, scale(w[x + j], (phi[0] + 0.5 * drawn, phi[1], phi[2])))
            s_rate, s_acc = add(s_rate, scale(w[u + j], bent)), add(s_acc, scale(w[du + j], bent))
            s_acc = add(s_acc, (w[u + j] * shortening(h, f, w, p, j, u), 0.0, 0.0))
            theta, theta_rate = add(theta, scale(w[x + j], psi)), add(theta_rate, scale(w[u + j], psi))
            theta_acc = add(theta_acc, scale(w[du + j], psi))
        numbers = m.PORT_NUMBERS.row(h, p)
        local = add(at(f, numbers), s)
        turned = product(exponential(theta), at9(f, numbers + 3))
        alpha = add(tangent_rate(theta, theta_rate), tangent(theta, theta_acc))
        return local, turned, tangent(theta, theta_rate), s_rate, alpha, s_acc, theta

    @kernel
    def modal_columns(h, f, w, p, R, origin, theta, sign, first):
        """Twist of port p's frame relative to the body, per rate of a moving shape, about the kernels' origin.

        Added with `sign` to the columns from `first` on; R, origin: axes of the body, place of the port.
        """
        k = m.PORTS.flex(h, p)
        n, c = moving(h, k)
        move, x = h[m.PORT_DATA.place] + m.PORTS.shapes(h, p), h[m.INTERFACE_X] + c
        spin = product(R, tangent_matrix(theta))
        for j in range(n):
            phi = _shape(f, move, n, j)
            bent = (phi[0] + shortening(h, f, w, p, j, x), phi[1], phi[2])
            angular = scale(sign, turn(spin, _shape(f, move + 3 * n, n, j)))
            linear = scale(sign, turn(R, bent))
            o = m.COLUMNS.row(h, first + j)
            accumulate(w, o, angular)
            accumulate(w, o + 3, add(linear, cross(origin, angular)))

    @kernel
    def site(h, f, w, s):
        """Motion of a site on a flexible link, and the columns of its port."""
        p = m.SITES.port(h, s)
        k = m.PORTS.flex(h, p)
        local, turned, omega_l, v_l, alpha_l, a_l, theta = relative_motion(h, f, w, p)
        frame = m.LINK_FRAMES.row(h, m.FLEXES.link(h, k))
        R, omega, alpha = at9(w, frame + m.FRAME.axes), at(w, frame + m.FRAME.omega), at(w, frame + m.FRAME.alpha)
        arm, turning, sliding = turn(R, local), turn(R, omega_l), turn(R, v_l)
        origin, swing = add(at(w, frame + m.FRAME.origin), arm), cross(omega, arm)
        a = add(at(w, frame + m.FRAME.acceleration), add(cross(alpha, arm), cross(omega, swing)))
        a = add(a, add(scale(2.0, cross(omega, sliding)), turn(R, a_l)))
        o = m.SITE_FRAMES.row(h, s)
        put(w, o + m.FRAME.origin, origin)
        put9(w, o + m.FRAME.axes, product(R, turned))
        put(w, o + m.FRAME.omega, add(omega, turning))
        put(w, o + m.FRAME.velocity, add(at(w, frame + m.FRAME.velocity), add(swing, sliding)))
        put(w, o + m.FRAME.alpha, add(alpha, add(turn(R, alpha_l), cross(omega, turning))))
        put(w, o + m.FRAME.acceleration, a)
        moves, first = m.FLEXES.inboard(h, k), m.PORTS.column(h, p)
        n, c = moving(h, k)
        for j in range(n):
            for e in range(6):
                w[m.COLUMNS.row(h, first + j) + e] = w[m.COLUMNS.row(h, c + j) + e] if moves else 0.0
        modal_columns(h, f, w, p, R, origin, theta, 1.0, first)

    @kernel
    def inboard(h, f, w, i, origin, R, omega, v, alpha, a):
        """From the inboard joint frame G, which the modes may move in the body, to the body frame."""
        p = m.LINKS.inboard_port(h, i)
        k = m.PORTS.flex(h, p)
        if m.FLEXES.inboard(h, k) == 0:
            # the reference condition holds this frame still in the body: a rigid step
            numbers = m.PORT_NUMBERS.row(h, p)
            R_WB = product(R, transpose(at9(f, numbers + 3)))
            arm = turn(R_WB, at(f, numbers))
            swing = cross(omega, arm)
            a_B = sub(a, add(cross(alpha, arm), cross(omega, swing)))
            return sub(origin, arm), R_WB, omega, sub(v, swing), alpha, a_B
        local, turned, omega_l, v_l, alpha_l, a_l, theta = relative_motion(h, f, w, p)
        R_WB = product(R, transpose(turned))
        arm, turning, sliding = turn(R_WB, local), turn(R_WB, omega_l), turn(R_WB, v_l)
        omega_B = sub(omega, turning)
        alpha_B = sub(alpha, add(turn(R_WB, alpha_l), cross(omega_B, turning)))
        swing = cross(omega_B, arm)
        v_B = sub(v, add(swing, sliding))
        a_B = sub(a, add(cross(alpha_B, arm), cross(omega_B, swing)))
        a_B = sub(a_B, add(scale(2.0, cross(omega_B, sliding)), turn(R_WB, a_l)))
        n, c = moving(h, k)
        for j in range(n):
            for e in range(6):
                w[m.COLUMNS.row(h, c + j) + e] = 0.0
        modal_columns(h, f, w, p, R_WB, origin, theta, -1.0, c)
        return sub(origin, arm), R_WB, omega_B, v_B, alpha_B, a_B

    return site, inboard
