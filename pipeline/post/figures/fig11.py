"""Figure 11: flexible actuated rod (FAR) against the ideal model, six panels."""

from __future__ import annotations

import xarray as xr

from pipeline.post.models import FAR, IDEAL, motion
from pipeline.post.plotting import style
from pipeline.post.plotting.panels import six_panels

NEEDS = (
    "sps4/ideal:run",
    "sps4/ideal:post",
    "sps4/far_free:run",
    "sps4/far_free:post",
    "sps4/far_fixed:run",
    "sps4/far_fixed:post",
    "sps4/far_cb:run",
    "sps4/far_cb:post",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig11.png and fig11.svg."""
    with style.style():
        figure, labelled = six_panels(motion(IDEAL, data), [motion(model, data) for model in FAR], impacts=False)
        style.heading(figure, "Figure 11: FAR model", "slim panels (added): difference from the ideal model")
        style.shared_legend(figure, labelled, 4)
        return style.files("fig11", figure)
