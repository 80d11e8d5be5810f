"""Breaks of the laws of time that rounding has set apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexclear import load_scene
from flexclear.pipeline.dynamics.drives.pieces import Piece, Pieces, jump
from flexclear.pipeline.dynamics.run.run import engine_of

IDEAL = Path(__file__).parents[2] / "scenes" / "sps4" / "ideal.toml"


def test_breaks_that_only_rounding_sets_apart_are_one():
    """Five strokes of 0.09 s halves: 5 * 0.09 + 0.09 and 6 * 0.09 differ in the last digit."""
    starts = [k * 0.09 for k in range(10)]
    ends = [s + 0.09 for s in starts]
    assert len(set(starts[1:]) | set(ends[:-1])) > 9  # the case is there
    law = {"type": "step", "start": starts, "end": ends, "change": [0.01, -0.01] * 5}
    scene = load_scene(IDEAL, {"drive.P1.law": law, "drive.P2.law": law, "time.end": 0.9})
    breaks = engine_of(scene, {}, lambda fraction, text: None).breaks
    np.testing.assert_allclose(breaks, 0.09 * np.arange(11), atol=1e-15)


@pytest.mark.parametrize("end", [0.5, 8.0, 1000.0])
def test_a_short_motion_in_a_long_run_meets_its_rests(end: float):
    """A quintic from rest to rest, whose coefficients leave a rate of some 1e-16 at its end."""
    quintic = Piece(0.1, (0.0, 0.0, 0.0, 10.0 / 0.3**3, -15.0 / 0.3**4, 6.0 / 0.3**5))
    law = Pieces((Piece(0.0, (0.0,)), quintic, Piece(0.4, (1.0,))))
    assert jump(law, 0.0, end) is None
    broken = Pieces((*law.pieces[:2], Piece(0.4, (1.0, 1e-3))))
    assert jump(broken, 0.0, end) == (0.4, "rate")
