r"""Force of a pin whose journal has a thin elastic layer: :math:`F = K(c+\delta)(z - \sin z)/2`.

The layer is compressed by :math:`(c+\delta)\cos\theta - c` up to :math:`\theta = z/2`.
Source: Johnson (1985), Contact Mechanics, sec. 4.3, for the layer.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.form.damped import damped, inverse
from flexclear.dynamics.contact.form.energy import stored_by
from flexclear.dynamics.specialise.symbols import arctan2, branch, sin, sqrt


def lag(z: Any) -> Any:
    """Return z - sin z for 0 <= z <= pi, without cancellation."""

    def series() -> Any:
        q, term, total = z * z, z * z * z / 6.0, 0.0
        for k in range(8):
            total = total + term
            term = -term * q / ((2 * k + 4) * (2 * k + 5))
        return total

    return branch(z > 1.0, lambda: z - sin(z), series)


def elastic(depth: Any, law: Any) -> Any:
    """Return the elastic force [N]; the law's values are K [N/m] and the clearance c [m]."""
    clearance = law.values[1]
    half = arctan2(sqrt(depth * (2.0 * clearance + depth)), clearance)
    return 0.5 * law.values[0] * (clearance + depth) * lag(2.0 * half)


force, stored, depth = damped(elastic), stored_by(elastic), inverse(elastic)
