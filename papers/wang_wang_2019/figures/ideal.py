"""Figures 8 and 9: the motion of the ideal mechanism."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure as Drawing

from flexclear.papers.wang_wang_2019.figures import Data, Figure
from flexclear.papers.wang_wang_2019.figures.panels import ACCELERATION, DISPLACEMENT, REACTION, VELOCITY
from flexclear.papers.wang_wang_2019.models import IDEAL, motion, references
from flexclear.pipeline.post.plotting import style


def _trajectory(data: Data) -> Drawing:
    ideal = motion(IDEAL, data)
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
    return figure


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


def _response(data: Data) -> Drawing:
    ideal = motion(IDEAL, data)
    figure, axes = style.grid(2, 2, (9.4, 5.8))
    shown = (DISPLACEMENT, VELOCITY, ACCELERATION, REACTION)
    for letter, panel, quantity in zip("abcd", axes.flat, shown, strict=True):
        panel.plot(ideal.time, quantity.values(ideal), color=IDEAL.color, lw=1.6)
        panel.set(xlabel="time (s)", ylabel=f"{quantity.title} ({quantity.unit})", xlim=(ideal.time[0], ideal.time[-1]))
        panel.set_title(f"({letter}) {quantity.title}")
    style.heading(
        figure,
        f"Figure 9: the ideal mechanism moves smoothly, up to "
        f"{1e-3 * np.abs(ideal.acceleration).max():.1f} m/s² and {ideal.reaction.max():.0f} N",
        "ideal model: centre of mass of the moving platform; reaction force at joint A1",
    )
    return figure


NEEDS = references([IDEAL], "run", "post")
FIG08 = Figure("Figure 8: trajectory of the moving platform about the y0 axis, ideal model", NEEDS, _trajectory)
FIG09 = Figure(
    "Figure 9: dynamic response of the ideal mechanism: z displacement, velocity, acceleration, reaction at A1",
    NEEDS,
    _response,
)
