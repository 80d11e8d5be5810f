"""Harmonics of the laws; compiled where a law has some."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def oscillate(h, f, w, law, piece, s):
    """Add the harmonics of a piece, s seconds after its start, to the value and rates stored from `law`."""
    first = m.PIECE_HARMONICS.harmonic0(h, piece)
    for k in range(first, first + m.PIECE_HARMONICS.n_harmonics(h, piece)):
        o = m.HARMONICS.row(h, k)
        amplitude, omega = f[o + m.HARMONICS.amplitude], f[o + m.HARMONICS.frequency]
        phase = omega * s + f[o + m.HARMONICS.phase]
        sine = amplitude * np.sin(phase)
        w[law] += sine
        w[law + 1] += amplitude * omega * np.cos(phase)
        w[law + 2] -= omega * omega * sine
