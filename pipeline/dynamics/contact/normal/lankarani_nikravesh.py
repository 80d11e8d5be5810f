r"""Hertzian contact whose damping is set by the coefficient of restitution.

.. math:: F_N = K\,\delta^n \left[1 + \tfrac34 (1-c_r^2)\,\dot\delta/\dot\delta^{(-)}\right]

Meant for c_r near 1: a free impact asked for 0.9 returns 0.913, for 0.5 it returns 0.725
(:math:`\ln[(1+a)/(1-ae)] = a(1+e)` with :math:`a = \tfrac34(1-c_r^2)`, any K, n and mass).
Source: Wang & Wang (2019), eq. (25), after Lankarani & Nikravesh (1990).
"""

from __future__ import annotations

from pipeline.core.scene.parts import NormalLaw
from pipeline.dynamics.contact.normal.hertz import power, stored
from pipeline.dynamics.vectors import kernel


@kernel
def force(depth, rate, impact_rate, p):
    """Normal force [N], never pulling; impact_rate: `rate` when this contact began [m/s], > 0.

    p = (K, n, 3 (1 - c_r^2) / 4, -).
    """
    return max(0.0, p[0] * power(depth, p[1]) * (1.0 + p[2] * rate / impact_rate))


class LankaraniNikravesh:
    """See the module's text."""

    force = staticmethod(force)
    stored = staticmethod(stored)

    @staticmethod
    def parameters(law: NormalLaw, stiffness: float) -> tuple[float, float, float, float]:
        """K [N/m^n], n, hysteresis factor, and an unused number; ValueError without c_r."""
        if law.restitution is None:
            raise ValueError("the law 'lankarani-nikravesh' needs a restitution")
        return (stiffness, law.exponent, 0.75 * (1.0 - law.restitution**2), 0.0)
