"""Figure 16: phase plots of velocity and acceleration along z, all models."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting.phase import Plane, maps
from flexclear.pipeline.post.plotting import style

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

PLANE = Plane(
    lambda m: m.velocity,
    lambda m: 1e-3 * m.acceleration,
    "z velocity (mm/s)",
    "z acceleration (10³ mm/s²)",
    spikes=True,
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig16.png and fig16.svg."""
    with style.style():
        figure = maps(PLANE, data)
        style.heading(
            figure,
            "Figure 16: the acceleration shows every impact; in between the platform moves without leg 1",
            "the paper calls these phase plots Poincaré maps; second row (added): states when an impact "
            "begins, hollow beyond the horizon; grey band: linear scale, logarithmic outside",
        )
        return style.files("fig16", figure)
