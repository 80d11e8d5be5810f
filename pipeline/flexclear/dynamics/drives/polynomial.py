"""A polynomial of time."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.scene.laws import Polynomial
from flexclear.scene.units import coefficient


def pieces(law: Polynomial, dimension: str) -> Pieces:
    """Return one piece."""
    coefficients = (coefficient(c, dimension, order) for order, c in enumerate(law.coefficients))
    return Pieces((Piece(law.origin, tuple(coefficients)),))
