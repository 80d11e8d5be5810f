"""What a reference condition hands back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Basis:
    """Independent shapes that respect a reference condition, in any combination and scale.

    vectors: in node order, shape (ndof, count).
    rigid_frequency: frequencies [Hz] of rigid-body modes that were found and removed, ascending; may be empty.
    """

    vectors: np.ndarray
    rigid_frequency: np.ndarray
