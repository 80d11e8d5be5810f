r"""A spring and a damper in parallel: :math:`F_N = \max(0, K\,\delta + C\,\dot\delta)`.

The force jumps by C times the approach speed where the contact begins. The contact ends where the force
would begin to pull, while the surfaces still overlap; the energy then left in the spring is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexclear.dynamics.specialise.symbols import larger

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Numbers


def force(depth: Any, rate: Any, impact_rate: Any, law: Numbers) -> tuple[Any, Any]:
    """Return elastic and damping force [N], sum >= 0; the law's damping is C."""
    elastic = law.stiffness * depth
    return elastic, larger(-elastic, law.damping * rate)


def stored(depth: Any, law: Numbers) -> Any:
    """Return the energy [J] that the spring stores."""
    return 0.5 * law.stiffness * depth * depth


def depth(force: float, law: Numbers) -> float:
    """Return the depth [m] at which the spring's force is `force` [N]."""
    return force / law.stiffness
