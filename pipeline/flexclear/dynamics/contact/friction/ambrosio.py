r"""Coulomb friction with a ramp: none below v_0, a linear rise, the full coefficient from v_1 on.

.. math:: F_t = -\mu_d\,c\,F_n\,v_t/|v_t|, \quad c = \min(1, \max(0, (|v_t| - v_0)/(v_1 - v_0)))

The law has no sticking: a body on a slope creeps at a speed between v_0 and v_1.
Source: Ambrosio (2003), Virtual Nonlinear Multibody Systems, NATO ASI 103, 57-81; Flores et al.
(2008), Kinematics and Dynamics of Multibody Systems with Imperfect Joints, sec. 3.4.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.friction.law import Friction, sliding
from flexclear.dynamics.specialise.symbols import larger, smaller


def coefficient(speed: Any, p: Any) -> Any:
    """Return mu [-] at the sliding speed [m/s] >= 0; p = (mu_d, v_0, v_1, -, -, -)."""
    return p[0] * smaller(1.0, larger(0.0, (speed - p[1]) / (p[2] - p[1])))


LAW = Friction(
    sliding(coefficient),
    constants=lambda law: (law.dynamic, law.v0, law.v1),
    kinks=lambda law: (law.v0, law.v1),  # the coefficient's slope jumps
)
