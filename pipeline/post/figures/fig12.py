"""Figure 12: clearance spherical joint (CSJ) against the ideal model, six panels."""

from __future__ import annotations

import xarray as xr

from pipeline.post.models import CSJ, IDEAL, motion
from pipeline.post.plotting import style
from pipeline.post.plotting.panels import six_panels

NEEDS = (
    "sps4/ideal:run",
    "sps4/ideal:post",
    "sps4/csj:run",
    "sps4/csj:post",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig12.png and fig12.svg."""
    with style.style():
        figure, labelled = six_panels(motion(IDEAL, data), [motion(CSJ, data)], impacts=True)
        style.heading(
            figure,
            "Figure 12: CSJ model",
            "slim panels (added): difference from the ideal model, or a zoom to its range; "
            "dots: largest force of each impact",
        )
        style.shared_legend(figure, labelled, 2)
        return style.files("fig12", figure)
