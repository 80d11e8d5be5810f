"""Checks of the axes of frames. Without NumPy: every command checks the scenes that it reads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

Vector = Sequence[float]

#: tolerances of the squared lengths and of the scalar products of three axes, which are typed by hand
LENGTH, DIRECTION = 1.1e-5, 1e-6
#: two directions are parallel when the sine of the angle between them is below this
PARALLEL = 1e-9


def check_axes(axes: Mapping[str, Vector] | Sequence[Vector]) -> None:
    """Raise ValueError, in words, when axes define no right-handed frame.

    axes: two named axes (the first exact, the second made perpendicular), or all three.
    """
    if not isinstance(axes, Mapping):
        x, y, z = axes
        off = max(abs(dot(a, b)) for a, b in ((x, y), (y, z), (z, x)))
        long = max(abs(dot(a, a) - 1.0) for a in axes)
        if not (off <= DIRECTION and long <= LENGTH and dot(cross(x, y), z) > 0.0):
            raise ValueError("three axes must be the unit vectors x, y, z of a right-handed frame")
        return
    if len(axes) != 2 or not set(axes) <= {"x", "y", "z"}:
        raise ValueError("axes must be two of x, y, z, each with its direction in the parent")
    a, b = axes.values()
    if not math.hypot(*cross(a, b)) > PARALLEL * math.hypot(*a) * math.hypot(*b):
        raise ValueError("the two axes must point in different directions; they are zero or parallel")


def check_axis(axis: Vector) -> None:
    """Raise ValueError, in words, for a direction of length zero."""
    if not math.hypot(*axis) > 0.0:
        raise ValueError(f"an axis must not have length zero; the given one is {[float(x) for x in axis]}")


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors of three components."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: Vector, b: Vector) -> tuple[float, float, float]:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
