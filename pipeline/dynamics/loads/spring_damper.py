r"""Spring and damper on the line between two origins.

.. math:: F = k\,(l - l_0) + c\,\dot l

pulling the ends together. Where the ends meet the line has no direction: there the force is zero,
which is its limit when :math:`l_0 = 0` and :math:`c = 0`; otherwise a start there is refused.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.scene.loads import SpringDamper as Declared
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, number
from flexclear.pipeline.dynamics.loads.row import Row
from flexclear.pipeline.dynamics.vectors import at, cross, dot, scale, sub


@kernel
def apply(h, f, w, k):
    """Apply load k."""
    a, b = m.SITE_FRAMES.row(h, m.LOADS.a(h, k)), m.SITE_FRAMES.row(h, m.LOADS.b(h, k))
    p = at(w, b + m.FRAME.origin)
    r = sub(p, at(w, a + m.FRAME.origin))
    length = np.sqrt(dot(r, r))
    along = scale(1.0 / length, r) if length > 0.0 else (0.0, 0.0, 0.0)
    rate = dot(along, sub(at(w, b + m.FRAME.velocity), at(w, a + m.FRAME.velocity)))
    stretch, damped = length - number(h, f, k, 2), number(h, f, k, 1) * rate
    force = scale(-(number(h, f, k, 0) * stretch + damped), along)
    stored = 0.5 * number(h, f, k, 0) * stretch * stretch
    act(h, w, k, cross(p, force), force, length, rate, stored, 0.0, damped * rate)


class SpringDamper:
    """See the module's text."""

    apply = staticmethod(apply)

    @staticmethod
    def row(load: Declared, path: str) -> Row:
        """Stiffness [N/m], damping [N s/m], free length [m]."""
        return Row(frames=load.between, numbers=(load.stiffness, load.damping, load.free_length or 0.0))
