r"""A spring and a damper in parallel: :math:`F_N = \max(0, K\,\delta + C\,\dot\delta)`.

The force jumps by C times the approach speed where the contact begins. The contact ends where the force
would begin to pull, while the surfaces still overlap; the energy then left in the spring is lost.
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel


@kernel
def force(depth, rate, impact_rate, law):
    """Return elastic and damping force [N], sum >= 0; the law's damping is C."""
    elastic = law.stiffness * depth
    return elastic, max(-elastic, law.damping * rate)


@kernel
def stored(depth, law):
    """Return the energy [J] that the spring stores."""
    return 0.5 * law.stiffness * depth * depth
