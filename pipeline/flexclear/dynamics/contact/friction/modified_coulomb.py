r"""Coulomb friction made continuous: a cubic rise to mu_s at v_s, a cubic fall to mu_d at v_d.

.. math:: F_t = -\mu(|v_t|)\,F_n\,v_t/|v_t|

Eqs. (27) and (28) of the paper both have a minus sign. With both signs friction would drive the
sliding; with eq. (28) alone as the signed coefficient, friction dissipates. The reading
that dissipates is used here. Below v_s the coefficient is :math:`\tfrac12\mu_s(3y - y^3)`,
y = v/v_s; between v_s and v_d eq. (28) names its steps from the higher speed to the lower, which
is the same cubic. Below v_s is the regime that represents sticking.
Source: Wang & Wang (2019), eqs. (27)-(29).
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.friction.law import Friction, sliding
from flexclear.dynamics.specialise.symbols import branch


def coefficient(speed: Any, p: Any) -> Any:
    """Return mu [-] at the sliding speed [m/s] >= 0; p = (mu_s, mu_d, v_s, v_d, -, -).

    Source: Wang & Wang (2019), eqs. (27), (28), (29).
    """

    def rising() -> Any:
        y = speed / p[2]
        return 0.5 * p[0] * y * (3.0 - y * y)

    def falling() -> Any:
        y = (speed - p[2]) / (p[3] - p[2])
        return p[0] + (p[1] - p[0]) * y * y * (3.0 - 2.0 * y)

    return branch(speed >= p[3], lambda: p[1], lambda: branch(speed >= p[2], falling, rising))


LAW = Friction(
    sliding(coefficient),
    constants=lambda law: (law.static, law.dynamic, law.v_static, law.v_dynamic),
    stick_speed=lambda law: law.v_static,
    kinks=lambda law: (law.v_static, law.v_dynamic),  # the coefficient's curvature jumps
)
