"""Integrals of the pressure of short and long bearings over the half of a journal that its pin approaches."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.specialise.symbols import arctan2, sqrt


def half_circle(a: Any, b: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return the integrals of the short and of the long bearing along v, and those across over b."""
    squared, side = 1.0 - a * a - b * b, 1.0 - b * b
    q = sqrt(squared)
    D = 2.0 * (arctan2(1.0 + a - b, q) + arctan2(1.0 + a + b, q))
    cubed, fourth, fifth = D / (q * squared), 1.0 / (squared * squared), D / (q * squared * squared)
    # J = D/q and its derivatives; those by b once, and by a and b, over b
    J, J_a, J_b = D / q, 2.0 / squared + cubed * a, 2.0 * a / (squared * side) + cubed
    J_aa = 6.0 * a * fourth + cubed + 3.0 * a * a * fifth
    J_ab = (4.0 + 2.0 * a * a / side) * fourth + 3.0 * a * fifth
    J_bb = 2.0 * a / (squared * side) * (1.0 + b * b * (3.0 / squared + 2.0 / side)) + cubed + 3.0 * b * b * fifth
    # integrals of cos, sin (over b) and 1 by h^3
    cosine, sine = J_a + 0.5 * (a * J_aa + b * b * J_ab), J_b + 0.5 * (a * J_ab + J_bb)
    one = J + a * J_a + b * b * J_b + a * cosine + b * b * sine
    long = 0.5 * J_bb - b * b * sine * sine / one, sine * cosine / one - 0.5 * J_ab
    return (0.5 * J_aa, 0.5 * J_ab), long
