"""A polynomial of time."""

from __future__ import annotations

from flexclear.pipeline.core.scene.laws import Polynomial
from flexclear.pipeline.core.scene.units import coefficient
from flexclear.pipeline.dynamics.drives.pieces import Piece, Pieces


def pieces(law: Polynomial, dimension: str) -> Pieces:
    """Return one piece."""
    coefficients = (coefficient(c, dimension, order) for order, c in enumerate(law.coefficients))
    return Pieces((Piece(law.origin, tuple(coefficients)),))
