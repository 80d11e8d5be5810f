"""Figure 3: first four mode shapes of the rod under fixed-fixed reference conditions."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.figures import mode_shapes
from flexclear.papers.wang_wang_2019.published import TABLE4_NORMAL_MODE

NEEDS = ("sps4/frequencies/fixed_circle:bundle/rod",)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig03.png and fig03.svg."""
    return mode_shapes.make(
        "fig03", "Figure 3: fixed-fixed modes leave both ends of the rod at rest", data[NEEDS[0]], TABLE4_NORMAL_MODE
    )
