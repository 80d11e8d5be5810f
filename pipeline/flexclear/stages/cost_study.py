"""All points of a cost study -> dataset, price list, work-precision figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from flexclear.post.cost import work_precision
from flexclear.post.cost.study import (
    Point,
    assemble,
    comparable_until,
    cost_of_run,
    price_list,
    relative_errors,
    skipped_sentence,
    with_reference,
)
from flexclear.post.cost.work_precision import Mark
from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``cost.nc``, its table and its figure.

    params: `points` (key, group, factors, name of the input), `quantities` (owner, kind), `title`, the scene's `own`
    setting (own_integrator, own_rtol or own_step), in words what the budget left `undone`, whether the study is
    `complete`, and `peers`, as of `work_precision.peers`. The reference is the tightest run among the
    points; a run by another method confirms it.
    """
    points = [Point(p["key"], p["group"], p["factors"]) for p in params["points"]]
    runs = {p["key"]: inputs[p["input"]] for p in params["points"]}
    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    points = with_reference(points, runs, chosen)
    study = assemble(points, runs, chosen)
    study.attrs |= params["own"] | {"undone": params["undone"], "complete": int(params["complete"])}
    asis = next(runs[p.key] for p in points if p.key == "as it is")
    study.attrs |= {
        "own_seconds": cost_of_run(asis, "cpu_seconds"),
        "own_evaluations": cost_of_run(asis, "evaluations"),
    }
    title = params["title"]
    notes = tuple(dict.fromkeys(f"{track['note']}." for track in params["peers"] if track["note"]))
    notes += (*skipped_sentence(study),)
    reference = runs[next(p.key for p in points if p.group == "reference")]
    errors = relative_errors(asis, reference, chosen, comparable_until(points, runs))
    mark, others = (
        Mark("this scene", cost_of_run(asis, "cpu_seconds"), errors),
        work_precision.peers(study, params["peers"]),
    )
    figure = work_precision.make("work_precision", study, f"Error against cost: {title}", (mark,), others)
    return {"nc": study} | files("price", price_list(study, f"What accuracy costs: {title}", notes)) | figure
