"""The figure of sections and their verdict."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flexclear.post.plotting import style

COLOR, LIGHT = "#1f6f8b", "#b9b9b9"
POINT = {"s": 9, "lw": 0, "color": COLOR, "alpha": 0.8}


def make(sections: xr.Dataset, verdict: xr.Dataset) -> dict[str, bytes]:
    """Draw sections.png and sections.svg."""
    with style.style():
        figure, axes = style.grid(1, 4, (13.2, 3.9))
        section, returns, power, growth = axes[0]
        _section(section, verdict)
        _returns(returns, verdict)
        _power(power, verdict)
        _growth(growth, sections, verdict)
        style.heading(
            figure,
            f"A {verdict.attrs['verdict']} motion" if verdict.attrs["verdict"] != "undecided" else "Undecided",
            verdict.attrs["reasons"],
        )
        return style.files("sections", figure)


def _section(axes: Axes, verdict: xr.Dataset) -> None:
    shown = verdict.principal.values
    other = shown[:, 1] if shown.shape[1] > 1 else np.zeros(len(shown))
    axes.scatter(shown[:, 0], other, **POINT)  # type: ignore[arg-type]
    axes.set(title="section", xlabel="along the largest variance", ylabel="along the second largest")


def _returns(axes: Axes, verdict: xr.Dataset) -> None:
    first = verdict.principal.values[:, 0]
    low, high = float(first.min()), float(first.max())
    axes.plot([low, high], [low, high], color=LIGHT, lw=1.0, zorder=1)
    axes.scatter(first[:-1], first[1:], **POINT)  # type: ignore[arg-type]
    axes.set(title="return map", xlabel="this period", ylabel="next period")


def _power(axes: Axes, verdict: xr.Dataset) -> None:
    axes.set(title="spectrum", xlabel="cycles per period", ylabel="fraction of the variance")
    if not verdict.power.values.any():
        axes.text(0.5, 0.5, "the states are constant", transform=axes.transAxes, ha="center", color=style.SOFT)
        return
    for component in range(verdict.sizes["component"])[::-1]:
        power = np.maximum(verdict.power.values[1:, component], 1e-16)
        axes.semilogy(verdict.frequency.values[1:], power, lw=0.9, color=COLOR if component == 0 else LIGHT)
    axes.set_ylim(bottom=max(1e-16, axes.get_ylim()[0]))


def _growth(axes: Axes, sections: xr.Dataset, verdict: xr.Dataset) -> None:
    grown = np.cumsum(sections.growth.values)
    number = np.arange(1, len(grown) + 1)
    axes.plot(number, grown, color=COLOR)
    period = float(sections.attrs["period"])
    axes.fill_between(
        number,
        float(verdict.exponent_low) * period * number,
        float(verdict.exponent_high) * period * number,
        color=COLOR,
        alpha=0.18,
        lw=0,
    )
    axes.set(title="separation of a neighbour", xlabel="period", ylabel="logarithm of its distance's growth factor")
