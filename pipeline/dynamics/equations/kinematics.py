"""Motion of links and sites from the coordinates, along the spanning tree, in world axes."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics import memory as m
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import add, at, at9, cross, product, put, put9, scale, turn


@kernel
def no_port(h, f, w, s):
    """Stands for ports where no body is flexible."""


@kernel
def no_inboard(h, f, w, i, p, R, omega, v, alpha, a):
    """A rigid link's frame is its inboard joint frame."""
    return p, R, omega, v, alpha, a


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


def compose(joint_motion: Callable, port_site: Callable, inboard: Callable) -> Callable:
    """The kernel that moves everything.

    joint_motion(kind, w, x, u, du, joint, rate); port_site adds the deformation of a flexible
    link to a site; inboard steps from the inboard joint frame to a flexible link's frame.
    """

    @kernel
    def place(h, f, w, i):
        """Link i from its inboard site, which must be up to date."""
        s, j, c0 = m.SITE_FRAMES.row(h, i - 1), h[m.JOINT.place], m.LINKS.c0(h, i)
        q = m.LINKS.q0(h, i)
        joint_motion(m.LINKS.joint(h, i), w, h[m.X] + q, h[m.U] + c0, h[m.DU] + c0, j, h[m.POSITION_RATE] + q)
        F = at9(w, s + m.FRAME.axes)
        omega_F, alpha_F = at(w, s + m.FRAME.omega), at(w, s + m.FRAME.alpha)
        arm, turning = turn(F, at(w, j + m.JOINT.position)), turn(F, at(w, j + m.JOINT.omega))
        sliding = turn(F, at(w, j + m.JOINT.velocity))
        p, swing = add(at(w, s + m.FRAME.origin), arm), cross(omega_F, arm)
        v = add(at(w, s + m.FRAME.velocity), add(swing, sliding))
        alpha = add(alpha_F, add(turn(F, at(w, j + m.JOINT.alpha)), cross(omega_F, turning)))
        a = add(at(w, s + m.FRAME.acceleration), add(cross(alpha_F, arm), cross(omega_F, swing)))
        a = add(a, add(scale(2.0, cross(omega_F, sliding)), turn(F, at(w, j + m.JOINT.acceleration))))
        for k in range(m.LINKS.n_speeds(h, i)):
            o = m.COLUMNS.row(h, c0 + k)
            angular = turn(F, at(w, j + m.JOINT.columns + 6 * k))
            put(w, o, angular)
            put(w, o + 3, add(turn(F, at(w, j + m.JOINT.columns + 6 * k + 3)), cross(p, angular)))
        omega, R = add(omega_F, turning), product(F, at9(w, j + m.JOINT.rotation))
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
        for i in range(1, h[m.N_LINKS]):
            locate(h, f, w, i - 1)
            place(h, f, w, i)
        for s in range(h[m.N_LINKS] - 1, h[m.N_SITES]):
            locate(h, f, w, s)

    return kinematics
