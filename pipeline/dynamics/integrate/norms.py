"""Sizes of states and errors in units of the tolerance.

Variables stand in groups, such as the components of one velocity. A group's scale is the tolerance times its floor plus
the length of its vector; the length, not the largest component, which would depend on the axes of a scene.

Independent mechanisms in one scene have floors of their own sizes, and the square of the norm is the sum of the squares
of what their norms would be alone: each is at least as accurate as without the others.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.4.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def set_error_scales(h, f, w, y):
    """Scale of each group from the states at both ends of the step: in Y and from place y of w."""
    scales, o = h[m.MAGNITUDE], h[m.Y]
    for g in range(h[m.N_GROUPS]):
        w[scales + g] = 0.0
    for c in range(h[m.NY]):
        g = scales + m.GROUPS.group(h, c)
        w[g] += 0.5 * (w[y + c] * w[y + c] + w[o + c] * w[o + c])
    for g in range(h[m.N_GROUPS]):
        o = m.FLOORS.row(h, g)
        allowed = w[h[m.CONTROL] + m.RTOL] * (f[o + m.FLOORS.magnitude] + np.sqrt(w[scales + g]))
        w[scales + g] = allowed * f[o + m.FLOORS.share]


@kernel
def error_scale(h, w, c):
    """Error of variable c that the tolerance allows."""
    return w[h[m.MAGNITUDE] + m.GROUPS.group(h, c)]


@kernel
def scaled_norm(h, w, a):
    """Root mean square, in units of the scales, of what w holds for each variable from place a on."""
    total = 0.0
    for c in range(h[m.NY]):
        share = w[a + c] / error_scale(h, w, c)
        total += share * share
    return np.sqrt(total / h[m.NY])


@kernel
def finite(h, w, a):
    """Whether w holds numbers only, for each variable, from place a on."""
    result = True
    for c in range(h[m.NY]):
        result &= abs(w[a + c]) <= 1e300
    return result
