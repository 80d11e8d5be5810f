"""Harmonics of the laws; compiled where a law has some."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.tables import place
from pipeline.dynamics.vectors import kernel

PIECE_HARMONICS, HARMONICS = place("PIECE_HARMONICS"), place("HARMONICS")


@kernel
def oscillate(h, f, w, law, piece, s):
    """Add the harmonics of a piece, s seconds after its start, to the value and rates stored from `law`."""
    o = h[PIECE_HARMONICS] + 2 * piece
    first = h[o]
    for k in range(first, first + h[o + 1]):
        term = h[HARMONICS] + 3 * k
        amplitude, omega = f[term], f[term + 1]
        phase = omega * s + f[term + 2]
        sine = amplitude * np.sin(phase)
        w[law] += sine
        w[law + 1] += amplitude * omega * np.cos(phase)
        w[law + 2] -= omega * omega * sine
