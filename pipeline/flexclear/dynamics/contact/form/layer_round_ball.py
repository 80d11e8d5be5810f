r"""Force of a ball whose socket has a thin elastic layer: :math:`F = K\delta^2(2+x)/(c+\delta)`.

The layer is compressed by :math:`(c+\delta)\cos\theta - c`, and :math:`x = c/(c+\delta)`.
Source: Johnson (1985), Contact Mechanics, sec. 4.3, for the layer.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.form.damped import damped, inverse
from flexclear.dynamics.contact.form.energy import stored_by


def elastic(depth: Any, law: Any) -> Any:
    """Return the elastic force [N]; the law's values are K [N/m] and the clearance c [m]."""
    far = law.values[1] + depth
    return law.values[0] * depth * depth * (2.0 + law.values[1] / far) / far


force, stored, depth = damped(elastic), stored_by(elastic), inverse(elastic)
