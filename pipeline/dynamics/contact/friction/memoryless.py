"""Friction that depends on the present sliding speed alone: a coefficient against the sliding velocity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import dot, scale

#: speed [m/s] below which the coefficient rises in a straight line: at rest there is no force, but a slope
SLOWEST = 1e-290


def sliding(coefficient: Callable) -> Callable:
    """The kernel `traction` of a law whose coefficient(speed, p) >= 0 times the normal force is its force."""

    @kernel
    def traction(z, slip, f_n, p):
        speed = max(np.sqrt(dot(slip, slip)), SLOWEST)
        f_t = f_n * coefficient(speed, p)
        return scale(-f_t / speed, slip), f_t * speed, 0.0, (0.0, 0.0, 0.0)

    return traction
