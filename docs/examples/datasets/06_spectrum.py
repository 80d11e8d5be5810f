"""Spectrum of the slider's acceleration; equal steps first."""

import numpy as np
from scipy.signal import welch

step = 1e-4
times = np.arange(0.0, float(run["time"][-1]), step)
acceleration = run["acceleration"].sel(body="slider", axis="x").interp(time=times)
frequency, density = welch(acceleration.values, fs=1.0 / step, nperseg=128)  # [Hz], [(m/s^2)^2/Hz]
