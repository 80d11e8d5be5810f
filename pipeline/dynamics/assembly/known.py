"""Known motion: every law of time at the present time, and the prescribed coordinates from theirs."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.tables import (
    ACTIVE,
    DU,
    LAW,
    LAW_SIZE,
    N_DRIVES,
    N_LAWS,
    NQ,
    NV,
    PIECE_SIZE,
    PIECES,
    U,
    X,
)
from pipeline.dynamics.vectors import index, kernel


@kernel
def no_harmonics(h, f, w, law, piece, s):
    """Polynomials only."""


def compose(harmonics: Callable) -> Callable:
    """The kernel known_motion(h, f, w, n, t); harmonics(h, f, w, law, piece, s) adds to value, rate, second rate."""

    @kernel
    def laws(h, f, w, n, t):
        """Value, rate and second rate of every law, from its piece in force."""
        for k in range(h[N_LAWS]):
            piece = n[index(n[ACTIVE] + k)]
            o = h[PIECES] + PIECE_SIZE * piece
            s = t - f[index(o)]
            x, v, a = f[index(o + PIECE_SIZE - 1)], 0.0, 0.0
            for c in range(PIECE_SIZE - 2, 0, -1):
                a = a * s + 2.0 * v
                v = v * s + x
                x = x * s + f[index(o + c)]
            law = h[LAW] + LAW_SIZE * k
            w[index(law)], w[index(law + 1)], w[index(law + 2)] = x, v, a
            harmonics(h, f, w, law, piece, s)

    @kernel
    def known_motion(h, f, w, n, t):
        """Prescribed coordinates, speeds and accelerations at time t: the first laws are the drives'."""
        laws(h, f, w, n, t)
        for d in range(h[N_DRIVES]):
            law = h[LAW] + LAW_SIZE * d
            w[index(h[X] + h[NQ] + d)] = w[index(law)]
            w[index(h[U] + h[NV] + d)] = w[index(law + 1)]
            w[index(h[DU] + h[NV] + d)] = w[index(law + 2)]

    return known_motion
