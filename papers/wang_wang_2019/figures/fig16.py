"""Figure 16: phase plots of velocity and acceleration along z, all models."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting import phase

NEEDS = phase.NEEDS
PLANE = phase.Plane(
    lambda m: m.velocity,
    lambda m: 1e-3 * m.acceleration,
    "z velocity (mm/s)",
    "z acceleration (10³ mm/s²)",
    "Figure 16: the acceleration shows every impact; in between the platform moves without leg 1",
    spikes=True,
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig16.png and fig16.svg."""
    return phase.files("fig16", PLANE, data)
