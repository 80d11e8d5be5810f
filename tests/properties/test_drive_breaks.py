"""Breaks of the laws of time that rounding has set apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexclear.pipeline import load_scene
from flexclear.pipeline.dynamics.run.run import engine_of

IDEAL = Path(__file__).parents[2] / "scenes" / "sps4" / "ideal.toml"


def test_breaks_that_only_rounding_sets_apart_are_one():
    """Five strokes of 0.09 s halves: 5 * 0.09 + 0.09 and 6 * 0.09 differ in the last digit."""
    starts = [k * 0.09 for k in range(10)]
    ends = [s + 0.09 for s in starts]
    assert len(set(starts[1:]) | set(ends[:-1])) > 9  # the case is there
    law = {"type": "step", "start": starts, "end": ends, "change": [0.01, -0.01] * 5}
    scene = load_scene(IDEAL, {"drive.P1.law": law, "drive.P2.law": law, "time.end": 0.9})
    breaks = engine_of(scene, {}, lambda share, text: None).breaks
    np.testing.assert_allclose(breaks, 0.09 * np.arange(11), atol=1e-15)
