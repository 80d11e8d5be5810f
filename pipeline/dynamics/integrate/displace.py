"""Positions after a displacement, given as one number per speed: the joints' own way to add it.

The displacement is the constant speed of a motion of unit duration, qdot = N(q) u, which is followed by
one step of order 4: exact for translations and single angles, and for quaternions to 3e-4 times the fifth power of
the angle, which is far below what a method of second order leaves.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.tables import (
    C0,
    DU,
    FLEX_C0,
    FLEX_Q0,
    JOINT,
    JOINT_KIND,
    N_FLEX,
    N_LINKS,
    N_MODES,
    NQ,
    NV,
    POSITION_RATE,
    Q0,
    U,
    X,
    flex,
    link,
)
from pipeline.dynamics.vectors import kernel


def compose(joint_motion: Callable) -> Callable:
    """The kernel displace(h, w, y, displacement, out, total); places in w, `total` is scratch of NQ floats."""

    @kernel
    def rates(h, w):
        """Position rates at the positions in X and the speeds in U."""
        for i in range(1, h[N_LINKS]):
            q, c = link(h, i, Q0), link(h, i, C0)
            joint_motion(link(h, i, JOINT_KIND), w, h[X] + q, h[U] + c, h[DU] + c, h[JOINT], h[POSITION_RATE] + q)
        for k in range(h[N_FLEX]):
            q, c = flex(h, k, FLEX_Q0), flex(h, k, FLEX_C0)
            for j in range(flex(h, k, N_MODES)):
                w[h[POSITION_RATE] + q + j] = w[h[U] + c + j]

    @kernel
    def displace(h, w, y, displacement, out, total):
        x, rate = h[X], h[POSITION_RATE]
        for k in range(h[NV]):
            w[h[U] + k] = w[displacement + k]
        for k in range(h[NQ]):
            w[x + k] = w[y + k]
            w[total + k] = 0.0
        for stage in range(4):
            rates(h, w)
            weight = (1.0 if stage in (0, 3) else 2.0) / 6.0
            reach = 0.5 if stage < 2 else 1.0
            for k in range(h[NQ]):
                w[total + k] += weight * w[rate + k]
                w[x + k] = w[y + k] + reach * w[rate + k]
        for k in range(h[NQ]):
            w[out + k] = w[y + k] + w[total + k]

    return displace
