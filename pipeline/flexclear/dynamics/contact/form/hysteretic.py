r"""Damping proportional to the elastic force: :math:`F_N = K\,\delta^n(1 + a\,\dot\delta/\dot\delta^{(-)})`.

The force is never negative: it is zero where the surfaces separate faster than the impact rate over a.
Source: Hunt & Crossley (1975), J. Applied Mechanics 42, 440-445.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexclear.dynamics.contact.form.elastic import depth, power, stored
from flexclear.dynamics.specialise.symbols import larger

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Numbers

__all__ = ["depth", "force", "stored"]


def force(depth: Any, rate: Any, impact_rate: Any, law: Numbers) -> tuple[Any, Any]:
    """Return elastic and damping force [N], sum >= 0; impact_rate: `rate` at the start of this contact [m/s], > 0.

    The law's damping is a.
    """
    elastic = law.stiffness * power(depth, law.exponent)
    return elastic, larger(-elastic, elastic * (law.damping * rate / impact_rate))
