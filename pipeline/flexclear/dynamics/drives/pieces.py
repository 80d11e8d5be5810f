r"""Common form of every law of time: pieces, each a polynomial plus harmonics in the time since its start.

.. math:: x(t) = \sum_k c_k s^k + \sum_j A_j \sin(\omega_j s + \varphi_j), \quad s = t - t_{start}

so that value, rate and second rate are exact, and derivatives may jump only at the start of a piece, where integration
restarts (a break) or a step ends.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from math import comb, inf, perm, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from flexclear.scene.laws import COEFFICIENTS

PACKAGE = "flexclear.dynamics.drives"
#: times at which a piece is evaluated for its size; enough for polynomials of degree 7
GRID = 17
#: a law of more pieces has breaks only where value, rate or second rate jump: at others steps end, without a restart
#: and a row of the record
FEW = 500
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
        """Start of each piece [s]."""
        return [p.start for p in self.pieces]

    @cached_property
    def harmonics(self) -> np.ndarray:
        """Number of harmonics of each piece."""
        return np.array([len(p.terms) for p in self.pieces])

    def at(self, t: float) -> Piece:
        """Return the piece that holds at t; where two meet, the later one."""
        return self.pieces[max(bisect_right(self.starts, t) - 1, 0)]

    def value(self, t: float, order: int = 0) -> float:
        """Return the derivative of this order at time t."""
        return self.at(t).value(t, order)

    def derivatives(self, those: np.ndarray, times: np.ndarray, order: int) -> np.ndarray:
        """Return the derivative of this order of pieces, by their indices, each at a time of its own; shape (n,)."""
        rows, waved = self.rows[those], np.flatnonzero(self.harmonics[those])
        terms = [(k, *term) for k in waved for term in self.pieces[those[k]].terms]
        s, values = times - rows[:, 0], np.zeros(len(times))
        for n in range(COEFFICIENTS - 1, order - 1, -1):
            values = values * s + perm(n, order) * rows[:, 1 + n]
        owner, a, w, phase = np.array(terms or np.zeros((0, 4))).T
        at = owner.astype(int)
        np.add.at(values, at, a * w**order * np.sin(w * s[at] + phase + 0.5 * pi * order))
        return values

    @cached_property
    def last(self) -> np.ndarray:
        """Index of the last piece that goes on from each one without a break."""
        every = np.arange(len(self.pieces))
        if len(every) <= FEW:
            return every
        broken = np.any([_jumps(self, every[1:], order, self.starts) for order in range(3)], axis=0)
        ends = np.append(np.flatnonzero(broken), every[-1])
        return np.asarray(ends[np.searchsorted(ends, every)])

    def times(self, factor: float) -> Pieces:
        """Return the law multiplied by a factor."""
        return self if factor == 1.0 else Pieces(tuple(p.times(factor) for p in self.pieces), self.span)

    @cached_property
    def rows(self) -> np.ndarray:
        """Start and eight coefficients of each piece, shape (n, 9)."""
        rows = np.zeros((len(self.pieces), 1 + COEFFICIENTS))
        for row, p in zip(rows, self.pieces, strict=True):
            row[0], row[1 : 1 + len(p.coefficients)] = p.start, p.coefficients
        return rows


def pieces_of(law: object, dimension: str) -> Pieces:
    """Return the pieces of any law; raise ValueError, in words, for values of another dimension."""
    from flexclear.dynamics.drives import LAWS  # here, since laws consist of laws

    result: Pieces = LAWS[law.type](law, dimension)  # type: ignore[attr-defined]
    return result


def polynomials(starts: ArrayLike, coefficients: ArrayLike) -> tuple[Piece, ...]:
    """Return pieces without harmonics; coefficients: a row for each start, of rising order."""
    both = (np.asarray(values, dtype=float).tolist() for values in (starts, coefficients))
    return tuple(Piece(t, tuple(row)) for t, row in zip(*both, strict=True))


def covers(law: Pieces, start: float, end: float) -> bool:
    """Return True when the law is defined from start to end, up to rounding of the times."""
    slack = 1e-9 * (end - start)
    return law.span[0] <= start + slack and end - slack <= law.span[1]


def jump(law: Pieces, start: float, end: float) -> tuple[float, str] | None:
    """Return the time of the first break between start and end where value or rate jumps, and which of them does."""
    starts = np.array(law.starts)
    later = 1 + np.flatnonzero((start < starts[1:]) & (starts[1:] < end))
    for order, word in ((0, "value"), (1, "rate")):
        broken = _jumps(law, later, order, (start, end))
        if broken.any():
            return float(starts[later[np.argmax(broken)]]), word
    return None


def _jumps(law: Pieces, later: np.ndarray, order: int, between: Sequence[float]) -> np.ndarray:
    """Return whether a derivative jumps where each of these pieces begins, by its size between two times."""
    left, right = (law.derivatives(those, np.array(law.starts)[later], order) for those in (later - 1, later))
    step = np.abs(right - left)
    broken = step > 1e-6 * np.maximum(np.abs(left), np.abs(right))
    if broken.any():  # most laws meet exactly
        broken &= step > 1e-6 * size(law, between[0], between[-1], order)
    return np.asarray(broken)


def size(law: Pieces, start: float, end: float, order: int) -> float:
    """Return the largest magnitude of a law's derivative of this order between two times, on a grid of each piece."""
    starts, until = np.array(law.starts), np.array([*law.starts[1:], inf])
    those = np.flatnonzero((until > start) & (starts < end))
    times = np.linspace(np.maximum(starts[those], start), np.minimum(until[those], end), GRID)
    return float(np.abs(law.derivatives(np.tile(those, GRID), times.ravel(), order)).max())
