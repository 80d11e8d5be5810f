"""Table 8: largest errors of the CSJ model against the ideal model."""

from __future__ import annotations

import xarray as xr

from pipeline.post.errors import max_deviation
from pipeline.post.models import CSJ, IDEAL, JOINT, PLATFORM
from pipeline.post.paper import TABLE8
from pipeline.post.plotting.error_table import MEANING, comparison, heads, paper, rows, single
from pipeline.post.plotting.table import Table, files

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
        max_deviation(data[f"{CSJ.scene}:{run}"], data[f"{IDEAL.scene}:{run}"], PLATFORM, float(post.horizon))
        for run in ("run", "tight")
    )
    columns = (paper("paper", TABLE8), single("ours", ours, tighter))
    clearance = 1e3 * float(post.clearance.sel(contact=JOINT))
    count, peak = int(post.impact_count.sel(contact=JOINT)), float(post.peak_force.sel(contact=JOINT))
    notes = (
        comparison("CSJ model", ours, TABLE8),
        f"The run has {count} impacts; the largest contact force is {peak:.0f} N.",
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
