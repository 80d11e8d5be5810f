r"""Coulomb friction that a hyperbolic tangent smooths through rest.

.. math:: F_t = -\mu_d\,\tanh(|v_t|/v_s)\,F_n\,v_t/|v_t|

It does not know sticking: a body on a slope creeps.
Source: Andersson, Soderberg & Bjorklund (2007), Tribology International 40, 580-587.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.scene import clearance
from flexclear.pipeline.dynamics.contact.friction.memoryless import sliding
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def coefficient(speed, p):
    """Mu [-] at the sliding speed [m/s] >= 0; p = (mu_d, v_s, -, -, -, -)."""
    return p[0] * np.tanh(speed / p[1])


traction = sliding(coefficient)


class SmoothCoulomb:
    """See the module's text."""

    coefficient = staticmethod(coefficient)
    traction = staticmethod(traction)

    @staticmethod
    def parameters(law: clearance.SmoothCoulomb) -> tuple[float, ...]:
        """mu_d [-], v_s [m/s], and four unused numbers."""
        return (law.dynamic, law.v_smooth, 0.0, 0.0, 0.0, 0.0)

    @staticmethod
    def stick_speed(law: clearance.SmoothCoulomb) -> float:
        """The law has no regime of sticking."""
        return 0.0

    @staticmethod
    def kinks(law: clearance.SmoothCoulomb) -> tuple[float, float]:
        """The law is smooth."""
        return (0.0, 0.0)

    @staticmethod
    def bristle(law: clearance.SmoothCoulomb) -> float | None:
        """No memory."""
        return None
