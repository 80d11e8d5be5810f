"""Motion of links and sites from the coordinates, along the spanning tree, in world axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.bodies.rigid import FlexibleBodies
from flexclear.dynamics.choice import choose
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, add, cross, product, scale, turn


@kernel
def _store(frame, p, R, omega, v, alpha, a):
    frame.origin, frame.axes = p, R
    frame.omega, frame.velocity = omega, v
    frame.alpha, frame.acceleration = alpha, a


@kernel
def rigid_site(d, s):
    """Compute the motion of a site from that of its rigid link; return the vector to it from the link's origin."""
    frame, site = d.link_frames[d.sites[s].link], d.site_numbers[s]
    R, omega, alpha = frame.axes, frame.omega, frame.alpha
    arm = turn(R, site.origin)
    swing = cross(omega, arm)
    v = add(frame.velocity, swing)
    a = add(frame.acceleration, add(cross(alpha, arm), cross(omega, swing)))
    _store(d.site_frames[s], add(frame.origin, arm), product(R, site.axes), omega, v, alpha, a)
    return arm


def make_kinematics(joints: tuple[Any, ...], tree: Any, flexible: FlexibleBodies) -> Callable:
    """Build the kernel kinematics(d), which computes the motion of all links and sites.

    joints: modules of the joint types present.  tree: the module that factors the mass matrix; its localise(d, k,
    angular, linear) is called with each column about its joint's frame, its step(d, i, arm) for each link with the
    vector from its parent's origin to its joint's frame.  flexible: kernels of the flexible bodies.
    """
    joint_motion = choose(tuple(joint.motion for joint in joints))
    position_rate = choose(tuple(joint.position_rate for joint in joints))
    localise, step = tree.localise, tree.step
    deform, inboard, port_site = flexible.deform, flexible.inboard, flexible.site

    @kernel
    def place(d, i, way):
        """Compute link i from its inboard site, which must be up to date; way: vector to there from its parent's
        origin.

        The relative twist is S u in the axes of the joint's first frame F, its rate S u' + bias.
        """
        link, base = d.links[i], d.site_frames[i - 1]
        c0, x = link.c0, d.at_x + link.q0
        R_FG, p_FG, bias_angular, bias_linear = joint_motion(link.joint, d.w, x, d.at_u + c0, d.at_subspace)
        position_rate(link.joint, d.w, x, d.at_u + c0, d.at_position_rate + link.q0)
        F, omega_F, alpha_F = base.axes, base.omega, base.alpha
        arm = turn(F, p_FG)
        p, swing = add(base.origin, arm), cross(omega_F, arm)
        turning, sliding, growing, speeding = ZERO, ZERO, turn(F, bias_angular), turn(F, bias_linear)
        for k in range(link.n_speeds):
            column, rate, second = d.columns[c0 + k], d.u[c0 + k], d.du[c0 + k]
            angular, linear = turn(F, d.subspace[k].angular), turn(F, d.subspace[k].linear)
            column.angular, column.linear = angular, add(linear, cross(p, angular))
            localise(d, c0 + k, angular, linear)
            turning, sliding = add(turning, scale(rate, angular)), add(sliding, scale(rate, linear))
            growing, speeding = add(growing, scale(second, angular)), add(speeding, scale(second, linear))
        step(d, i, add(way, arm))
        v = add(base.velocity, add(swing, sliding))
        alpha = add(alpha_F, add(growing, cross(omega_F, turning)))
        a = add(base.acceleration, add(cross(alpha_F, arm), cross(omega_F, swing)))
        a = add(a, add(scale(2.0, cross(omega_F, sliding)), speeding))
        omega, R = add(omega_F, turning), product(F, R_FG)
        if link.flex >= 0:
            p, R, omega, v, alpha, a = inboard(d, i, p, R, omega, v, alpha, a)
        _store(d.link_frames[i], p, R, omega, v, alpha, a)

    @kernel
    def locate(d, s):
        """Compute site s from its link; return the vector to it from the link's origin."""
        return port_site(d, s) if d.sites[s].port >= 0 else rigid_site(d, s)

    @kernel
    def kinematics(d):
        """Compute all links and sites: positions from X, velocities from U, accelerations from DU.

        With the known part of the accelerations in DU this gives the acceleration bias; with the
        whole of them, the accelerations. Gravity is an upward acceleration of the ground.
        """
        ground = d.link_frames[0]
        ground.acceleration = scale(-1.0, d.gravity[0].acceleration)
        deform(d)
        for i in range(1, d.n_links):
            place(d, i, locate(d, i - 1))
        for s in range(d.n_links - 1, d.n_sites):
            locate(d, s)

    return kinematics
