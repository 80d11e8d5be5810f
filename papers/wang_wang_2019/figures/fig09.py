"""Figure 9: dynamic response of the ideal mechanism: z displacement, velocity, acceleration, reaction at A1."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import IDEAL, motion, references
from flexclear.papers.wang_wang_2019.plotting.panels import ACCELERATION, DISPLACEMENT, REACTION, VELOCITY
from flexclear.pipeline.post.plotting import style

NEEDS = references([IDEAL], "run", "post")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig09.png and fig09.svg."""
    ideal = motion(IDEAL, data)
    with style.style():
        figure, axes = style.grid(2, 2, (9.4, 5.8))
        for letter, panel, quantity in zip(
            "abcd", axes.flat, (DISPLACEMENT, VELOCITY, ACCELERATION, REACTION), strict=True
        ):
            panel.plot(ideal.time, quantity.values(ideal), color=IDEAL.color, lw=1.6)
            panel.set(
                xlabel="time (s)", ylabel=f"{quantity.title} ({quantity.unit})", xlim=(ideal.time[0], ideal.time[-1])
            )
            panel.set_title(f"({letter}) {quantity.title}")
        style.heading(
            figure,
            f"Figure 9: the ideal mechanism moves smoothly, up to "
            f"{1e-3 * np.abs(ideal.acceleration).max():.1f} m/s² and {ideal.reaction.max():.0f} N",
            "ideal model: centre of mass of the moving platform; reaction force at joint A1",
        )
        return style.files("fig09", figure)
