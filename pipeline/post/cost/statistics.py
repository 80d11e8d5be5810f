"""Beyond the horizon: how well an ensemble of a given size knows its own mean, by bootstrap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.post.plotting.table import Table

RESAMPLES = 2000
SEED = 7
#: what is asked of a chaotic run, by contact, and its unit
STATISTICS = {"peak_force": "N", "impact_count": "1", "contact_time_share": "1"}


@dataclass(frozen=True, slots=True)
class Estimate:
    """Mean over the members, the members' standard deviation, and the 95 % bootstrap interval of the mean."""

    mean: float
    deviation: float
    low: float
    high: float


def estimate(values: np.ndarray) -> Estimate:
    """Of one value per member, shape (member,); the bootstrap's seed is fixed."""
    draws = np.random.default_rng(SEED).integers(0, len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(values[draws].mean(axis=1), [0.025, 0.975])
    return Estimate(float(values.mean()), float(values.std(ddof=1)), float(low), float(high))


def table(ensembles: dict[str, xr.Dataset], title: str) -> Table:
    """Statistics of every contact at each tolerance: means agree within their intervals when it suffices.

    ensembles: artifacts of schema ENSEMBLE by the name of what was varied.
    """
    rows = []
    for name, ensemble in ensembles.items():
        for contact in ensemble["contact"].values:
            for statistic, unit in STATISTICS.items():
                found = estimate(ensemble[statistic].sel(contact=contact).values.astype(float))
                interval = f"{found.low:.4g} to {found.high:.4g}"
                label = f"{contact} {statistic.replace('_', ' ')}" + (f" ({unit})" if unit != "1" else "")
                rows.append((name, label, f"{found.mean:.4g}", f"{found.deviation:.2g}", interval))
    notes = (
        "Statistical errors of ensemble means, not pointwise errors: beyond its horizon a single run is one draw "
        f"out of many. Intervals: 95 %, bootstrap with {RESAMPLES} resamples of the members.",
    )
    return Table(
        title, ("ensemble", "statistic", "mean", "std of a member", "95 % interval of the mean"), tuple(rows), notes
    )
