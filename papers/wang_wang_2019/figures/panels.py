"""Figures 8, 9 and 11-13: the ideal motion; panels with angle, z, vz, az, reaction at A1 and the ball's deviation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from flexclear.publishing import style
from papers.comparison import Data, Figure, drawn, scale_differences
from papers.wang_wang_2019 import models as paper
from papers.wang_wang_2019.models import Quantity

#: alpha of a curve inside its horizon, of a curve that the paper lacks, and beyond the horizon
FIRM, ADDED, PALE = 0.95, 0.4, 0.28
#: number of time intervals for the envelope of a curve that the paper lacks: drawn as a curve, a ringing rod would
#: cover the paper's own curves
STRETCHES = 120


QUANTITIES = (paper.ANGLE, paper.DISPLACEMENT, paper.VELOCITY, paper.ACCELERATION, paper.REACTION)
LETTERS = "abcdef"
#: function of the ideal motion and the others that returns title and subtitle
Heading = Callable[[paper.Motion, Sequence[paper.Motion]], tuple[str, str]]


def _six_panels(heading: Heading, data: Data, models: Sequence[paper.Model], columns: int) -> Drawing:
    """Draw the paper's six panels, each with a slim one below.

    models: those compared with the ideal one, drawn in this order, with quantiles of their ensembles as bands. Where
    they have impacts, the slim panels of acceleration and reaction zoom to the ideal model's range; all others show the
    difference from the ideal model.  columns: of the legend.
    """
    reference, others = paper.motion(paper.IDEAL, data), [paper.motion(model, data) for model in models]
    loose = "contact" in others[0].post.sizes
    clearance = 1e3 * float(others[0].post.clearance.sel(contact=paper.JOINT)) if loose else 0.0
    figure, axes = style.grid(6, 2, (11.0, 12.2), height_ratios=[3, 1.15] * 3, sharex=False)
    for k, quantity in enumerate(QUANTITIES):
        main, strip = axes[2 * (k // 2), k % 2], axes[2 * (k // 2) + 1, k % 2]
        for motion in others:
            _band(main, quantity, motion)
        over_time(main, quantity, reference, others)
        main.set_title(f"({LETTERS[k]}) {quantity.title}")
        main.tick_params(labelbottom=False)
        if loose and quantity.jumps:
            over_time(strip, quantity, reference, others)
            strip.set_ylim(*_range(quantity.values(reference)))
            strip.set(xlabel="time (s)", ylabel=f"zoom\n{quantity.unit}")
        else:
            difference(strip, quantity, reference, others)
    for other in others:  # outputs may miss the largest force of an impact
        inside = other.impacts[:, 0] <= other.horizon
        axes[4, 0].plot(*other.impacts[inside].T, "o", ms=2.2, color=other.model.color)
    ball_deviation(axes[4, 1], reference, others, clearance)
    axes[4, 1].set_title("(f) centre of ball A1, minus ideal, global frame")
    ball_distance(axes[5, 1], reference, others)
    for panel in axes.flat:
        # the same position in every panel; aligning by the tick labels' sizes takes seconds
        panel.yaxis.set_label_coords(-0.105, 0.5)
    style.heading(figure, *heading(reference, others))
    style.shared_legend(figure, axes[0, 0], columns)
    return figure


def over_time(axes: Axes, quantity: Quantity, reference: paper.Motion, others: Sequence[paper.Motion]) -> None:
    """Draw one quantity of all models over time, pale beyond the horizon."""
    for motion in others:
        _curve(axes, motion, motion.time, quantity.values(motion), 0.8 if quantity.jumps else 1.6)
    look: dict[str, Any] = {"color": reference.model.color, "lw": 1.1, "ls": (0, (5, 2)), "zorder": 2.4}
    axes.plot(reference.time, quantity.values(reference), label=reference.model.label, **look)
    axes.set(ylabel=quantity.unit, xlim=(reference.time[0], reference.time[-1]))


def difference(axes: Axes, quantity: Quantity, reference: paper.Motion, others: Sequence[paper.Motion]) -> None:
    """Draw the slim panel with the differences from the ideal model."""
    axes.margins(y=0.12)
    for motion in others:
        _band(axes, quantity, motion, reference)
    sizes = []
    for motion in others:
        time, values = paper.minus(motion, reference, quantity.values)
        _curve(axes, motion, time, values, 0.9)
        sizes.append(float(np.abs(values).max()))
    axes.set(xlim=(reference.time[0], reference.time[-1]), xlabel="time (s)", ylabel=f"minus ideal\n{quantity.unit}")
    scale_differences(axes, sizes)


def ball_deviation(axes: Axes, reference: paper.Motion, others: Sequence[paper.Motion], clearance: float = 0.0) -> None:
    """Draw the ball's centre relative to that in the ideal model, x-z plane of the world, equal scales.

    The path itself is 60 mm long, so that no difference would be visible on it.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    paths = {motion.model.scene: paper.minus(motion, reference, _ball) for motion in others}
    factor, unit = _short(clearance, paths.values())
    if clearance > 0.0:
        edge = factor * clearance
        axes.plot(edge * np.cos(turn), edge * np.sin(turn), color=style.SOFT, lw=0.9, ls=":")
        axes.annotate("clearance", (0.0, edge), ha="center", va="bottom", fontsize=7.6, color=style.SOFT)
    for motion in sorted(others, key=lambda m: not m.model.ours):
        time, deviation_of_ball = paths[motion.model.scene]
        x, _, z = factor * deviation_of_ball.T
        inside = time <= motion.horizon
        axes.plot(x, z, color=motion.model.color, lw=0.6, alpha=PALE)
        axes.plot(x[inside], z[inside], color=motion.model.color, lw=1.1, alpha=FIRM)
    axes.plot(0.0, 0.0, "+", color=reference.model.color, ms=8, mew=1.4, zorder=4)
    axes.set(xlabel=f"x minus ideal ({unit})", ylabel=f"z minus ideal ({unit})")
    axes.locator_params(nbins=6)
    axes.set_aspect("equal", adjustable="datalim")


def ball_distance(axes: Axes, reference: paper.Motion, others: Sequence[paper.Motion]) -> None:
    """Draw the distance of the ball's centre from that of the ideal model, over time."""
    paths = [paper.minus(motion, reference, _ball) for motion in others]
    factor, unit = _short(0.0, paths)
    for motion, (time, deviation_of_ball) in zip(others, paths, strict=True):
        _curve(axes, motion, time, factor * np.linalg.norm(deviation_of_ball, axis=1), 0.9)
    axes.set_xlim(reference.time[0], reference.time[-1])
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel="time (s)", ylabel=f"from ideal\n{unit}")


def _ball(motion: paper.Motion) -> np.ndarray:
    return motion.ball


def _short(least: float, paths: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[float, str]:
    """Return factor and unit for drawn lengths [mm]: micrometres where all are below a tenth of a millimetre."""
    largest = max([least, *(float(np.abs(deviation_of_ball).max()) for _, deviation_of_ball in paths)])
    return (1e3, "µm") if largest < 0.1 else (1.0, "mm")


def _curve(axes: Axes, motion: paper.Motion, time: np.ndarray, values: np.ndarray, width: float) -> None:
    """Draw a curve, firm inside the horizon, pale beyond it; curves that the paper lacks are drawn as a band below."""
    inside = time <= motion.horizon
    if motion.model.ours:
        _envelope(axes, motion, values, time)
        return
    look: dict[str, Any] = {"color": motion.model.color, "lw": width, "zorder": 2.2}
    if not inside.all():
        axes.plot(time[~inside], values[~inside], alpha=PALE, **look)
    axes.plot(time[inside], values[inside], alpha=FIRM, label=motion.model.label, **look)


def _envelope(axes: Axes, motion: paper.Motion, values: np.ndarray, time: np.ndarray) -> None:
    """Draw the band that a curve fills, interval by interval, paler beyond the horizon."""
    edges = np.linspace(time[0], time[-1], STRETCHES + 1)
    first = np.searchsorted(time, edges[:-1])
    first = first[np.append(np.diff(first) > 0, first[-1] < len(time))]
    low, high = np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)
    middle = np.append(0.5 * (time[first[:-1]] + time[first[1:]]), time[-1])
    middle[0] = time[0]
    for part, alpha in ((middle <= motion.horizon, ADDED), (middle >= motion.horizon, PALE)):
        look: dict[str, Any] = {"color": motion.model.color, "alpha": alpha, "lw": 0.8, "zorder": 1.8}
        axes.fill_between(middle[part], low[part], high[part], **look)
    axes.plot([], [], color=motion.model.color, lw=1.6, label=motion.model.label)


def _band(axes: Axes, quantity: Quantity, motion: paper.Motion, reference: paper.Motion | None = None) -> None:
    """Draw the ensemble's middle nine tenths and its median, beyond the horizon only; minus the reference where given.

    Quantiles, as most values of a force are zero and none is negative, while mean minus deviation would be.
    """
    post = motion.post
    if "ensemble_time" not in post.sizes:
        return
    name, factor = quantity.ensemble
    low, middle, high = (_column(post[f"{name}_quantile"].sel(quantile=q)) * factor for q in (0.05, 0.5, 0.95))
    time = post.ensemble_time.values
    if reference is not None:
        i, j = paper.common_times(time, reference.time)
        ideal = quantity.values(reference)[j]
        time, low, middle, high = time[i], low[i] - ideal, middle[i] - ideal, high[i] - ideal
    beyond = time >= motion.horizon
    axes.fill_between(time[beyond], low[beyond], high[beyond], color=motion.model.color, alpha=0.22, lw=0)
    axes.plot(time[beyond], middle[beyond], color=motion.model.color, lw=0.8)


def _column(variable: xr.DataArray) -> np.ndarray:
    if "ensemble_body" in variable.dims:
        variable = variable.sel(ensemble_body=paper.PLATFORM)
    if "axis" in variable.dims:
        variable = variable.sel(axis="z")
    return variable.values.reshape(variable.sizes["ensemble_time"], -1)[:, 0]


def _range(values: np.ndarray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    margin = 0.35 * (high - low)
    return (low - margin, high + margin) if low < 0.0 else (-0.05 * (high - low), high + margin)


def _of_rods(ideal: paper.Motion, others: Sequence[paper.Motion]) -> tuple[str, str]:
    moved = {m.model.scene: 1e3 * np.abs(paper.minus(m, ideal, paper.DISPLACEMENT.values)[1]).max() for m in others}
    fixed = moved[paper.FAR_FIXED.scene]
    little = f"{fixed:.1g} µm" if fixed > 1e-6 else "nothing"  # near rounding
    return (
        f"Figure 11: a flexible rod moves the platform by {moved[paper.FAR_CB.scene]:.2g} µm at most; free-free modes "
        f"find {moved[paper.FAR_FREE.scene]:.1g} µm of it, fixed-fixed modes {little}",
        "slim panels (added): difference from the ideal model; the added mode set is drawn as the band that it fills",
    )


def _of_clearance(ideal: paper.Motion, others: Sequence[paper.Motion]) -> tuple[str, str]:
    (csj,) = others
    count, peak = (csj.post[name].sel(contact=paper.JOINT) for name in ("impact_count", "peak_force"))
    return (
        f"Figure 12: {int(count)} impacts raise the largest force at A1 from {ideal.reaction.max():.0f} to "
        f"{float(peak):.0f} N, the acceleration from "
        f"{1e-3 * np.abs(ideal.acceleration).max():.0f} to {1e-3 * np.abs(csj.acceleration).max():.0f} m/s²",
        "slim panels (added): difference from the ideal model, or a zoom to its range; "
        "dots: largest normal force of each impact, as in the title",
    )


def _of_both(ideal: paper.Motion, others: Sequence[paper.Motion]) -> tuple[str, str]:
    rigid, *flexible = others
    peaks = [f"{float(rigid.post.peak_acceleration.sel(body=paper.PLATFORM, axis='z')):.0f} (CSJ)"]
    for motion in flexible:
        mean = float(motion.post.peak_acceleration_mean.sel(ensemble_body=paper.PLATFORM, axis="z"))
        peaks.append(f"{mean:.0f} ({paper.mode_set(motion.model)})")
    return (
        "Figure 13: the mode set decides how far a flexible rod softens the impacts",
        f"largest acceleration in m/s², of ensembles the mean: {', '.join(peaks)}. Beyond its horizon a single run is "
        "pale, bands are the middle 90 % of the ensembles (the added set's run is drawn as the band that it fills); "
        "dots: largest force of each impact",
    )


@drawn(
    "Figure 8: trajectory of the moving platform about the y0 axis, ideal model",
    *paper.references([paper.IDEAL], "run", "post"),
)
def tilt(data: Data) -> Drawing:
    """Draw the angle over the stroke, with its largest value marked."""
    ideal = paper.motion(paper.IDEAL, data)
    figure, axes = style.grid(1, 1, (6.4, 3.5))
    _single_curve(axes[0, 0], paper.ANGLE, ideal, 1.8)
    _mark_extreme(axes[0, 0], ideal.time, ideal.angle)
    tilt = float(np.degrees(np.abs(ideal.angle).max()))
    style.heading(
        figure,
        f"Figure 8: the platform tilts by {tilt:.2f}° and comes back",
        "rotation about y0 = asin R_WP[0, 2], ideal model",
    )
    return figure


def _single_curve(axes: style.Axes, quantity: Quantity, motion: paper.Motion, width: float) -> None:
    axes.plot(motion.time, quantity.values(motion), color=motion.model.color, lw=width)
    axes.set(xlabel="time (s)", ylabel=quantity.label, xlim=(motion.time[0], motion.time[-1]))


def _mark_extreme(axes: style.Axes, time: np.ndarray, angle: np.ndarray) -> None:
    """Mark the largest tilt by a dot and its value."""
    i = int(np.argmax(np.abs(angle)))
    axes.plot(time[i], angle[i], "o", color=paper.IDEAL.color, ms=5)
    text = f"{angle[i]:.4f} rad = {np.degrees(angle[i]):.2f}° at {time[i]:.3f} s".replace("-", "−")
    shift = (0, -110 if angle[i] > 0.0 else 110)
    look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "color": style.SOFT}
    axes.annotate(text, (time[i], angle[i]), xytext=shift, **look)


@drawn(
    "Figure 9: dynamic response of the ideal mechanism: z displacement, velocity, acceleration, reaction at A1",
    *paper.references([paper.IDEAL], "run", "post"),
)
def response(data: Data) -> Drawing:
    """Draw four panels over the stroke."""
    ideal = paper.motion(paper.IDEAL, data)
    figure, axes = style.grid(2, 2, (9.4, 5.8))
    shown = QUANTITIES[1:]
    for letter, panel, quantity in zip("abcd", axes.flat, shown, strict=True):
        _single_curve(panel, quantity, ideal, 1.6)
        panel.set_title(f"({letter}) {quantity.title}")
    style.heading(
        figure,
        f"Figure 9: the ideal mechanism moves smoothly, up to "
        f"{1e-3 * np.abs(ideal.acceleration).max():.1f} m/s² and {ideal.reaction.max():.0f} N",
        "ideal model: centre of mass of the moving platform; reaction force at joint A1",
    )
    return figure


def _figure(title: str, heading: Heading, models: Sequence[paper.Model], columns: int) -> Figure:
    needs = paper.references((paper.IDEAL, *models), "run", "post")
    return Figure(title, needs, lambda data: _six_panels(heading, data, models, columns))


FIG11 = _figure("Figure 11: flexible actuated rod (FAR) against the ideal model, six panels", _of_rods, paper.FAR, 4)
FIG12 = _figure(
    "Figure 12: clearance spherical joint (CSJ) against the ideal model, six panels", _of_clearance, [paper.CSJ], 2
)
FIG13 = _figure(
    "Figure 13: flexible rod and clearance (FAR-CSJ), CSJ and ideal models, six panels",
    _of_both,
    (paper.CSJ, *paper.FAR_CSJ),
    3,
)
