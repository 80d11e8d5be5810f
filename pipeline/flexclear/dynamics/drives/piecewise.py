"""Laws in sequence, each in its own section of time."""

from __future__ import annotations

from math import inf

from flexclear.dynamics.drives.pieces import Pieces, pieces_of
from flexclear.scene.laws import Piecewise


def pieces(law: Piecewise, dimension: str) -> Pieces:
    """Return the pieces of each law within its section; raise ValueError when one does not cover its section."""
    collected = []
    low, high = -inf, inf
    ends = [*(s.start for s in law.sections[1:]), inf]
    for k, (section, end) in enumerate(zip(law.sections, ends, strict=True)):
        inner, start = pieces_of(section.law, dimension), section.start
        if (k and inner.span[0] > start) or (end < inf and inner.span[1] < end):
            raise ValueError(f"the law from {start} s on is defined between {inner.span[0]} and {inner.span[1]} s only")
        low, high = (inner.span[0] if k == 0 else low), (inner.span[1] if end == inf else high)
        collected.append(inner.at(start).moved(start))
        collected += [p for p in inner.pieces[1:] if start < p.start < end]
        if k == 0:
            collected = [p for p in inner.pieces if p.start < start] + collected if len(inner.pieces) > 1 else collected
    return Pieces(tuple(collected), (low, high))
