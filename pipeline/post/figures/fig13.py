"""Figure 13: flexible rod and clearance (FAR-CSJ), CSJ and ideal models, six panels."""

from __future__ import annotations

import xarray as xr

from pipeline.post.models import CSJ, FAR_CSJ, IDEAL, motion
from pipeline.post.plotting import style
from pipeline.post.plotting.panels import six_panels

NEEDS = (
    "sps4/ideal:run",
    "sps4/ideal:post",
    "sps4/csj:run",
    "sps4/csj:post",
    "sps4/far_csj_free:run",
    "sps4/far_csj_free:post",
    "sps4/far_csj_fixed:run",
    "sps4/far_csj_fixed:post",
    "sps4/far_csj_cb:run",
    "sps4/far_csj_cb:post",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig13.png and fig13.svg; single runs are pale beyond their horizon, ensembles drawn as bands."""
    models = (CSJ, *FAR_CSJ)
    with style.style():
        motions, posts = [motion(m, data) for m in models], [data[f"{m.scene}:post"] for m in models]
        figure, labelled = six_panels(motion(IDEAL, data), motions, posts, impacts=True)
        style.heading(
            figure,
            "Figure 13: FAR-CSJ model",
            "beyond its horizon a single run is pale; the band is the ensemble's mean ± one standard deviation; "
            "dots: largest force of each impact",
        )
        style.shared_legend(figure, labelled, 3)
        return style.files("fig13", figure)
