"""Integrals of elastic forces without a closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(20)
#: places in an interval of length 1, and weights: Gauss's formula in the third root of the penetration, which
#: integrates powers, whole or broken, to rounding
NODES = tuple(
    (u**3, 3.0 * u**2 * w) for u, w in zip((0.5 + 0.5 * _POINTS).tolist(), (0.5 * _WEIGHTS).tolist(), strict=True)
)


def integral(force: Callable) -> Callable:
    """Build the function (start, end, law) of the integral of force(depth, law)."""

    def over(start: Any, end: Any, law: Any) -> Any:
        total: Any = 0.0
        for place, weight in NODES:
            total = total + weight * force(start + place * (end - start), law)
        return total * (end - start)

    return over


def stored_by(force: Callable) -> Callable:
    """Build `stored` of a form from its elastic force(depth, law)."""
    over = integral(force)

    def stored(depth: Any, law: Any) -> Any:
        return over(0.0, depth, law)

    return stored
