"""Positions after a displacement, given as one number per speed: the joints' own way to add it.

The displacement is the constant speed of a motion of unit duration, qdot = N(q) u, which is followed by
one step of order 4: exact for translations and single angles, and for quaternions to 3e-4 times the fifth power of
the angle, which is far below what a method of second order leaves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.choice import choose
from flexclear.pipeline.dynamics.kernels import kernel


def make_position_rates(joints: tuple[Any, ...]) -> Callable:
    """The kernel position_rates(h, w): rates of the positions in X at the speeds in U, modes included."""
    joint_rate = choose(tuple(joint.position_rate for joint in joints))

    @kernel
    def position_rates(h, w):
        for i in range(1, h[m.N_LINKS]):
            q, c = m.LINKS.q0(h, i), m.LINKS.c0(h, i)
            joint_rate(m.LINKS.joint(h, i), w, h[m.X] + q, h[m.U] + c, h[m.POSITION_RATE] + q)
        for k in range(h[m.N_FLEX]):
            q, c = m.FLEXES.q0(h, k), m.FLEXES.c0(h, k)
            for j in range(m.FLEXES.n_modes(h, k)):
                w[h[m.POSITION_RATE] + q + j] = w[h[m.U] + c + j]

    return position_rates


def make_retraction(joints: tuple[Any, ...]) -> Callable:
    """The kernel retract(h, w, y, displacement, out, total); places in w, `total` is scratch of NQ floats."""
    position_rates = make_position_rates(joints)

    @kernel
    def retract(h, w, y, displacement, out, total):
        x, rate = h[m.X], h[m.POSITION_RATE]
        for k in range(h[m.NV]):
            w[h[m.U] + k] = w[displacement + k]
        for k in range(h[m.NQ]):
            w[x + k] = w[y + k]
            w[total + k] = 0.0
        for stage in range(4):
            position_rates(h, w)
            weight = (1.0 if stage in (0, 3) else 2.0) / 6.0
            reach = 0.5 if stage < 2 else 1.0
            for k in range(h[m.NQ]):
                w[total + k] += weight * w[rate + k]
                w[x + k] = w[y + k] + reach * w[rate + k]
        for k in range(h[m.NQ]):
            w[out + k] = w[y + k] + w[total + k]

    return retract
