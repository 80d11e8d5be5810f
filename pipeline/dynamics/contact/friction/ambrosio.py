r"""Coulomb friction with a ramp: none below v_0, a linear rise, the full coefficient from v_1 on.

.. math:: F_t = -\mu_d\,c\,F_n\,v_t/|v_t|, \quad c = \min(1, \max(0, (|v_t| - v_0)/(v_1 - v_0)))

It does not know sticking: a body on a slope creeps at a speed between v_0 and v_1.
Source: Ambrosio (2003), Virtual Nonlinear Multibody Systems, NATO ASI 103, 57-81; Flores et al.
(2008), Kinematics and Dynamics of Multibody Systems with Imperfect Joints, sec. 3.4.
"""

from __future__ import annotations

from flexclear.pipeline.core.scene import clearance
from flexclear.pipeline.dynamics.contact.friction.memoryless import sliding
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def coefficient(speed, p):
    """Mu [-] at the sliding speed [m/s] >= 0; p = (mu_d, v_0, v_1, -, -, -)."""
    return p[0] * min(1.0, max(0.0, (speed - p[1]) / (p[2] - p[1])))


traction = sliding(coefficient)


class Ambrosio:
    """See the module's text."""

    coefficient = staticmethod(coefficient)
    traction = staticmethod(traction)

    @staticmethod
    def parameters(law: clearance.Ambrosio) -> tuple[float, ...]:
        """mu_d [-], v_0, v_1 [m/s], and three unused numbers."""
        return (law.dynamic, law.v0, law.v1, 0.0, 0.0, 0.0)

    @staticmethod
    def stick_speed(law: clearance.Ambrosio) -> float:
        """The law has no regime of sticking."""
        return 0.0

    @staticmethod
    def kinks(law: clearance.Ambrosio) -> tuple[float, float]:
        """v_0, v_1 [m/s]: the coefficient's slope jumps."""
        return (law.v0, law.v1)

    @staticmethod
    def bristle(law: clearance.Ambrosio) -> float | None:
        """No memory."""
        return None
