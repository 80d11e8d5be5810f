"""A polynomial of time."""

from __future__ import annotations

from pipeline.core.scene.laws import Polynomial
from pipeline.dynamics.drives.pieces import Piece, Pieces


def pieces(law: Polynomial, dimension: str) -> Pieces:
    """One piece; its coefficients are in SI units of whatever dimension."""
    return Pieces((Piece(law.origin, tuple(law.coefficients)),))
