"""Sizes of the closure rows along a run, against which a row that vanishes or depends on others is told."""

from __future__ import annotations

from pipeline.dynamics import memory as m
from pipeline.dynamics.kernels import kernel


@kernel
def keep_scales(h, w):
    """Sizes of the closure rows at an accepted step; a rejected trial far away must not count."""
    for r in range(h[m.N_KEPT_ROWS]):
        o = h[m.ROW_SCALE] + r
        w[o] = max(w[o], w[o + h[m.N_CLOSURE_ROWS]])
