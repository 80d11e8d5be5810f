"""Sum of laws."""

from __future__ import annotations

from functools import reduce

from flexclear.dynamics.drives.pieces import Piece, Pieces, pieces_of
from flexclear.scene.laws import Sum


def pieces(law: Sum, dimension: str) -> Pieces:
    """Return the pieces between all breaks of all laws."""
    laws = [pieces_of(part, dimension) for part in law.laws]
    starts = sorted({float(t) for one in laws for t in one.starts[1:]})
    first = starts[0] - 1.0 if starts else 0.0
    parts = tuple(reduce(Piece.plus, (one.at(t).moved(t) for one in laws)) for t in [first, *starts])
    return Pieces(parts, (max(one.span[0] for one in laws), min(one.span[1] for one in laws)))
