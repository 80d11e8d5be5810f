r"""Spring and damper on the line between two origins.

.. math:: F = k\,(l - l_0) + c\,\dot l

pulls the ends together. Where the ends coincide the line has no direction: there the force is zero,
its limit for :math:`l_0 = 0` and :math:`c = 0`; otherwise a start there is refused.
"""

from __future__ import annotations

from flexclear.dynamics.loads.given import Given, Load, line
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import ZERO, Wrench
from flexclear.scene.loads import SpringDamper


def apply(given: Given) -> Load:
    """Return the force; its part -k r, which needs no direction, keeps its slope where the ends coincide."""
    (stiffness, damping, free), (length, rate, direction, r) = given.numbers, line(given)
    stretch, damped = length - free, damping * rate
    wrench = Wrench(ZERO, (stiffness * free - damped) * direction - stiffness * r)
    return Load(wrench, lost=damped * rate, stored=0.5 * stiffness * stretch * stretch)


def row(load: SpringDamper, path: str) -> Row:
    """Return the load's row: stiffness [N/m], damping [N s/m], free length [m]."""
    return Row(frames=load.between, numbers=(load.stiffness, load.damping, load.free_length or 0.0))
