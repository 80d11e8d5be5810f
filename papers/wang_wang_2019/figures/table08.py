"""Table 8: largest errors of the CSJ model against the ideal model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.deviations import Deviation, max_deviation, velocity_at_events
from flexclear.papers.wang_wang_2019.models import (
    CSJ,
    FIRST,
    FIRST_CSJ,
    FIRST_IDEAL,
    IDEAL,
    JOINT,
    PLATFORM,
    Model,
    believed_until,
    references,
)
from flexclear.papers.wang_wang_2019.plotting.error_table import MEANING, comparison, heads, paper, rows, single
from flexclear.papers.wang_wang_2019.published import TABLE8
from flexclear.pipeline.post.plotting.table import Table, files
from flexclear.pipeline.post.single_run.series import parameters

#: a velocity within this factor of the printed one agrees: restitution, which is not printed, moves it by a tenth
VELOCITY = 1.5

NEEDS = (
    *references((IDEAL, CSJ, *FIRST), "run", "tight"),
    *references((CSJ, FIRST_CSJ), "post"),
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table08.csv and table08.md."""
    post = data[f"{CSJ.scene}:post"]
    (ours, tighter), (first, first_tighter) = _pair(data, CSJ, IDEAL), _pair(data, FIRST_CSJ, FIRST_IDEAL)
    columns = (
        paper("paper", TABLE8),
        single("ours", ours, tighter),
        single("ours, first layout", first, first_tighter),
    )
    clearance = 1e3 * float(post.clearance.sel(contact=JOINT))
    count, peak = int(post.impact_count.sel(contact=JOINT)), float(post.peak_force.sel(contact=JOINT))
    notes = (
        comparison("CSJ model", ours, TABLE8),
        f"The run has {count} impacts{_unfinished(post)}; the largest contact force is {peak:.0f} N, the "
        "platform's largest "
        f"vertical acceleration {float(post.peak_acceleration.sel(body=PLATFORM, axis='z')):.0f} m/s².",
        _restitution(data[f"{CSJ.scene}:run"], post),
        "Angle and displacement are fitted, not predicted: once the ball rests against the socket, leg 1 is "
        f"effectively {clearance:g} mm longer or shorter, and these errors are that length times the platform's "
        "sensitivity to it. The paper prints no joint coordinates; those here are of a layout that has the "
        "sensitivities for which the two rows ask ([geometry.md](geometry.md)).",
        _velocity(ours, first),
        _between_outputs(data),
        MEANING,
    )
    return files(
        "table08", Table("Table 8: largest errors, ideal model and CSJ model", heads(columns), rows(columns), notes)
    )


def _pair(data: dict[str, xr.Dataset], model: Model, ideal: Model) -> tuple[Deviation, Deviation]:
    """Largest deviations from the ideal mechanism of the same layout, at the scene's tolerance and at a tighter one."""
    until = believed_until(data[f"{model.scene}:post"])
    wide, tight = (
        max_deviation(data[f"{model.scene}:{run}"], data[f"{ideal.scene}:{run}"], PLATFORM, until)
        for run in ("run", "tight")
    )
    return wide, tight


def _velocity(ours: Deviation, first: Deviation) -> str:
    """The row that is a prediction, next to what the layout predicted that was assumed before."""
    ratio, before = 1e3 * ours.velocity / TABLE8.velocity, 1e3 * first.velocity / TABLE8.velocity
    missed = 1e3 * first.displacement / TABLE8.displacement
    agrees = 1.0 / VELOCITY < ratio < VELOCITY
    return (
        f"The velocity is a prediction{'' if agrees else ', and the paper contradicts it'}: it is {ratio:.2g} times "
        f"the printed one. The first layout, which was assumed before, has {before:.2g} times the printed velocity and "
        f"{missed:.2g} times the printed displacement. What restitution, gravity and the start of the ball change is "
        "in [geometry.md](geometry.md)."
    )


def _between_outputs(data: dict[str, xr.Dataset]) -> str:
    """How far the velocity is off at the events between the outputs that the rows compare."""
    run, ideal = data[f"{CSJ.scene}:run"], data[f"{IDEAL.scene}:run"]
    until = believed_until(data[f"{CSJ.scene}:post"])
    interval = 1e3 * float(np.median(np.diff(ideal.time.values)))
    speed, time = velocity_at_events(run, ideal, PLATFORM, until)
    return (
        f"The rows compare outputs, {interval:.2g} ms apart, as the ensembles of Table 9 have them. At all recorded "
        f"times, first touches of the ball among them, the velocity is off by up to {1e3 * speed:.1f} mm/s (at "
        f"{1e3 * time:.2f} ms)."
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
