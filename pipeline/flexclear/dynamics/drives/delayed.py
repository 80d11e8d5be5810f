"""A law that starts at a later time: the course of a motion that begins at an event."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Pieces, pieces_of
from flexclear.scene.laws import Delayed


def pieces(law: Delayed, dimension: str) -> Pieces:
    """Return the pieces of the inner law, each later by the delay."""
    inner = pieces_of(law.law, dimension)
    return Pieces(tuple(p.later(law.by) for p in inner.pieces), (inner.span[0] + law.by, inner.span[1] + law.by))
