r"""Spring and damper on the line between two origins.

.. math:: F = k\,(l - l_0) + c\,\dot l

pulls the ends together. Where the ends coincide the line has no direction: there the force is zero,
its limit for :math:`l_0 = 0` and :math:`c = 0`; otherwise a start there is refused.
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import act, line, number
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import add, cross, scale, sub
from flexclear.scene.loads import SpringDamper


@kernel
def apply(d, k):
    """Apply the force of load k."""
    length, rate, along = line(d, k)
    p = d.site_frames[d.loads[k].b].origin
    r = sub(p, d.site_frames[d.loads[k].a].origin)
    stretch, damped = length - number(d, k, 2), number(d, k, 1) * rate
    # the part -k r, which needs no direction, keeps its slope where the ends coincide
    force = add(scale(-number(d, k, 0), r), scale(number(d, k, 0) * number(d, k, 2) - damped, along))
    stored = 0.5 * number(d, k, 0) * stretch * stretch
    act(d, k, cross(p, force), force, length, rate, stored, 0.0, damped * rate)


def row(load: SpringDamper, path: str) -> Row:
    """Return the load's row: stiffness [N/m], damping [N s/m], free length [m]."""
    return Row(frames=load.between, numbers=(load.stiffness, load.damping, load.free_length or 0.0))
