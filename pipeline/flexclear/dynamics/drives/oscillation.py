"""Harmonics of the laws of time; compiled only where a law has some."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel


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


@kernel
def change_oscillation(d, k, piece, s, numbers, out):
    """Add the derivative of a piece's harmonics along a direction, for law k (`equations.prescribed_motion`)."""
    its, size = d.piece_harmonics[piece], m.HARMONICS.size
    later = -d.f[numbers + d.at_pieces + m.PIECES.size * piece + m.PIECES.start]
    for i in range(its.harmonic0, its.harmonic0 + its.n_harmonics):
        harmonic, changes = d.harmonics[i], numbers + d.at_harmonics + size * i
        amplitude, omega = harmonic.amplitude, harmonic.frequency
        more, faster = d.f[changes + m.HARMONICS.amplitude], d.f[changes + m.HARMONICS.frequency]
        phase, ahead = omega * s + harmonic.phase, faster * s + d.f[changes + m.HARMONICS.phase]
        sine, cosine = np.sin(phase), np.cos(phase)
        d.w[out + m.LAW.value] += more * sine + amplitude * cosine * ahead
        d.w[out + m.LAW.rate] += (more * omega + amplitude * faster) * cosine - amplitude * omega * sine * ahead
        d.w[out + m.LAW.second_rate] -= omega * (
            more * omega + 2.0 * amplitude * faster
        ) * sine + amplitude * omega * omega * cosine * (ahead + omega * later)
