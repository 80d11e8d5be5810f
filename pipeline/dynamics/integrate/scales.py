"""Sizes of the closure rows along a run, against which a row that vanishes or depends on others is told."""

from __future__ import annotations

from pipeline.dynamics.assembly.places import N_KEPT_ROWS, ROW_SCALE
from pipeline.dynamics.tables import N_CLOSURE_ROWS
from pipeline.dynamics.vectors import kernel


@kernel
def keep_scales(h, w):
    """Sizes of the closure rows at an accepted step; a rejected trial far away must not count."""
    for r in range(h[N_KEPT_ROWS]):
        o = h[ROW_SCALE] + r
        w[o] = max(w[o], w[o + h[N_CLOSURE_ROWS]])
