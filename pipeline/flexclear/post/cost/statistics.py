"""Statistics beyond the horizon: uncertainty of ensemble means by the number of members, by bootstrap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flexclear.post.plotting.style import files, grid, heading, plain, style
from flexclear.post.plotting.table import Table

RESAMPLES = 2000
SEED = 7
#: statistics of a chaotic run, by contact, and their units
STATISTICS = {"peak_force": "N", "impact_count": "1", "contact_time_share": "1"}
#: smallest part of an ensemble with a reported spread: resamples of fewer members mean little
FEWEST = 8
LOOKS = (("#0072B2", "o"), ("#E69F00", "s"), ("#009E73", "^"), ("#D55E00", "v"))


@dataclass(frozen=True, slots=True)
class Estimate:
    """Mean over the members, the members' standard deviation, and the 95 % bootstrap interval of the mean."""

    mean: float
    deviation: float
    low: float
    high: float


def estimate(values: np.ndarray) -> Estimate:
    """Estimate the mean from one value per member, shape (member,); the bootstrap's seed is fixed."""
    draws = np.random.default_rng(SEED).integers(0, len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(values[draws].mean(axis=1), [0.025, 0.975])
    return Estimate(float(values.mean()), float(values.std(ddof=1)), float(low), float(high))


def relative_error(values: np.ndarray) -> float:
    """Return half the interval of the mean as a fraction of the mean; NaN for a mean of zero."""
    mean = estimate(values)
    return 0.5 * (mean.high - mean.low) / abs(mean.mean) if mean.mean else np.nan


def growing(members: int) -> list[int]:
    """Return the sizes of the parts of an ensemble: doubled up to all members."""
    sizes = [FEWEST]
    while 2 * sizes[-1] < members:
        sizes.append(2 * sizes[-1])
    return [size for size in sizes if size < members] + [members]


def make(name: str, ensembles: dict[str, xr.Dataset], title: str) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``.svg``: statistical error of each mean against the cost of its members.

    ensembles: as of `table`, with ``cpu_seconds`` per member as an attribute.
    """
    contacts = [str(c) for c in next(iter(ensembles.values()))["contact"].values]
    panels = [(contact, statistic) for contact in contacts for statistic in STATISTICS]
    with style():
        figure, axes = grid(len(contacts), len(STATISTICS), (10.5, 1.3 + 2.9 * len(contacts)))
        for ax, (contact, statistic) in zip(axes.ravel(), panels, strict=True):
            _panel(ax, contact, statistic, ensembles)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8.4)
        text = "statistical error of ensemble means (half of the 95 % bootstrap interval), by the number of members; "
        heading(figure, title, text + "not pointwise")
        return files(name, figure)


def _panel(ax: Axes, contact: str, statistic: str, ensembles: dict[str, xr.Dataset]) -> None:
    for (color, mark), (name, ensemble) in zip(LOOKS, ensembles.items(), strict=False):
        values = ensemble[statistic].sel(contact=contact).values.astype(float)
        sizes = growing(len(values))
        seconds = [ensemble.attrs["cpu_seconds"] * size for size in sizes]
        errors = [relative_error(values[:size]) for size in sizes]
        ax.plot(seconds, errors, color=color, marker=mark, markersize=4.5, linewidth=1.0, label=name)
        for size, x, y in zip(sizes, seconds, errors, strict=True):
            ax.annotate(f"{size}", (x, y), xytext=(3, 3), textcoords="offset points", fontsize=6.8, color=color)
    ax.set(xscale="log", yscale="log", title=f"{contact} {statistic.replace('_', ' ')}")
    plain(ax.xaxis)
    plain(ax.yaxis)
    ax.set(xlabel="CPU time of the integrations (s)", ylabel="relative error of the mean")


def table(ensembles: dict[str, xr.Dataset], title: str) -> Table:
    """Tabulate statistics of every contact at each tolerance: a tolerance suffices where intervals of means overlap.

    ensembles: artifacts of schema ENSEMBLE by the name of their variation.
    """
    rows = []
    for name, ensemble in ensembles.items():
        for contact in ensemble["contact"].values:
            for statistic, unit in STATISTICS.items():
                mean = estimate(ensemble[statistic].sel(contact=contact).values.astype(float))
                interval = f"{mean.low:.4g} to {mean.high:.4g}"
                label = f"{contact} {statistic.replace('_', ' ')}" + (f" ({unit})" if unit != "1" else "")
                rows.append((name, label, f"{mean.mean:.4g}", f"{mean.deviation:.2g}", interval))
    notes = (
        "Statistical errors of ensemble means, not pointwise errors: beyond its horizon a single run is one draw "
        f"out of many. Intervals: 95 %, bootstrap with {RESAMPLES} resamples of the members.",
    )
    return Table(
        title, ("ensemble", "statistic", "mean", "std of a member", "95 % interval of the mean"), tuple(rows), notes
    )
