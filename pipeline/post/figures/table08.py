"""Table 8: largest errors of the CSJ model against the ideal model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.post.errors import max_deviation
from flexclear.pipeline.post.models import CSJ, IDEAL, JOINT, PLATFORM, believed_until
from flexclear.pipeline.post.paper import TABLE8
from flexclear.pipeline.post.plotting.error_table import MEANING, comparison, heads, paper, rows, single
from flexclear.pipeline.post.plotting.table import Table, files
from flexclear.pipeline.post.series import parameters

NEEDS = (
    "sps4/ideal:run",
    "sps4/csj:run",
    "sps4/csj:post",
    "sps4/ideal:tight",
    "sps4/csj:tight",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table08.csv and table08.md."""
    post = data[f"{CSJ.scene}:post"]
    ours, tighter = (
        max_deviation(data[f"{CSJ.scene}:{run}"], data[f"{IDEAL.scene}:{run}"], PLATFORM, believed_until(post))
        for run in ("run", "tight")
    )
    columns = (paper("paper", TABLE8), single("ours", ours, tighter))
    clearance = 1e3 * float(post.clearance.sel(contact=JOINT))
    count, peak = int(post.impact_count.sel(contact=JOINT)), float(post.peak_force.sel(contact=JOINT))
    notes = (
        comparison("CSJ model", ours, TABLE8),
        f"The run has {count} impacts{_unfinished(post)}; the largest contact force is {peak:.0f} N, the "
        "platform's largest "
        f"vertical acceleration {float(post.peak_acceleration.sel(body=PLATFORM, axis='z')):.0f} m/s².",
        _restitution(data[f"{CSJ.scene}:run"], post),
        "Angle and displacement errors are geometry: once the ball rests against the socket, leg 1 is "
        f"effectively {clearance:g} mm longer or shorter, "
        "and the errors are that length times the platform's sensitivity to it. The paper prints no joint "
        "coordinates; the assumed ones cannot be "
        "expected to give the same sensitivities. The velocity error also depends on the coefficient of "
        "restitution, which the paper does not print.",
        MEANING,
    )
    return files(
        "table08", Table("Table 8: largest errors, ideal model and CSJ model", heads(columns), rows(columns), notes)
    )


def _unfinished(post: xr.Dataset) -> str:
    cut = int(np.isnan(post.impact_duration.values).sum())
    return f" ({cut} of them still in contact at the end)" if cut else ""


def _restitution(run: xr.Dataset, post: xr.Dataset) -> str:
    """What is asked for, what the law gives a free impact, and what the impacts of the run show."""
    asked = parameters(run)["joint"][JOINT]["normal"]["restitution"]
    delivered = float(run.contact_delivered_restitution.sel(contact=JOINT))
    shown = (post.impact_separation_speed / post.impact_approach_speed).values
    shown = shown[np.isfinite(shown)]
    return (
        f"Restitution: {asked:g} is assumed, the contact law gives a free impact {delivered:.3f}; in the run "
        "separation "
        f"over approach speed has the median {np.median(shown):.3f} (from {shown.min():.2f} to {shown.max():.2f}: "
        "drives "
        "and friction act meanwhile)."
    )
