"""Every law of time at the present time."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics import memory as m
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel

#: of the polynomials of the laws' pieces
DEGREE = 7
#: times closer than this fraction of the run are the same instant, computed in two ways
SHORTEST = 1e-12


@kernel
def nothing(*given):
    """No-op in place of harmonics that a mechanism lacks."""


@kernel
def piece_at(d, k, t):
    """Return the piece of law k at time t: where a smooth law is active from one piece on, the last that has begun."""
    piece, last = d.active[k], d.piece_harmonics[d.active[k]].last
    while piece < last:
        middle = (piece + last + 1) // 2
        if d.pieces[middle].start <= t:
            piece = middle
        else:
            last = middle - 1
    return piece


@kernel
def next_knot(d, t):
    """Return the time at which a law goes on with its next piece, or the segment's end; rounding is no interval."""
    knot, least = d.end, SHORTEST * d.span
    for k in range(d.n_laws):
        piece = piece_at(d, k, t + least)
        if piece < d.piece_harmonics[piece].last and d.pieces[piece + 1].start < d.end - least:
            knot = min(knot, d.pieces[piece + 1].start)
    return knot


def make_laws(harmonics: Callable = nothing) -> Callable:
    """Build the kernel laws(h, f, w, n, t); harmonics(d, k, piece, s) adds those of law k in a piece."""

    @kernel
    def laws(h, f, w, n, t):
        """Compute value, rate and second rate of every law, from its present piece."""
        d = data(h, f, w, n)
        for k in range(d.n_laws):
            active = piece_at(d, k, t)
            piece, law = d.pieces[active], d.law[k]
            s = t - piece.start
            x, v, a = piece.coefficients[DEGREE], 0.0, 0.0
            for c in range(DEGREE - 1, -1, -1):
                a = a * s + 2.0 * v
                v = v * s + x
                x = x * s + piece.coefficients[c]
            law.value, law.rate, law.second_rate = x, v, a
            harmonics(d, k, active, s)

    return laws


def make_law_changes(harmonics: Callable = nothing) -> Callable:
    """Build the kernel law_changes(d, t, k): changes of all laws along direction k, counted from 1, after `laws`.

    harmonics(d, law, piece, s, numbers, out) adds those of a piece; numbers: index in f of the direction's numbers,
    out: index in w of the law's changes.
    """

    @kernel
    def law_changes(d, t, k):
        numbers = k * d.f_change
        for i in range(d.n_laws):
            active = piece_at(d, i, t)
            piece, law = d.pieces[active], d.law[i]
            begin, out = numbers + d.at_pieces + m.PIECES.size * active, k * d.w_change + d.at_law + m.LAW.size * i
            s, later = t - piece.start, -d.f[begin + m.PIECES.start]
            x, v, a, jerk = d.f[begin + m.PIECES.coefficients + DEGREE], 0.0, 0.0, 0.0
            for c in range(DEGREE - 1, -1, -1):
                a = a * s + 2.0 * v
                v = v * s + x
                x = x * s + d.f[begin + m.PIECES.coefficients + c]
            for c in range(DEGREE, 2, -1):
                jerk = jerk * s + c * (c - 1) * (c - 2) * piece.coefficients[c]
            d.w[out + m.LAW.value] = x + law.rate * later
            d.w[out + m.LAW.rate] = v + law.second_rate * later
            d.w[out + m.LAW.second_rate] = a + jerk * later
            harmonics(d, i, active, s, numbers, out)

    return law_changes
