"""Positions after a displacement, given as one number per speed, by each joint's own composition rule.

The displacement is the constant speed of a motion of unit duration, qdot = N(q) u, which is followed by
one step of order 4: exact for translations and single angles, and for quaternions to 3e-4 times the fifth power of
the angle, far below the error of a method of second order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.choice import choose
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel


def make_position_rates(joints: tuple[Any, ...]) -> Callable:
    """Build the kernel position_rates(d): rates of the positions in X at the speeds in U, modes included."""
    joint_rate = choose(tuple(joint.position_rate for joint in joints))

    @kernel
    def position_rates(d):
        for i in range(1, d.n_links):
            link = d.links[i]
            x, u, rate = d.at_x + link.q0, d.at_u + link.c0, d.at_position_rate + link.q0
            joint_rate(link.joint, d.w, x, u, rate)
        for k in range(d.n_flex):
            body = d.flexes[k]
            for j in range(body.n_modes):
                d.position_rate[body.q0 + j] = d.u[body.c0 + j]

    return position_rates


def make_retraction(joints: tuple[Any, ...]) -> Callable:
    """Build the kernel retract(h, f, w, n, y, displacement, out, total); the last four are indices in w.

    total: scratch of NQ floats.
    """
    position_rates = make_position_rates(joints)

    @kernel
    def retract(h, f, w, n, y, displacement, out, total):
        d = data(h, f, w, n)
        for k in range(d.nv):
            d.u[k] = w[displacement + k]
        for k in range(d.nq):
            d.x[k] = w[y + k]
            w[total + k] = 0.0
        for stage in range(4):
            position_rates(d)
            weight = (1.0 if stage in (0, 3) else 2.0) / 6.0
            reach = 0.5 if stage < 2 else 1.0
            for k in range(d.nq):
                w[total + k] += weight * d.position_rate[k]
                d.x[k] = w[y + k] + reach * d.position_rate[k]
        for k in range(d.nq):
            w[out + k] = w[y + k] + w[total + k]

    return retract
