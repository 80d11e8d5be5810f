"""Figure 14: phase plots of angle and velocity along z, all models."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting import phase

NEEDS = phase.NEEDS
PLANE = phase.Plane(
    lambda m: m.angle,
    lambda m: m.velocity,
    "angle about y0 (rad)",
    "z velocity (mm/s)",
    "Figure 14: impacts take the velocity up to {y} of its largest value off the ideal model's, the angle {x}",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig14.png and fig14.svg."""
    return phase.files("fig14", PLANE, data)
