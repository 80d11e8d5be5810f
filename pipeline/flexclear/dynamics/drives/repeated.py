"""A periodically repeated law: cycles of a cam, strokes of a press."""

from __future__ import annotations

from math import inf

from flexclear.dynamics.drives.pieces import Pieces, pieces_of
from flexclear.scene.laws import Repeated


def pieces(law: Repeated, dimension: str) -> Pieces:
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
