"""Figure 15: phase plots of displacement and velocity along z, all models."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting import phase

NEEDS = phase.NEEDS
PLANE = phase.Plane(
    lambda m: m.displacement,
    lambda m: m.velocity,
    "z displacement (mm)",
    "z velocity (mm/s)",
    "Figure 15: impacts take the velocity up to {y} of its largest value off the ideal model's, the displacement {x}",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig15.png and fig15.svg."""
    return phase.files("fig15", PLANE, data)
