"""Frames on flexible bodies: deformation, its rates, and the twist per rate of each moving shape.

A frame turns by the rotation vector theta = Psi q and moves by Phi q; its rotation is the full exp(theta),
so that angular velocity and energy agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.bodies.modal_terms import of_mode
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import (
    ZERO,
    add,
    add_twist,
    cross,
    exponential,
    product,
    scale,
    sub,
    tangent,
    tangent_matrix,
    tangent_rate,
    transpose,
    turn,
)


@kernel
def moving(body):
    """Return the number of moving shapes of a body, and the index of the first of their coordinates."""
    return body.n_modes - body.n_held, body.c0 + body.n_held


def make_ports(shortening: Callable, tree: Any) -> tuple[Callable, Callable]:
    """Build the kernels `site` and `inboard`; shortening(d, p, j, vector, first): shortening along x, or zero.

    tree: module that factors the mass matrix, and may need columns about the origin of their link.
    """
    localise_shape, shift = tree.localise_shape, tree.shift

    @kernel
    def relative_motion(d, p):
        """Return pose, twist and acceleration of port p's frame in the body frame, and its rotation vector theta.

        All are in axes of the body frame.  The accelerations include the part of the known modal accelerations.
        Source: Wang & Wang (2019), eqs. (2), (7), (8).
        """
        port, undeformed = d.ports[p], d.port_numbers[p]
        n, c = moving(d.flexes[port.flex])
        move, spin = port.shapes, port.shapes + 3 * n
        s, s_rate, s_acc, theta, theta_rate, theta_acc = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
        for j in range(n):
            x, u, du = d.interface_x[c + j], d.interface_u[c + j], d.du[c + j]
            phi, psi = of_mode(d.port_data, move, n, j), of_mode(d.port_data, spin, n, j)
            drawn = shortening(d, p, j, d.interface_x, c)
            bent = (phi[0] + drawn, phi[1], phi[2])
            s = add(s, scale(x, (phi[0] + 0.5 * drawn, phi[1], phi[2])))
            s_rate, s_acc = add(s_rate, scale(u, bent)), add(s_acc, scale(du, bent))
            s_acc = add(s_acc, (u * shortening(d, p, j, d.interface_u, c), 0.0, 0.0))
            theta, theta_rate = add(theta, scale(x, psi)), add(theta_rate, scale(u, psi))
            theta_acc = add(theta_acc, scale(du, psi))
        local = add(undeformed.origin, s)
        turned = product(exponential(theta), undeformed.axes)
        alpha = add(tangent_rate(theta, theta_rate), tangent(theta, theta_acc))
        return local, turned, tangent(theta, theta_rate), s_rate, alpha, s_acc, theta

    @kernel
    def modal_columns(d, p, R, origin, arm, theta, sign, first, base):
        """Add the twist of port p's frame relative to the body, per rate of each moving shape, to columns.

        It is about the kernels' origin, times `sign`, from column `first` on.  R, origin: body axes, position of the
        port; arm: to it from the link's origin.  base: first column about that origin to add them to, or -1.
        """
        port = d.ports[p]
        n, c = moving(d.flexes[port.flex])
        spin = product(R, tangent_matrix(theta))
        for j in range(n):
            phi = of_mode(d.port_data, port.shapes, n, j)
            bent = (phi[0] + shortening(d, p, j, d.interface_x, c), phi[1], phi[2])
            angular = scale(sign, turn(spin, of_mode(d.port_data, port.shapes + 3 * n, n, j)))
            linear = scale(sign, turn(R, bent))
            add_twist(d.columns[first + j], angular, add(linear, cross(origin, angular)))
            localise_shape(d, first + j, base + j if base >= 0 else -1, angular, add(linear, cross(arm, angular)))

    @kernel
    def site(d, s):
        """Store motion and port columns of a site on a flexible link; return its arm from the link's origin."""
        p = d.sites[s].port
        port = d.ports[p]
        body = d.flexes[port.flex]
        local, turned, omega_l, v_l, alpha_l, a_l, theta = relative_motion(d, p)
        frame, here = d.link_frames[body.link], d.site_frames[s]
        R, omega, alpha = frame.axes, frame.omega, frame.alpha
        arm, turning, sliding = turn(R, local), turn(R, omega_l), turn(R, v_l)
        origin, swing = add(frame.origin, arm), cross(omega, arm)
        a = add(frame.acceleration, add(cross(alpha, arm), cross(omega, swing)))
        a = add(a, add(scale(2.0, cross(omega, sliding)), turn(R, a_l)))
        here.origin, here.axes = origin, product(R, turned)
        here.omega, here.velocity = add(omega, turning), add(frame.velocity, add(swing, sliding))
        here.alpha, here.acceleration = add(alpha, add(turn(R, alpha_l), cross(omega, turning))), a
        n, c = moving(body)
        for j in range(n):
            column, of_body = d.columns[port.column + j], d.columns[c + j]
            column.angular = of_body.angular if body.inboard else ZERO
            column.linear = of_body.linear if body.inboard else ZERO
        modal_columns(d, p, R, origin, arm, theta, 1.0, port.column, c if body.inboard else -1)
        return arm

    @kernel
    def inboard(d, i, origin, R, omega, v, alpha, a):
        """Return the body frame's motion from that of the inboard joint frame G, which modes may move in the body."""
        p = d.links[i].inboard_port
        body = d.flexes[d.ports[p].flex]
        if body.inboard == 0:
            # the reference condition holds this frame fixed in the body: a rigid step
            R_WB = product(R, transpose(d.port_numbers[p].axes))
            arm = turn(R_WB, d.port_numbers[p].origin)
            swing = cross(omega, arm)
            a_B = sub(a, add(cross(alpha, arm), cross(omega, swing)))
            shift(d, i, arm)
            return sub(origin, arm), R_WB, omega, sub(v, swing), alpha, a_B
        local, turned, omega_l, v_l, alpha_l, a_l, theta = relative_motion(d, p)
        R_WB = product(R, transpose(turned))
        arm, turning, sliding = turn(R_WB, local), turn(R_WB, omega_l), turn(R_WB, v_l)
        omega_B = sub(omega, turning)
        alpha_B = sub(alpha, add(turn(R_WB, alpha_l), cross(omega_B, turning)))
        swing = cross(omega_B, arm)
        v_B = sub(v, add(swing, sliding))
        a_B = sub(a, add(cross(alpha_B, arm), cross(omega_B, swing)))
        a_B = sub(a_B, add(scale(2.0, cross(omega_B, sliding)), turn(R_WB, a_l)))
        n, c = moving(body)
        for j in range(n):
            column = d.columns[c + j]
            column.angular, column.linear = ZERO, ZERO
        shift(d, i, arm)
        modal_columns(d, p, R_WB, origin, arm, theta, -1.0, c, -1)
        return sub(origin, arm), R_WB, omega_B, v_B, alpha_B, a_B

    return site, inboard
