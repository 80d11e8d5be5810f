"""Figure 14: phase plots of angle and velocity along z, all models."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting.phase import Plane, maps, off_ideal
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

PLANE = Plane(lambda m: m.angle, lambda m: m.velocity, "angle about y0 (rad)", "z velocity (mm/s)")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig14.png and fig14.svg."""
    with style.style():
        figure = maps(PLANE, data)
        style.heading(
            figure,
            f"Figure 14: impacts take the velocity up to {off_ideal(PLANE.y, data):.0%} of its largest value off the "
            f"ideal model's, the angle {off_ideal(PLANE.x, data):.1%}",
            "the paper calls these phase plots Poincaré maps; second row (added): states when an impact "
            "begins, hollow beyond the horizon",
        )
        return style.files("fig14", figure)
