r"""LuGre friction: bristles that bend, slip and spring back, as a state.

.. math::
    \dot z = v_t - \sigma_0\frac{|v_t|}{g}z, \quad g = \mu_d + (\mu_s-\mu_d)e^{-(v_t/v_S)^2}, \quad
    F_t = -F_n\left[\sigma_0 z + k(\sigma_1 e^{-(v_t/v_S)^2}\dot z + \sigma_2 v_t)\right]

in proportion to the normal force, so that the force ends with the contact and sigma_0 |z| <= mu_s always.
The damping fades with speed: a constant one would drive the sliding at high speed. k <= 1 is the
largest fraction of the damping that keeps the force below mu_s F_n. The bristles hold
sigma_0 F_n z^2 / 2; they are fixed on the socket's surface, turn with it, and stay in the tangent plane
by parallel transport. They are straight where a contact begins.
Source: Canudas de Wit, Olsson, Astrom & Lischinsky (1995), IEEE Trans. Automatic Control 40,
419-425, eqs. (1)-(5); damping that fades: Olsson (1996), thesis, Lund, sec. 4.3.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.friction.law import Friction
from flexclear.dynamics.specialise.symbols import branch, exp, larger, sqrt
from flexclear.dynamics.vectors import Vector, dot


def damping_share(elastic: Vector, damping: Vector, limit: Any) -> Any:
    """Return the largest k in [0, 1] with |elastic + k damping| <= limit, given |elastic| <= limit."""
    total = elastic + damping

    def part() -> Any:
        a, b, c = dot(damping, damping), dot(elastic, damping), dot(elastic, elastic) - limit * limit
        # a = 0: rounding exceeds the limit
        return branch(a == 0.0, lambda: 0.0, lambda: larger(0.0, (sqrt(larger(0.0, b * b - a * c)) - b) / a))

    return branch(dot(total, total) <= limit * limit, lambda: 1.0, part)


def traction(z: Vector, slip: Vector, f_n: Any, p: Any) -> tuple[Vector, Any, Any, Vector]:
    """Return force, loss, stored energy and rate of the bristles.

    p: mu_s, mu_d [-], v_S [m/s], sigma_0 [1/m], sigma_1, sigma_2 [s/m].
    """
    square = dot(slip, slip)
    fading = exp(-square / (p[2] * p[2]))
    relaxing = p[3] * sqrt(square) / (p[1] + (p[0] - p[1]) * fading)
    z_rate = slip - relaxing * z
    elastic = p[3] * z
    damping = p[4] * fading * z_rate + p[5] * slip
    share = damping_share(elastic, damping, p[0])
    force = -f_n * (elastic + share * damping)
    # sigma_0 z . v less the rate of the stored energy at constant F_n, plus the loss of the damping
    loss = f_n * (relaxing * p[3] * dot(z, z) + share * dot(damping, slip))
    return force, larger(0.0, loss), 0.5 * p[3] * f_n * dot(z, z), z_rate


LAW = Friction(
    traction,
    constants=lambda law: (
        *(law.static, law.dynamic, law.v_stribeck),
        *(law.bristle_stiffness, law.bristle_damping, law.viscous),
    ),
    stick_speed=lambda law: law.v_stribeck,  # far below it the bristles carry the load, far above they slip
    bristle=lambda law: law.static / law.bristle_stiffness,
)
