"""Harmonics of the laws; compiled where a law has some."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def oscillate(d, k, piece, s):
    """Add the harmonics of a piece, s seconds after its start, to value and rates of law k."""
    law, its = d.law[k], d.piece_harmonics[piece]
    for i in range(its.harmonic0, its.harmonic0 + its.n_harmonics):
        harmonic = d.harmonics[i]
        amplitude, omega = harmonic.amplitude, harmonic.frequency
        phase = omega * s + harmonic.phase
        sine = amplitude * np.sin(phase)
        law.value += sine
        law.rate += amplitude * omega * np.cos(phase)
        law.second_rate -= omega * omega * sine
