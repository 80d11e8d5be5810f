r"""Normal force without loss: :math:`F_N = K\,\delta^n`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexclear.dynamics.specialise.symbols import branch, sqrt

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Numbers


def power(depth: Any, exponent: Any) -> Any:
    """Return depth^exponent for depth >= 0, fast for the Hertzian 3/2 and the linear 1."""

    def other() -> Any:
        return branch(exponent == 1.0, lambda: depth, lambda: depth**exponent)

    return branch(exponent == 1.5, lambda: depth * sqrt(depth), other)


def force(depth: Any, rate: Any, impact_rate: Any, law: Numbers) -> tuple[Any, Any]:
    """Return the elastic force [N] >= 0, and zero damping; depth [m] >= 0, rates [m/s]."""
    return law.stiffness * power(depth, law.exponent), 0.0


def stored(depth: Any, law: Numbers) -> Any:
    """Return the energy [J] that the elastic part of the force stores."""
    return law.stiffness * depth * power(depth, law.exponent) / (law.exponent + 1.0)


def depth(force: float, law: Numbers) -> float:
    """Return the depth [m] at which the elastic force is `force` [N], >= 0."""
    return float((force / law.stiffness) ** (1.0 / law.exponent))
