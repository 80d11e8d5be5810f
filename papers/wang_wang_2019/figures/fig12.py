"""Figure 12: clearance spherical joint (CSJ) against the ideal model, six panels."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import CSJ, IDEAL, JOINT, motion, references
from flexclear.papers.wang_wang_2019.plotting.panels import six_panels
from flexclear.pipeline.post.plotting import style

NEEDS = references((IDEAL, CSJ), "run", "post")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig12.png and fig12.svg."""
    with style.style():
        ideal, csj, post = motion(IDEAL, data), motion(CSJ, data), data[f"{CSJ.scene}:post"]
        figure, labelled = six_panels(
            ideal, [csj], impacts=True, clearance=1e3 * float(post.clearance.sel(contact=JOINT))
        )
        style.heading(
            figure,
            f"Figure 12: {int(post.impact_count.sel(contact=JOINT))} impacts raise the largest force at A1 from "
            f"{ideal.reaction.max():.0f} to {float(post.peak_force.sel(contact=JOINT)):.0f} N, the acceleration from "
            f"{1e-3 * np.abs(ideal.acceleration).max():.0f} to {1e-3 * np.abs(csj.acceleration).max():.0f} m/s²",
            "slim panels (added): difference from the ideal model, or a zoom to its range; "
            "dots: largest normal force of each impact, as in the title",
        )
        style.shared_legend(figure, labelled, 2)
        return style.files("fig12", figure)
