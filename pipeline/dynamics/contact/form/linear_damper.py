r"""A spring and a damper side by side: :math:`F_N = \max(0, K\,\delta + C\,\dot\delta)`.

The force jumps by C times the approach speed where the contact begins. It ends where it would
begin to pull, while the surfaces still overlap; what the spring holds then is lost.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def force(depth, rate, impact_rate, p):
    """Elastic and damping force [N], together >= 0; p = (K, 1, C, -)."""
    elastic = p[0] * depth
    return elastic, max(-elastic, p[2] * rate)


@kernel
def stored(depth, p):
    """Energy [J] that the spring can give back."""
    return 0.5 * p[0] * depth * depth
