"""Uniform gravity, implemented as an upward acceleration of the ground."""

from __future__ import annotations

import numpy as np

from flexclear.scene.schema import Scene


def field(scene: Scene) -> np.ndarray:
    """Return the sum of the scene's gravity fields [m/s^2], shape (3,)."""
    fields: list[np.ndarray] = [np.array(load.acceleration) for load in scene.load.values() if load.type == "gravity"]
    return np.sum(fields, axis=0) if fields else np.zeros(3)
