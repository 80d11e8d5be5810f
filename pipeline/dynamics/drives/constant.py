"""A law of constant value."""

from __future__ import annotations

from flexclear.pipeline.core.scene.laws import Constant
from flexclear.pipeline.core.scene.units import quantity
from flexclear.pipeline.dynamics.drives.pieces import Piece, Pieces


def pieces(law: Constant, dimension: str) -> Pieces:
    """Return one piece."""
    return Pieces((Piece(0.0, (quantity(law.value, dimension),)),))
