r"""Restitution of a normal law: closed forms of a free impact.

For :math:`F = K\delta^n(1 + a\,\dot\delta/\dot\delta_0)` the ratio e of rebound to approach speed obeys
:math:`\ln[(1+a)/(1-ae)] = a(1+e)`, that is psi(a) = psi(-ae) with psi(x) = x - ln(1 + x),
for any K, n, mass and speed.
Source: Gonthier, McPhee, Lange & Piedboeuf (2004), Multibody System Dynamics 11, 209-233, eq. (29);
Zhang & Sharf (2009), J. Applied Mechanics 76, 034501.
"""

from __future__ import annotations

import math
from collections.abc import Callable

#: largest y of psi(-y); beyond it 1 - y is rounding
NEAREST = 1.0 - 2.0**-53
#: below this the first term of the series, e = 1 - 2 a / 3, is as exact as a root, where rounding cancels digits
SLIGHT_DAMPING = 1e-7


def psi(x: float) -> float:
    """Return x - ln(1 + x) without cancellation."""
    if abs(x) > 0.05:
        return x - math.log1p(x)
    return sum((-1) ** k * x**k / k for k in range(2, 14))  # 0.05^14 / 14 is below rounding of x^2 / 2


def delivered(a: float) -> float:
    """Return rebound over approach speed of a free impact with the factor a >= 0."""
    if a < SLIGHT_DAMPING:
        return 1.0 - 2.0 * a / 3.0
    level = psi(a)
    if level >= psi(-NEAREST):
        return 1.0 / a
    return root(lambda y: psi(-y) - level, 0.0, NEAREST) / a


def factor(e: float) -> float:
    """Return the factor a that delivers the restitution 0 < e <= 1; raise ValueError for 0, which none delivers."""
    if e <= 0.0:
        raise ValueError("no finite damping delivers a restitution of 0; request a small one, such as 0.01")
    if 1.0 - e < SLIGHT_DAMPING:
        return 1.5 * (1.0 - e)

    def defect(y: float) -> float:  # y = a e
        return psi(y / e) - psi(-y)

    if defect(NEAREST) >= 0.0:
        return NEAREST / e
    return root(defect, 0.5 * e * (1.0 - e), NEAREST) / e


def root(f: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of f between two arguments, to the last bit; raise ValueError for equal signs at both.

    Bisection: f takes a microsecond, importing `scipy.optimize` four tenths of the processor time of a short run.
    """
    rising, at_high = f(low) < 0.0, f(high)
    if f(low) == 0.0:
        return low
    if rising != (at_high > 0.0) and at_high != 0.0:
        raise ValueError(f"f has the same sign at {low:.6g} and at {high:.6g}")
    while low < (middle := low + 0.5 * (high - low)) < high:
        low, high = (middle, high) if (f(middle) < 0.0) == rising else (low, middle)
    return high


def linear_delivered(zeta: float) -> float:
    r"""Return rebound over approach of :math:`m\ddot\delta = -\max(0, K\delta + C\dot\delta)`, C = 2 zeta sqrt(K m).

    The contact ends where the force would begin to pull:
    :math:`e = \exp[-\tan\varphi\,(\pi - 2\varphi)]`, :math:`\sin\varphi = \zeta`, and
    :math:`\exp[-2\psi\coth\psi]`, :math:`\cosh\psi = \zeta`, above 1.
    Source: Schwager & Poeschel (2007), Granular Matter 9, 465-469, eq. (21), in one angle.
    """
    if zeta < 1.0:
        angle = math.asin(zeta)
        return math.exp(-math.tan(angle) * (math.pi - 2.0 * angle))
    if zeta == 1.0:
        return math.exp(-2.0)
    rate = math.acosh(zeta)
    return math.exp(-2.0 * rate / math.tanh(rate))


def damping_ratio(e: float) -> float:
    """Return zeta with linear_delivered(zeta) = e, 0 < e <= 1; raise ValueError for 0."""
    if e <= 0.0:
        raise ValueError("no finite damping delivers a restitution of 0; request a small one, such as 0.01")
    # beyond zeta = 1 the restitution falls below (2 zeta)^-2, so that this bracket suffices
    return root(lambda z: linear_delivered(z) - e, 0.0, 2.0 + e**-0.5)
