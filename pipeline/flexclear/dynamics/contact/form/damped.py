"""Damping in proportion to an elastic force, and the inverse of one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.contact.restitution import root
from flexclear.dynamics.specialise.symbols import larger


def damped(elastic: Callable) -> Callable:
    """Build `force` of a form whose damping is the law's `damping` times elastic(depth, law) times rate/impact_rate."""

    def force(depth: Any, rate: Any, impact_rate: Any, law: Any) -> tuple[Any, Any]:
        size = elastic(depth, law)
        return size, larger(-size, size * (law.damping * rate / impact_rate))

    return force


def inverse(elastic: Callable, within: float = 1e6) -> Callable[[float, Any], float]:
    """Build depth(force, law), the inverse of elastic(depth, law), by bisection; within: largest depth [m or rad].

    It raises ValueError for a force that is never reached.
    """

    def depth(force: float, law: Any) -> float:
        if force <= float(elastic(0.0, law)):
            return 0.0
        high = 1e-12
        while not elastic(high, law) >= force:
            high *= 4.0
            if high > within:
                raise ValueError(f"the normal force at rest never reaches {force:.3g} N")
        return root(lambda d: float(elastic(d, law)) - force, 0.0, high)

    return depth
