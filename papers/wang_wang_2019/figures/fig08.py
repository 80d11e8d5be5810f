"""Figure 8: trajectory of the moving platform about the y0 axis, ideal model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import IDEAL, motion, references
from flexclear.pipeline.post.plotting import style

NEEDS = references([IDEAL], "run", "post")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig08.png and fig08.svg."""
    ideal = motion(IDEAL, data)
    with style.style():
        figure, axes = style.grid(1, 1, (6.4, 3.5))
        axes[0, 0].plot(ideal.time, ideal.angle, color=IDEAL.color, lw=1.8)
        axes[0, 0].set(xlabel="time (s)", ylabel="angle about y0 (rad)", xlim=(ideal.time[0], ideal.time[-1]))
        _mark_extreme(axes[0, 0], ideal.time, ideal.angle)
        tilt = float(np.degrees(np.abs(ideal.angle).max()))
        style.heading(
            figure,
            f"Figure 8: the platform tilts by {tilt:.2f}° and comes back",
            "rotation about y0 = asin R_WP[0, 2], ideal model",
        )
        return style.files("fig08", figure)


def _mark_extreme(axes: style.Axes, time: np.ndarray, angle: np.ndarray) -> None:
    """A dot and the value at the largest tilt."""
    i = int(np.argmax(np.abs(angle)))
    axes.plot(time[i], angle[i], "o", color=IDEAL.color, ms=5)
    text = f"{angle[i]:.4f} rad = {np.degrees(angle[i]):.2f}° at {time[i]:.3f} s".replace("-", "−")
    below = angle[i] > 0.0
    axes.annotate(
        text,
        (time[i], angle[i]),
        xytext=(0, -110 if below else 110),
        textcoords="offset points",
        ha="center",
        color=style.SOFT,
    )
