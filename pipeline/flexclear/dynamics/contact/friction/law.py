"""Structure of a friction law; laws that depend on the present sliding speed alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.dynamics.specialise.symbols import larger, sqrt
from flexclear.dynamics.vectors import ZERO, Vector, dot

#: speed [m/s] below which the coefficient rises linearly: at rest there is no force, but a slope. The squares of it and
#: of its reciprocal, of which derivatives consist, are numbers
SLOWEST = 1e-150


@dataclass(frozen=True)
class Friction:
    """A friction law; the functions take its parameters in a scene.

    traction: (z, slip, f_n, p) -> (force, loss, stored, z_rate): force [N] on the ball against the sliding
    velocity `slip` [m/s] (vector in the tangent plane), lost power [W] >= 0, stored energy [J], and the rate of the
    bristle deflection z [m] in the axes of slip (zeros for a law without memory); numbers may be symbols.
    constants: its numbers in p, six at most.
    stick_speed: sliding speed below which the law sticks [m/s], 0 for laws without sticking.
    kinks: two sliding speeds [m/s] at which slope or curvature of the coefficient jumps, 0 for none; steps end there.
    bristle: the size of z [m], or None for a law without memory.
    """

    traction: Callable
    constants: Callable[[Any], tuple[float, ...]]
    stick_speed: Callable[[Any], float] = lambda law: 0.0
    kinks: Callable[[Any], tuple[float, float]] = lambda law: (0.0, 0.0)
    bristle: Callable[[Any], float | None] = lambda law: None

    def parameters(self, law: Any) -> tuple[float, ...]:
        """Return the six numbers p."""
        return (*self.constants(law), *(0.0,) * 6)[:6]


def sliding(coefficient: Callable) -> Callable:
    """Build `traction` of a law whose force is the normal force times coefficient(speed, p) >= 0."""
    return sliding_under(lambda speed, f_n, _, p: coefficient(speed, p))


def sliding_under(coefficient: Callable) -> Callable:
    """Build `traction` of a law with coefficient(speed, normal force, 0, p) >= 0."""

    def traction(z: Vector, slip: Vector, f_n: Any, p: Any) -> tuple[Vector, Any, Any, Vector]:
        square = dot(slip, slip)
        speed = larger(sqrt(square), SLOWEST)
        per_speed = f_n * coefficient(speed, f_n, 0.0, p) / speed
        return -per_speed * slip, per_speed * square, 0.0, ZERO

    return traction
