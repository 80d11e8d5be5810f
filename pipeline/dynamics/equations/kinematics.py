"""Motion of links and sites from the coordinates, along the spanning tree, in world axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.choice import choose
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, add, at, at9, cross, product, put, put9, scale, turn


@kernel
def _store(w, o, p, R, omega, v, alpha, a):
    put(w, o + m.FRAME.origin, p)
    put9(w, o + m.FRAME.axes, R)
    put(w, o + m.FRAME.omega, omega)
    put(w, o + m.FRAME.velocity, v)
    put(w, o + m.FRAME.alpha, alpha)
    put(w, o + m.FRAME.acceleration, a)


@kernel
def rigid_site(h, f, w, s):
    """Motion of a site from that of its rigid link."""
    o, numbers = m.LINK_FRAMES.row(h, m.SITES.link(h, s)), m.SITE_NUMBERS.row(h, s)
    R = at9(w, o + m.FRAME.axes)
    omega, alpha = at(w, o + m.FRAME.omega), at(w, o + m.FRAME.alpha)
    arm = turn(R, at(f, numbers))
    swing = cross(omega, arm)
    v = add(at(w, o + m.FRAME.velocity), swing)
    a = add(at(w, o + m.FRAME.acceleration), add(cross(alpha, arm), cross(omega, swing)))
    p = add(at(w, o + m.FRAME.origin), arm)
    _store(w, m.SITE_FRAMES.row(h, s), p, product(R, at9(f, numbers + 3)), omega, v, alpha, a)


@kernel
def undeformed(h, f, w):
    """No modes."""


@kernel
def rigid_inboard(h, f, w, i, p, R, omega, v, alpha, a):
    """A rigid link's frame is its inboard joint frame."""
    return p, R, omega, v, alpha, a


def make_kinematics(joints: tuple[Any, ...], flexible: Any = None) -> Callable:
    """The kernel kinematics(h, f, w) that moves everything.

    joints: modules of the joint types present.  flexible: kernels of the flexible bodies (`bodies.flexible`); their
    `deform` is called first, their
    `site` adds the deformation of a link to a site, their `inboard` steps from the inboard joint frame to the link's.
    """
    joint_motion = choose(tuple(joint.motion for joint in joints))
    position_rate = choose(tuple(joint.position_rate for joint in joints))
    deform = undeformed if flexible is None else flexible.deform
    inboard = rigid_inboard if flexible is None else flexible.inboard
    port_site = rigid_site if flexible is None else flexible.site

    @kernel
    def place(h, f, w, i):
        """Link i from its inboard site, which must be up to date.

        The relative twist is S u in the axes of the joint's first frame F, its rate S u' + bias.
        """
        s, S, c0, n = m.SITE_FRAMES.row(h, i - 1), h[m.SUBSPACE.place], m.LINKS.c0(h, i), m.LINKS.n_speeds(h, i)
        kind, x, u, du = m.LINKS.joint(h, i), h[m.X] + m.LINKS.q0(h, i), h[m.U] + c0, h[m.DU] + c0
        R_FG, p_FG, bias_angular, bias_linear = joint_motion(kind, w, x, u, S)
        position_rate(kind, w, x, u, h[m.POSITION_RATE] + m.LINKS.q0(h, i))
        F, omega_F, alpha_F = at9(w, s + m.FRAME.axes), at(w, s + m.FRAME.omega), at(w, s + m.FRAME.alpha)
        arm = turn(F, p_FG)
        p, swing = add(at(w, s + m.FRAME.origin), arm), cross(omega_F, arm)
        turning, sliding, growing, speeding = ZERO, ZERO, turn(F, bias_angular), turn(F, bias_linear)
        for k in range(n):
            o, rate, second = m.COLUMNS.row(h, c0 + k), w[u + k], w[du + k]
            angular, linear = turn(F, at(w, S + 6 * k)), turn(F, at(w, S + 6 * k + 3))
            put(w, o, angular)
            put(w, o + 3, add(linear, cross(p, angular)))
            turning, sliding = add(turning, scale(rate, angular)), add(sliding, scale(rate, linear))
            growing, speeding = add(growing, scale(second, angular)), add(speeding, scale(second, linear))
        v = add(at(w, s + m.FRAME.velocity), add(swing, sliding))
        alpha = add(alpha_F, add(growing, cross(omega_F, turning)))
        a = add(at(w, s + m.FRAME.acceleration), add(cross(alpha_F, arm), cross(omega_F, swing)))
        a = add(a, add(scale(2.0, cross(omega_F, sliding)), speeding))
        omega, R = add(omega_F, turning), product(F, R_FG)
        if m.LINKS.flex(h, i) >= 0:
            p, R, omega, v, alpha, a = inboard(h, f, w, i, p, R, omega, v, alpha, a)
        _store(w, m.LINK_FRAMES.row(h, i), p, R, omega, v, alpha, a)

    @kernel
    def locate(h, f, w, s):
        """Site s from its link."""
        if m.SITES.port(h, s) >= 0:
            port_site(h, f, w, s)
        else:
            rigid_site(h, f, w, s)

    @kernel
    def kinematics(h, f, w):
        """All links and sites: positions from X, velocities from U, accelerations from DU.

        With the known part of the accelerations in DU this gives the acceleration bias; with the
        whole of them, the accelerations. Gravity is an upward acceleration of the ground.
        """
        put(w, m.LINK_FRAMES.row(h, 0) + m.FRAME.acceleration, scale(-1.0, at(f, h[m.GRAVITY.place])))
        deform(h, f, w)
        for i in range(1, h[m.N_LINKS]):
            locate(h, f, w, i - 1)
            place(h, f, w, i)
        for s in range(h[m.N_LINKS] - 1, h[m.N_SITES]):
            locate(h, f, w, s)

    return kinematics
