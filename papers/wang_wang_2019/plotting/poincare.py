"""Sections of a motion at contact events.

A phase plot draws the whole trajectory; a Poincare section keeps only the points at which the
trajectory passes a chosen event.  Sections at equal phases need a repeated motion: `dynamics.sections`.
"""

from __future__ import annotations

import numpy as np


def at_times(time: np.ndarray, requested: np.ndarray, *values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Each of `values` (first dimension time) at the output times that equal the requested ones.

    Requested times that are no output times (to 1 ns) are left out: nothing is interpolated.
    """
    nearest = np.clip(np.searchsorted(time, requested - 1e-9), 0, time.size - 1)
    index = nearest[np.abs(time[nearest] - requested) <= 1e-9]
    return tuple(value[index] for value in values)
