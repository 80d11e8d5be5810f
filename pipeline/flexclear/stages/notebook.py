"""What the dataset of a run shows in a notebook above its variables: title, curves, how it was computed."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from flexclear.post.pages import small_picture

if TYPE_CHECKING:
    from flexclear.artifacts.recorded import Recorded

#: attributes of a run that say how it was computed, and their labels
COST = {
    "method": "integrator",
    "method_reason": "reason for this integrator",
    "evaluations": "evaluations of the equations of motion",
    "steps": "steps",
    "rejected_steps": "rejected steps (error too large)",
    "jacobians": "Jacobians of the equations",
    "projections": "projections onto the loop closures",
    "switched": "another integrator continued",
    "stiff_share": "fraction of the steps limited by stability instead of accuracy",
    "redundant_closure_rows": "redundant loop closure conditions",
    "accuracy_verdict": "requested accuracy",
}
#: most watched quantities that are drawn
DRAWN = 3


def run_head(run: Recorded) -> str:
    """Return the head of a run that knows its scene, as HTML."""
    from flexclear.artifacts.recorded import scene_of
    from flexclear.post.overview.figures import watched_curves

    picture, time = watched_curves(run, scene_of(run).watched_quantities()[:DRAWN], width=6.0), run["time"].values
    rows = {"recorded": f"{time[0]:g} to {time[-1]:g} s, {len(time)} rows"}
    rows |= {label: str(run.attrs[name]) for name, label in COST.items() if name in run.attrs}
    cells = "".join(f"<tr><th>{label}</th><td>{html.escape(text)}</td></tr>" for label, text in rows.items())
    shown = "" if picture is None else small_picture(picture)
    return f"<p><b>{html.escape(str(run.attrs['title']))}</b></p>{shown}<table>{cells}</table>"
