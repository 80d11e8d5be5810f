r"""Drag of a fluid at rest on the origin of a frame: against its velocity, with the square of the speed.

.. math:: F = -c\,|v|\,v, \quad c = \rho\,C_d A/2
"""

from __future__ import annotations

from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.specialise.symbols import sqrt
from flexclear.dynamics.vectors import ZERO, Wrench, dot
from flexclear.scene.loads import QuadraticDrag


def apply(given: Given) -> Load:
    """Return the drag; all of its power is lost."""
    v = given.G.v
    force = -(given.numbers[0] * sqrt(dot(v, v))) * v
    return Load(Wrench(ZERO, force), lost=-dot(force, v))


def row(load: QuadraticDrag, place: str) -> Row:
    """One number: c [kg/m]."""
    return Row(frames=(load.frame,), numbers=(load.coefficient,))
