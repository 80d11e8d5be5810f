"""When the iterations of a simplified Newton method may end.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.8.
"""

from __future__ import annotations

from pipeline.dynamics.kernels import kernel

#: what is left may be this share of the tolerance, or ten roundings if that is more
SHARE, ROUNDING = 1e-2, 2.2e-15
#: a first correction this far below the limit needs no second one to know how fast they fall
SMALL = 1e-3


@kernel
def limit(rtol):
    """Norm of what may be left, in units of the tolerance."""
    return max(SHARE, ROUNDING / rtol)


@kernel
def converged(k, norm, last_norm, rtol):
    """1 when correction k (norm in units of the tolerance) was the last one, -1 when it is hopeless, else 0."""
    enough = limit(rtol)
    if not norm <= 1e300:
        return -1
    if k == 0:
        return 1 if norm <= SMALL * enough else 0
    rate = norm / last_norm
    if rate < 1.0 and rate / (1.0 - rate) * norm < enough:
        return 1
    if rate >= 1.0:
        return 1 if norm <= enough else -1
    return 0
