"""Statistics beyond the horizon: uncertainty of ensemble means, by bootstrap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.post.plotting.table import Table

RESAMPLES = 2000
SEED = 7
#: statistics of a chaotic run, by contact, and their units
STATISTICS = {"peak_force": "N", "impact_count": "1", "contact_time_share": "1"}


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
