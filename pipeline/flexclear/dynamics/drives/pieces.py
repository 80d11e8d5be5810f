r"""Common form of every law of time: pieces, each a polynomial plus harmonics in the time since its start.

.. math:: x(t) = \sum_k c_k s^k + \sum_j A_j \sin(\omega_j s + \varphi_j), \quad s = t - t_{start}

so that value, rate and second rate are exact, and derivatives may jump only at the
start of a piece, where integration restarts.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, zip_longest
from math import comb, inf, perm, pi, sin

import numpy as np

from flexclear.scene.laws import COEFFICIENTS
from flexclear.scene.registry import lookup

PACKAGE = "flexclear.dynamics.drives"
#: times at which a piece is evaluated for its size; enough for polynomials of degree 7
GRID = 17
Terms = tuple[tuple[float, float, float], ...]  #: amplitude, angular frequency [rad/s], phase at the start [rad]


@dataclass(frozen=True)
class Piece:
    """A piece that holds from `start` [s] on. coefficients: of rising order, at most 8."""

    start: float
    coefficients: tuple[float, ...]
    terms: Terms = ()

    def moved(self, start: float) -> Piece:
        """Return the same function, written from another time on."""
        d, c = start - self.start, self.coefficients
        shifted = tuple(sum(comb(n, k) * c[n] * d ** (n - k) for n in range(k, len(c))) for k in range(len(c)))
        return Piece(start, shifted, tuple((a, w, phase + w * d) for a, w, phase in self.terms))

    def later(self, delay: float) -> Piece:
        """Return the piece delayed by `delay` [s]."""
        return Piece(self.start + delay, self.coefficients, self.terms)

    def times(self, factor: float) -> Piece:
        """Return the function multiplied by a factor."""
        terms = tuple((factor * size, w, phase) for size, w, phase in self.terms)
        return Piece(self.start, tuple(factor * c for c in self.coefficients), terms)

    def plus(self, other: Piece) -> Piece:
        """Return the sum of two functions, both written from the same time on."""
        pairs = zip_longest(self.coefficients, other.coefficients, fillvalue=0.0)
        return Piece(self.start, tuple(a + b for a, b in pairs), self.terms + other.terms)

    def value(self, t: float, order: int = 0) -> float:
        """Return the derivative of this order at time t."""
        s, smooth = t - self.start, 0.0
        for n in range(len(self.coefficients) - 1, order - 1, -1):
            smooth = smooth * s + perm(n, order) * self.coefficients[n]
        return smooth + sum(a * w**order * sin(w * s + phase + 0.5 * pi * order) for a, w, phase in self.terms)


@dataclass(frozen=True)
class Pieces:
    """Pieces in order; the first also holds before its start. span: times between which the law is defined [s]."""

    pieces: tuple[Piece, ...]
    span: tuple[float, float] = (-inf, inf)

    @cached_property
    def starts(self) -> list[float]:
        """Start of each piece [s]; all but the first are breaks."""
        return [p.start for p in self.pieces]

    @property
    def harmonic(self) -> bool:
        """True when a piece has harmonics."""
        return any(p.terms for p in self.pieces)

    def at(self, t: float) -> Piece:
        """Return the piece that holds at t; where two meet, the later one."""
        return self.pieces[max(bisect_right(self.starts, t) - 1, 0)]

    def value(self, t: float, order: int = 0) -> float:
        """Return the derivative of this order at time t."""
        return self.at(t).value(t, order)

    def times(self, factor: float) -> Pieces:
        """Return the law multiplied by a factor."""
        return Pieces(tuple(p.times(factor) for p in self.pieces), self.span)

    def table(self) -> tuple[np.ndarray, list[Terms]]:
        """Return rows (start, eight coefficients), shape (n, 9), and the harmonics of each piece."""
        rows = np.zeros((len(self.pieces), 1 + COEFFICIENTS))
        for row, p in zip(rows, self.pieces, strict=True):
            row[0], row[1 : 1 + len(p.coefficients)] = p.start, p.coefficients
        return rows, [p.terms for p in self.pieces]


def pieces_of(law: object, dimension: str) -> Pieces:
    """Return the pieces of any law; raise ValueError, in words, for values of another dimension."""
    result: Pieces = lookup(PACKAGE, law.type, where="law")(law, dimension)  # type: ignore[attr-defined]
    return result


def polynomials(starts: Iterable[float], coefficients: Iterable[Sequence[float]]) -> tuple[Piece, ...]:
    """Return pieces without harmonics."""
    return tuple(Piece(float(t), tuple(float(c) for c in row)) for t, row in zip(starts, coefficients, strict=True))


def covers(law: Pieces, start: float, end: float) -> bool:
    """Return True when the law is defined from start to end, up to rounding of the times."""
    slack = 1e-9 * (end - start)
    return law.span[0] <= start + slack and end - slack <= law.span[1]


def jump(law: Pieces, start: float, end: float) -> tuple[float, str] | None:
    """Return the time of the first break between start and end where value or rate jumps, and which of them does."""
    meeting = [(p, q) for p, q in pairwise(law.pieces) if start < q.start < end]
    for order, word in ((0, "value"), (1, "rate")):
        for left, right in meeting:
            here = left.value(right.start, order), right.value(right.start, order)
            step = abs(here[1] - here[0])
            # the size of the law is evaluated last: most laws meet exactly
            if step > 1e-6 * max(abs(here[0]), abs(here[1])) and step > 1e-6 * size(law, start, end, order):
                return right.start, word
    return None


def size(law: Pieces, start: float, end: float, order: int) -> float:
    """Return the largest magnitude of a law's derivative of this order between two times, on a grid of each piece."""
    until = [*law.starts[1:], inf]
    spans = [
        (p, max(p.start, start), min(after, end))
        for p, after in zip(law.pieces, until, strict=True)
        if after > start and p.start < end
    ]
    return max(abs(p.value(float(t), order)) for p, a, b in spans for t in np.linspace(a, b, GRID))
