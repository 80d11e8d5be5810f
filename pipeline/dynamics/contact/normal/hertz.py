r"""Elastic contact without loss.

.. math:: F_N = K\,\delta^n

Source: Hertz (1882); Wang & Wang (2019), eq. (25) with c_r = 1. Valid while the contact area is
small against the radii.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.scene.parts import NormalLaw
from pipeline.dynamics.vectors import kernel


@kernel
def power(depth, exponent):
    """depth^exponent for depth >= 0, fast for the Hertzian 3/2."""
    return depth * np.sqrt(depth) if exponent == 1.5 else depth**exponent


@kernel
def force(depth, rate, impact_rate, p):
    """Normal force [N], >= 0; depth [m] >= 0, rate and impact_rate [m/s]; p = (K, n, -, -)."""
    return p[0] * power(depth, p[1])


@kernel
def stored(depth, p):
    """Energy [J] that the elastic part of the force can give back."""
    return p[0] * depth * power(depth, p[1]) / (p[1] + 1.0)


class Hertz:
    """See the module's text."""

    force = staticmethod(force)
    stored = staticmethod(stored)

    @staticmethod
    def parameters(law: NormalLaw, stiffness: float) -> tuple[float, float, float, float]:
        """K [N/m^n], n, and two unused numbers."""
        return (stiffness, law.exponent, 0.0, 0.0)
