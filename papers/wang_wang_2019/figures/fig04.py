"""Figure 4: first four elastic mode shapes of the rod under free-free reference conditions."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.figures import mode_shapes
from flexclear.papers.wang_wang_2019.published import TABLE5_NORMAL_MODE

NEEDS = ("sps4/frequencies/free_circle:bundle/rod",)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig04.png and fig04.svg."""
    return mode_shapes.make(
        "fig04",
        "Figure 4: free-free modes leave the rod's ends free, which move most",
        data[NEEDS[0]],
        TABLE5_NORMAL_MODE,
    )
