r"""Force of a pin in a tight journal: :math:`F = K\,\delta\sqrt{\delta/(2(c+\delta))}`.

Source: Liu, Zhang & Yang (2007), Mechanism and Machine Theory 42, 183-197.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.form.damped import damped, inverse
from flexclear.dynamics.contact.form.energy import stored_by
from flexclear.dynamics.specialise.symbols import sqrt


def elastic(depth: Any, law: Any) -> Any:
    """Return the elastic force [N]; the law's values are K [N/m] and the clearance c [m]."""
    return law.values[0] * depth * sqrt(0.5 * depth / (law.values[1] + depth))


force, stored, depth = damped(elastic), stored_by(elastic), inverse(elastic)
