"""Norms of states and errors in units of the tolerance.

Variables form groups, such as the components of one velocity. A group's scale is the tolerance times its floor plus
the length of its vector; the largest component would depend on the axes of a scene.

Independent mechanisms in one scene have floors of their own sizes, and the square of the norm is the sum of the squares
of their separate norms: each is at least as accurate as without the others.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.4.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.kernels import kernel


@kernel
def set_error_scales(d, y):
    """Set the scale of each group from the states at both ends of the step: in Y and at index y of w."""
    scales, o = d.at_magnitude, d.at_y
    for g in range(d.n_groups):
        d.w[scales + g] = 0.0
    for c in range(d.ny):
        g = scales + d.groups[c].group
        d.w[g] += 0.5 * (d.w[y + c] * d.w[y + c] + d.w[o + c] * d.w[o + c])
    for g in range(d.n_groups):
        o = d.floors[g]
        allowed = d.rtol * (o.magnitude + np.sqrt(d.w[scales + g]))
        d.w[scales + g] = allowed * o.share


@kernel
def error_scale(d, c):
    """Return the error of variable c that the tolerance allows."""
    return d.magnitude[d.groups[c].group]


@kernel
def scaled_norm(d, a):
    """Return the root mean square, in units of the scales, of the variables in w from index a on."""
    total = 0.0
    for c in range(d.ny):
        share = d.w[a + c] / error_scale(d, c)
        total += share * share
    return np.sqrt(total / d.ny)


@kernel
def finite(d, a):
    """Return True when the variables in w from index a on are finite."""
    result = True
    for c in range(d.ny):
        result &= abs(d.w[a + c]) <= 1e300
    return result
