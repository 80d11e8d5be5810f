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
from pipeline.dynamics.vectors import kernel


@kernel
def no_harmonics(h, f, w, law, piece, s):
    """Polynomials only."""


def compose(harmonics: Callable) -> Callable:
    """The kernel known_motion(h, f, w, n, t); harmonics(h, f, w, law, piece, s) adds to value, rate, second rate."""

    @kernel
    def laws(h, f, w, n, t):
        """Value, rate and second rate of every law, from its piece in force."""
        for k in range(h[N_LAWS]):
            piece = n[n[ACTIVE] + k]
            o = h[PIECES] + PIECE_SIZE * piece
            s = t - f[o]
            x, v, a = f[o + PIECE_SIZE - 1], 0.0, 0.0
            for c in range(PIECE_SIZE - 2, 0, -1):
                a = a * s + 2.0 * v
                v = v * s + x
                x = x * s + f[o + c]
            law = h[LAW] + LAW_SIZE * k
            w[law], w[law + 1], w[law + 2] = x, v, a
            harmonics(h, f, w, law, piece, s)

    @kernel
    def known_motion(h, f, w, n, t):
        """Prescribed coordinates, speeds and accelerations at time t: the first laws are the drives'."""
        laws(h, f, w, n, t)
        for d in range(h[N_DRIVES]):
            law = h[LAW] + LAW_SIZE * d
            w[h[X] + h[NQ] + d] = w[law]
            w[h[U] + h[NV] + d] = w[law + 1]
            w[h[DU] + h[NV] + d] = w[law + 2]

    return known_motion
