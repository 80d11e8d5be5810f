"""Laws composed of other laws: sums, sequences, repetitions, and laws that start later."""

from __future__ import annotations

from functools import reduce
from math import inf

from flexclear.dynamics.drives.pieces import Piece, Pieces, pieces_of
from flexclear.scene.laws import Delayed, Piecewise, Repeated, Sum


def pieces_of_piecewise(law: Piecewise, dimension: str) -> Pieces:
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


def pieces_of_sum(law: Sum, dimension: str) -> Pieces:
    """Return the pieces between all breaks of all laws."""
    laws = [pieces_of(part, dimension) for part in law.laws]
    starts = sorted({float(t) for one in laws for t in one.starts[1:]})
    first = starts[0] - 1.0 if starts else 0.0
    parts = tuple(reduce(Piece.plus, (one.at(t).moved(t) for one in laws)) for t in [first, *starts])
    return Pieces(parts, (max(one.span[0] for one in laws), min(one.span[1] for one in laws)))


def pieces_of_delayed(law: Delayed, dimension: str) -> Pieces:
    """Return the pieces of the inner law, each later by the delay."""
    inner = pieces_of(law.law, dimension)
    return Pieces(tuple(p.later(law.by) for p in inner.pieces), (inner.span[0] + law.by, inner.span[1] + law.by))


def pieces_of_repeated(law: Repeated, dimension: str) -> Pieces:
    """Return the inner law's first period `times` times; the last period continues as the inner law does.

    Raises ValueError when the inner law does not cover its first period.
    """
    inner, start, end = pieces_of(law.law, dimension), law.start, law.start + law.period
    # a table's last time may fall short of the period by rounding
    if inner.span[0] > start + 1e-9 * law.period or inner.span[1] < end - 1e-9 * law.period:
        raise ValueError(
            f"the repeated law is defined between {inner.span[0]} and {inner.span[1]} s only, not over its period from "
            f"{start} to {end} s"
        )
    before = [p for p in inner.pieces if p.start < start]
    after = [p for p in inner.pieces if p.start > start]
    first = [inner.at(start).moved(start), *(p for p in after if p.start < end - 1e-9 * law.period)]
    last = [first[0], *after]
    repeated = [*before]
    for k in range(law.times):
        repeated += [p.later(k * law.period) for p in (last if k == law.times - 1 else first)]
    shift = (law.times - 1) * law.period
    return Pieces(tuple(repeated), (inner.span[0], inner.span[1] + shift if inner.span[1] < inf else inf))
