r"""A spring and a damper side by side: :math:`F_N = \max(0, K\,\delta + C\,\dot\delta)`.

The force jumps by C times the approach speed where the contact begins. It ends where it would
begin to pull, while the surfaces still overlap; what the spring holds then is lost.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def force(depth, rate, impact_rate, law):
    """Elastic and damping force [N], together >= 0; the law's damping is C."""
    elastic = law.stiffness * depth
    return elastic, max(-elastic, law.damping * rate)


@kernel
def stored(depth, law):
    """Energy [J] that the spring can give back."""
    return 0.5 * law.stiffness * depth * depth
