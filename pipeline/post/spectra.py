"""Amplitude spectra of recorded series."""

from __future__ import annotations

import numpy as np


def amplitude_spectrum(time: np.ndarray, values: np.ndarray, interval: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and one-sided amplitudes (unit of values) of a series, Hann window.

    time, values: shape (time,), times ascending; brought to equal steps of `interval` [s] by linear
    interpolation, because runs also hold event times.  A sine of amplitude a on a bin reads a.
    Raises ValueError for fewer than 8 steps.
    """
    count = int(np.floor((time[-1] - time[0]) / interval + 1e-9)) + 1
    if count < 8:
        raise ValueError(f"{count} equal steps of {interval:g} s are too few for a spectrum")
    even = np.interp(time[0] + interval * np.arange(count), time, values)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    spectrum = np.abs(np.fft.rfft((even - even.mean()) * window)) * 2.0 / window.sum()
    return np.fft.rfftfreq(count, interval), spectrum


def dominant_frequency(time: np.ndarray, values: np.ndarray, interval: float, above: float = 0.0) -> float:
    """Frequency of the largest amplitude above `above` [Hz]."""
    frequency, amplitude = amplitude_spectrum(time, values, interval)
    inside = frequency > above
    return float(frequency[inside][np.argmax(amplitude[inside])])
