r"""Damping proportional to the elastic force: :math:`F_N = K\,\delta^n(1 + a\,\dot\delta/\dot\delta^{(-)})`.

The force is never negative: it is zero where the surfaces separate faster than the impact rate over a.
Source: Hunt & Crossley (1975), J. Applied Mechanics 42, 440-445.
"""

from __future__ import annotations

from flexclear.dynamics.contact.form.elastic import power, stored
from flexclear.dynamics.kernels import kernel

__all__ = ["force", "stored"]


@kernel
def force(depth, rate, impact_rate, law):
    """Return elastic and damping force [N], sum >= 0; impact_rate: `rate` at the start of this contact [m/s], > 0.

    The law's damping is a.
    """
    elastic = law.stiffness * power(depth, law.exponent)
    return elastic, max(-elastic, elastic * (law.damping * rate / impact_rate))
