"""Harmonics of the laws; compiled where a law has some."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.tables import place
from pipeline.dynamics.vectors import index, kernel

PIECE_HARMONICS, HARMONICS = place("PIECE_HARMONICS"), place("HARMONICS")


@kernel
def oscillate(h, f, w, law, piece, s):
    """Add the harmonics of a piece, s seconds after its start, to the value and rates stored from `law`."""
    o = h[PIECE_HARMONICS] + 2 * piece
    first = h[index(o)]
    for k in range(first, first + h[index(o + 1)]):
        term = h[HARMONICS] + 3 * k
        amplitude, omega = f[index(term)], f[index(term + 1)]
        phase = omega * s + f[index(term + 2)]
        sine = amplitude * np.sin(phase)
        w[index(law)] += sine
        w[index(law + 1)] += amplitude * omega * np.cos(phase)
        w[index(law + 2)] -= omega * omega * sine
