"""Bring a run to equal time steps; its own rows also have the times of breaks and events."""

import numpy as np

step = 1e-4  # the scene's output interval [s]
times = np.arange(0.0, float(run["time"][-1]), step)
moving = run[["position", "velocity", "drive_force"]].interp(time=times)
