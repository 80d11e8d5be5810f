"""Motion of links and sites from the coordinates, along the spanning tree, in world axes."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.tables import (
    ACCELERATION,
    ALPHA,
    AXES,
    C0,
    DU,
    FLEX,
    GRAVITY,
    J_ACCELERATION,
    J_ALPHA,
    J_COLUMNS,
    J_OMEGA,
    J_POSITION,
    J_ROTATION,
    J_VELOCITY,
    JOINT,
    JOINT_KIND,
    N_LINKS,
    N_SITES,
    N_SPEEDS,
    OMEGA,
    ORIGIN,
    POSITION_RATE,
    Q0,
    SITE_NUMBERS,
    VELOCITY,
    U,
    X,
    column,
    link,
    link_frame,
    site_frame,
    site_link,
    site_port,
)
from pipeline.dynamics.vectors import add, at, at9, cross, kernel, product, put, put9, scale, turn


@kernel
def no_port(h, f, w, s):
    """Stands for ports where no body is flexible."""


@kernel
def no_inboard(h, f, w, i, p, R, omega, v, alpha, a):
    """A rigid link's frame is its inboard joint frame."""
    return p, R, omega, v, alpha, a


@kernel
def _store(w, o, p, R, omega, v, alpha, a):
    put(w, o + ORIGIN, p)
    put9(w, o + AXES, R)
    put(w, o + OMEGA, omega)
    put(w, o + VELOCITY, v)
    put(w, o + ALPHA, alpha)
    put(w, o + ACCELERATION, a)


@kernel
def rigid_site(h, f, w, s):
    """Motion of a site from that of its rigid link."""
    o, numbers = link_frame(h, site_link(h, s)), h[SITE_NUMBERS] + 12 * s
    R = at9(w, o + AXES)
    omega, alpha = at(w, o + OMEGA), at(w, o + ALPHA)
    arm = turn(R, at(f, numbers))
    swing = cross(omega, arm)
    v = add(at(w, o + VELOCITY), swing)
    a = add(at(w, o + ACCELERATION), add(cross(alpha, arm), cross(omega, swing)))
    p = add(at(w, o + ORIGIN), arm)
    _store(w, site_frame(h, s), p, product(R, at9(f, numbers + 3)), omega, v, alpha, a)


def compose(joint_motion: Callable, port_site: Callable, inboard: Callable) -> Callable:
    """The kernel that moves everything.

    joint_motion(kind, w, x, u, du, joint, rate); port_site adds the deformation of a flexible
    link to a site; inboard steps from the inboard joint frame to a flexible link's frame.
    """

    @kernel
    def place(h, f, w, i):
        """Link i from its inboard site, which must be up to date."""
        s, j, c0 = site_frame(h, i - 1), h[JOINT], link(h, i, C0)
        q = link(h, i, Q0)
        joint_motion(link(h, i, JOINT_KIND), w, h[X] + q, h[U] + c0, h[DU] + c0, j, h[POSITION_RATE] + q)
        F = at9(w, s + AXES)
        omega_F, alpha_F = at(w, s + OMEGA), at(w, s + ALPHA)
        arm, turning = turn(F, at(w, j + J_POSITION)), turn(F, at(w, j + J_OMEGA))
        sliding = turn(F, at(w, j + J_VELOCITY))
        p, swing = add(at(w, s + ORIGIN), arm), cross(omega_F, arm)
        v = add(at(w, s + VELOCITY), add(swing, sliding))
        alpha = add(alpha_F, add(turn(F, at(w, j + J_ALPHA)), cross(omega_F, turning)))
        a = add(at(w, s + ACCELERATION), add(cross(alpha_F, arm), cross(omega_F, swing)))
        a = add(a, add(scale(2.0, cross(omega_F, sliding)), turn(F, at(w, j + J_ACCELERATION))))
        for k in range(link(h, i, N_SPEEDS)):
            o = column(h, c0 + k)
            angular = turn(F, at(w, j + J_COLUMNS + 6 * k))
            put(w, o, angular)
            put(w, o + 3, add(turn(F, at(w, j + J_COLUMNS + 6 * k + 3)), cross(p, angular)))
        omega, R = add(omega_F, turning), product(F, at9(w, j + J_ROTATION))
        if link(h, i, FLEX) >= 0:
            p, R, omega, v, alpha, a = inboard(h, f, w, i, p, R, omega, v, alpha, a)
        _store(w, link_frame(h, i), p, R, omega, v, alpha, a)

    @kernel
    def locate(h, f, w, s):
        """Site s from its link."""
        if site_port(h, s) >= 0:
            port_site(h, f, w, s)
        else:
            rigid_site(h, f, w, s)

    @kernel
    def kinematics(h, f, w):
        """All links and sites: positions from X, velocities from U, accelerations from DU.

        With the known part of the accelerations in DU this gives the acceleration bias; with the
        whole of them, the accelerations. Gravity is an upward acceleration of the ground.
        """
        put(w, link_frame(h, 0) + ACCELERATION, scale(-1.0, at(f, h[GRAVITY])))
        for i in range(1, h[N_LINKS]):
            locate(h, f, w, i - 1)
            place(h, f, w, i)
        for s in range(h[N_LINKS] - 1, h[N_SITES]):
            locate(h, f, w, s)

    return kinematics
