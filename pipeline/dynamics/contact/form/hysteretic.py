r"""Damping in proportion to the elastic force: :math:`F_N = K\,\delta^n(1 + a\,\dot\delta/\dot\delta^{(-)})`.

The force is never negative: where the surfaces part faster than the impact rate over a, it is zero.
Source: Hunt & Crossley (1975), J. Applied Mechanics 42, 440-445.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.contact.form.elastic import power, stored
from flexclear.pipeline.dynamics.kernels import kernel

__all__ = ["force", "stored"]


@kernel
def force(depth, rate, impact_rate, law):
    """Elastic and damping force [N], together >= 0; impact_rate: `rate` when this contact began [m/s], > 0.

    The law's damping is a.
    """
    elastic = law.stiffness * power(depth, law.exponent)
    return elastic, max(-elastic, elastic * (law.damping * rate / impact_rate))
