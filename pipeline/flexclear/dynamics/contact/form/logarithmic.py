r"""Force of two cylinders whose compression is :math:`\delta = cF\ln(G/F)`, beyond a limit a straight line.

The formula has its largest compression :math:`\delta_m = cG/e` at :math:`F = G/e`, where its stiffness is infinite.
From half that force on the force goes on along its tangent. With :math:`F = (G/e)e^{-u}`, :math:`u - \ln(1+u) =
-\ln(\delta/\delta_m)`, which Newton's method solves to rounding from a bound of the root.
Source: Chatzigeorgiou (2013), IEEE Communications Letters 17, 1505-1508, of Lambert's function.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics.contact.form.damped import damped
from flexclear.dynamics.specialise.symbols import branch, exp, log, smaller, sqrt

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Numbers

#: u at the limit, and the compression there as a fraction of the largest
LIMIT = float(np.log(2.0))
LIMIT_DEPTH = 0.5 * (1.0 + LIMIT)


def exponent(ratio: Any) -> Any:
    """Return u for a compression over the largest, at most LIMIT_DEPTH."""
    level = -log(ratio)
    u = sqrt(2.0 * level) + 0.8 * level
    for _ in range(4):
        u = u - (u - log(1.0 + u) - level) * (1.0 + u) / u
    return u


def elastic(depth: Any, law: Any) -> Any:
    """Return the elastic force [N]; values: a force [N], and the largest compression [m], which is there."""
    force, ratio = law.values[0], depth / law.values[1]

    def loaded() -> Any:
        beyond = 0.5 + (ratio - LIMIT_DEPTH) / LIMIT
        return branch(ratio > LIMIT_DEPTH, lambda: force * beyond, lambda: force * exp(-exponent(ratio)))

    return branch(depth > 0.0, loaded, lambda: 0.0)


force = damped(elastic)


def stored(depth: Any, law: Any) -> Any:
    """Return the stored energy [J]."""
    ratio = smaller(depth / law.values[1], LIMIT_DEPTH)
    y, over = elastic(ratio * law.values[1], law) / law.values[0], depth / law.values[1] - ratio
    return law.values[1] * law.values[0] * (0.5 * y * ratio - 0.25 * y * y + over * (0.5 + 0.5 * over / LIMIT))


def depth(force: float, law: Numbers) -> float:
    """Return the depth [m] at which the elastic force is `force` [N]."""
    y = force / law.values[0]
    if y > 0.5:
        return float(law.values[1] * (LIMIT_DEPTH + (y - 0.5) * LIMIT))
    return float(law.values[1] * y * (1.0 - np.log(y))) if y > 0.0 else 0.0
