"""The six panels of figures 11-13: angle, z, vz, az, reaction at A1, trajectory of the ball's centre."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.core.quantities import common_times
from pipeline.post.models import PLATFORM, Motion
from pipeline.post.plotting import style

#: alpha of a curve inside its horizon, of one that the paper does not have, and beyond the horizon
FIRM, ADDED, PALE = 0.95, 0.6, 0.28


@dataclass(frozen=True, slots=True)
class Quantity:
    """One panel over time. `jumps`: impacts drive it far out of the ideal model's range."""

    title: str
    unit: str
    values: Callable[[Motion], np.ndarray]
    jumps: bool
    ensemble: tuple[str, float] | None = None  #: variable of the post artifact, factor to the unit


ANGLE = Quantity("angle about y0", "rad", lambda m: m.angle, False, ensemble=("rotation_y", 1.0))
DISPLACEMENT = Quantity("displacement along z0", "mm", lambda m: m.displacement, False, ensemble=("displacement", 1e3))
VELOCITY = Quantity("velocity along z0", "mm/s", lambda m: m.velocity, False, ensemble=("velocity", 1e3))
ACCELERATION = Quantity(
    "acceleration along z0", "10³ mm/s²", lambda m: 1e-3 * m.acceleration, True, ensemble=("acceleration", 1.0)
)
REACTION = Quantity("reaction force at A1", "N", lambda m: m.reaction, True, ensemble=("normal_force", 1.0))
QUANTITIES = (ANGLE, DISPLACEMENT, VELOCITY, ACCELERATION, REACTION)
LETTERS = "abcdef"


def six_panels(
    reference: Motion, others: Sequence[Motion], posts: Sequence[xr.Dataset] = (), *, impacts: bool
) -> tuple[Figure, Axes]:
    """Figure with the paper's six panels, each with a slim one below; returns it and the axes that hold labels.

    reference: the ideal model.  others: the models compared with it, drawn in this order.
    posts: post artifacts whose ensemble's quantiles are drawn as a band, one per model of `others`.
    impacts: with them the slim panels of acceleration and reaction zoom to the ideal model's range;
    all others show the difference from the ideal model.
    """
    figure, axes = style.grid(6, 2, (11.0, 12.2), height_ratios=[3, 1.15] * 3, sharex=False)
    for k, quantity in enumerate(QUANTITIES):
        main, strip = axes[2 * (k // 2), k % 2], axes[2 * (k // 2) + 1, k % 2]
        over_time(main, quantity, reference, others, posts)
        main.set_title(f"({LETTERS[k]}) {quantity.title}")
        main.tick_params(labelbottom=False)
        if impacts and quantity.jumps:
            zoomed(strip, quantity, reference, others)
        else:
            difference(strip, quantity, reference, others)
    for motion in others:
        _peaks(axes[4, 0], motion)
    trajectory(axes[4, 1], reference, others)
    axes[4, 1].set_title("(f) centre of ball A1 in the global frame")
    ball_distance(axes[5, 1], reference, others)
    for panel in axes.flat:
        # the same place in every panel; aligning by the tick labels' sizes takes seconds
        panel.yaxis.set_label_coords(-0.105, 0.5)
    return figure, axes[0, 0]


def over_time(
    axes: Axes, quantity: Quantity, reference: Motion, others: Sequence[Motion], posts: Sequence[xr.Dataset] = ()
) -> None:
    """One quantity of all models over time; pale beyond the horizon, with the ensembles' bands."""
    for motion, post in zip(others, posts, strict=bool(posts)):
        _band(axes, quantity, motion, post)
    for motion in others:
        _curve(axes, motion, quantity.values(motion), _width(quantity))
    axes.plot(
        reference.time,
        quantity.values(reference),
        color=reference.model.color,
        lw=1.1,
        ls=(0, (5, 2)),
        label=reference.model.label,
        zorder=2.4,
    )
    axes.set_ylabel(quantity.unit)
    axes.set_xlim(reference.time[0], reference.time[-1])


def zoomed(axes: Axes, quantity: Quantity, reference: Motion, others: Sequence[Motion]) -> None:
    """The slim panel with the same curves in the ideal model's range."""
    over_time(axes, quantity, reference, others)
    axes.set_ylim(*_range(quantity.values(reference)))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"zoom\n{quantity.unit}")


def difference(axes: Axes, quantity: Quantity, reference: Motion, others: Sequence[Motion]) -> None:
    """The slim panel with what differs from the ideal model."""
    axes.margins(y=0.12)
    for motion in others:
        time, values = deviation(quantity, motion, reference)
        _curve(axes, motion, values, 0.9, time)
    axes.set_xlim(reference.time[0], reference.time[-1])
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"minus ideal\n{quantity.unit}")
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))


def deviation(quantity: Quantity, motion: Motion, reference: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Common times and the quantity minus the reference's there."""
    i, j = common_times(motion.time, reference.time)
    return motion.time[i], quantity.values(motion)[i] - quantity.values(reference)[j]


def trajectory(axes: Axes, reference: Motion, others: Sequence[Motion]) -> None:
    """Path of the ball's centre in the x-z plane of the world, equal scales."""
    for motion in others:
        inside = motion.time <= motion.horizon
        axes.plot(motion.ball[:, 0], motion.ball[:, 2], color=motion.model.color, lw=0.8, alpha=PALE)
        axes.plot(motion.ball[inside, 0], motion.ball[inside, 2], color=motion.model.color, lw=1.2, alpha=FIRM)
    axes.plot(reference.ball[:, 0], reference.ball[:, 2], color=reference.model.color, lw=1.1, ls=(0, (5, 2)))
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("z (mm)")
    axes.set_aspect("equal", adjustable="datalim")


def ball_distance(axes: Axes, reference: Motion, others: Sequence[Motion]) -> None:
    """Distance of the ball's centre from where the ideal model has it, over time [mm]."""
    for motion in others:
        i, j = common_times(motion.time, reference.time)
        distance = np.linalg.norm(motion.ball[i] - reference.ball[j], axis=1)
        _curve(axes, motion, distance, 0.9, motion.time[i])
    axes.set_xlim(reference.time[0], reference.time[-1])
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("from ideal\nmm")
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))


def _curve(axes: Axes, motion: Motion, values: np.ndarray, width: float, time: np.ndarray | None = None) -> None:
    """Firm inside the horizon, pale beyond it; what the paper does not have lies below what it has."""
    time = motion.time if time is None else time
    inside = time <= motion.horizon
    look: dict[str, Any] = {"color": motion.model.color, "lw": width, "zorder": 2.0 if motion.model.ours else 2.2}
    if not inside.all():
        axes.plot(time[~inside], values[~inside], alpha=PALE, **look)
    alpha = ADDED if motion.model.ours else FIRM
    axes.plot(time[inside], values[inside], alpha=alpha, label=motion.model.label, **look)


def _peaks(axes: Axes, motion: Motion) -> None:
    """Largest force of each impact inside the horizon; the outputs in between may miss it."""
    inside = motion.impacts[:, 0] <= motion.horizon
    axes.plot(*motion.impacts[inside].T, "o", ms=2.2, color=motion.model.color)


def _band(axes: Axes, quantity: Quantity, motion: Motion, post: xr.Dataset) -> None:
    """Middle nine tenths of the ensemble and its median, beyond the horizon only.

    Quantiles, as forces are not negative and most of their values are zero: a mean minus a deviation would be.
    """
    if quantity.ensemble is None or "ensemble_time" not in post.sizes:
        return
    name, factor = quantity.ensemble
    low, middle, high = (_column(post[f"{name}_quantile"].sel(quantile=q)) * factor for q in (0.05, 0.5, 0.95))
    time = post.ensemble_time.values
    beyond = time >= motion.horizon
    axes.fill_between(time[beyond], low[beyond], high[beyond], color=motion.model.color, alpha=0.22, lw=0)
    axes.plot(time[beyond], middle[beyond], color=motion.model.color, lw=0.8)


def _column(variable: xr.DataArray) -> np.ndarray:
    if "kept" in variable.dims:
        variable = variable.sel(kept=PLATFORM)
    if "axis" in variable.dims:
        variable = variable.sel(axis="z")
    return variable.values.reshape(variable.sizes["ensemble_time"], -1)[:, 0]


def _width(quantity: Quantity) -> float:
    return 0.8 if quantity.jumps else 1.6


def _range(values: np.ndarray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    margin = 0.35 * (high - low)
    return (low - margin, high + margin) if low < 0.0 else (-0.05 * (high - low), high + margin)
