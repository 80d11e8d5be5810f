"""A spline through the rows of a file, which the scene has already read."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.drives.spline import through
from flexclear.scene.laws import Table
from flexclear.scene.units import quantity


def pieces(law: Table, dimension: str) -> Pieces:
    """Return one piece between each two rows."""
    # "1" is the unit of bare numbers; a column that states its unit has another one
    factor = 1.0 if law.value.unit == "1" else quantity(f"1 {law.value.unit}", dimension)
    time, value = zip(*law.points, strict=True)
    return through(time, tuple(factor * v for v in value), law.degree, law.ends)
