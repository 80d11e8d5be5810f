r"""A rise without jumps of the acceleration, as cams make it.

.. math:: x(t) = h\,\left[\tau - \frac{\sin 2\pi\tau}{2\pi}\right], \quad \tau = (t - t_0)/T

Source: Norton (2009), Cam Design and Manufacturing Handbook, 2nd ed.
"""

from __future__ import annotations

from math import pi

from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.scene.laws import Cycloidal
from flexclear.scene.units import quantity


def pieces(law: Cycloidal, dimension: str) -> Pieces:
    """Rest, rise, rest."""
    rise, duration = quantity(law.rise, dimension), law.end - law.start
    wave = (-rise / (2.0 * pi), 2.0 * pi / duration, 0.0)
    rising = Piece(law.start, (0.0, rise / duration), (wave,))
    return Pieces((Piece(law.start - duration, (0.0,)), rising, Piece(law.end, (rise,))))
