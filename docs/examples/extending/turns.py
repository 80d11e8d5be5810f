"""Turns of each body in a run."""

from __future__ import annotations

import numpy as np

from flexclear.artifacts.labelled import LabelledArrays


def turns(run: LabelledArrays) -> dict[str, np.ndarray]:
    """Return `turns`, the integral of the magnitude of each body's angular velocity over 2 pi, shape (body,)."""
    speed = np.linalg.norm(run["angular_velocity"].values, axis=-1)
    return {"turns": np.trapezoid(speed, run["time"].values, axis=0) / (2.0 * np.pi)}
