"""A law of constant value."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.scene.laws import Constant
from flexclear.scene.units import quantity


def pieces(law: Constant, dimension: str) -> Pieces:
    """Return one piece."""
    return Pieces((Piece(0.0, (quantity(law.value, dimension),)),))
