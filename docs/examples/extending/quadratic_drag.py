r"""Drag of a fluid at rest on the origin of a frame: against its velocity, with the square of the speed.

.. math:: F = -c\,|v|\,v, \quad c = \rho\,C_d A/2
"""

from __future__ import annotations

import numpy as np
from flexclear.dynamics.loads.fields import act, number

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import cross, dot, scale
from flexclear.scene.loads import QuadraticDrag


@kernel
def apply(d, k):
    """Apply load k; all of its power is lost."""
    frame = d.site_frames[d.loads[k].b]
    v = frame.velocity
    speed = np.sqrt(dot(v, v))
    force = scale(-number(d, k, 0) * speed, v)
    moment = cross(frame.origin, force)
    act(d, k, moment, force, 0.0, 0.0, 0.0, 0.0, -dot(force, v))


def row(load: QuadraticDrag, place: str) -> Row:
    """One number: c [kg/m]."""
    return Row(frames=(load.frame,), numbers=(load.coefficient,))
