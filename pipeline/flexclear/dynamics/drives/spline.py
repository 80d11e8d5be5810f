"""Interpolating splines of degree 3 and 5.

Source: de Boor (1978), A Practical Guide to Splines, ch. IV and XIII (by SciPy).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from flexclear.dynamics.drives.pieces import Pieces, polynomials
from flexclear.scene.laws import Ends, Spline, Table
from flexclear.scene.units import quantity


def pieces_of_spline(law: Spline, dimension: str) -> Pieces:
    """Return one piece between each two points."""
    return through(law.time, tuple(quantity(v, dimension) for v in law.value), law.degree, law.ends)


@lru_cache(maxsize=16)  # `check` asks for a law at each of its steps
def through(time: tuple[float, ...], value: tuple[float, ...], degree: int, ends: Ends) -> Pieces:
    """Return the spline through the points; raise ValueError when periodic ends differ in value."""
    from scipy.interpolate import CubicSpline, PPoly, make_interp_spline  # here, since few laws need it

    if ends == "periodic" and value[0] != value[-1]:
        raise ValueError("a periodic spline must end with its first value")
    t, x = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    if degree == 3:
        drawn = CubicSpline(t, x, bc_type=ends)
        starts, rows = t[:-1], drawn.c[::-1].T
    else:
        quintic: Any = make_interp_spline(t, x, k=5, bc_type=_ends(ends))
        fifth = PPoly.from_spline(quintic)
        keep = np.diff(fifth.x) > 0.0  # the knots at both ends are repeated
        starts, rows = fifth.x[:-1][keep], fifth.c[::-1].T[keep]
    return Pieces(polynomials(starts, rows), (float(t[0]), float(t[-1])))


def _ends(ends: Ends) -> Any:
    both = {"natural": [(3, 0.0), (4, 0.0)], "clamped": [(1, 0.0), (2, 0.0)]}
    if ends in both:
        return both[ends], both[ends]
    return "periodic" if ends == "periodic" else None


def pieces_of_table(law: Table, dimension: str) -> Pieces:
    """Return one piece between each two rows."""
    # "1" is the unit of bare numbers; a column that states its unit has another one
    factor = 1.0 if law.value.unit == "1" else quantity(f"1 {law.value.unit}", dimension)
    time, value = zip(*law.points, strict=True)
    return through(time, tuple(factor * v for v in value), law.degree, law.ends)
