"""A coordinate that is held."""

from __future__ import annotations

import numpy as np

from pipeline.core.scene.parts import Constant


def pieces(law: Constant) -> np.ndarray:
    """One piece, shape (1, 7)."""
    return np.array([[0.0, law.value, 0.0, 0.0, 0.0, 0.0, 0.0]])
