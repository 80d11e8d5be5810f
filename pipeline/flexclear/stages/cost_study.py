"""All points of a cost study -> dataset, price list, work-precision figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from flexclear.post.cost import work_precision
from flexclear.post.cost.study import OWN, Point, assemble, price_list, skipped_sentence
from flexclear.post.cost.work_precision import Mark
from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``cost.nc``, its table and its figure.

    params: `points` (key, integrator, rtol or step), `quantities` (owner, kind), `title`, the scene's `own` setting
    (own_integrator, own_rtol or own_step), in words what the budget left `undone`, whether the study is `complete`, and
    `peers`, as of `work_precision.peers`. inputs: the scene's ``own`` run, and ``point<k>``.
    """
    points = [Point(**one) for one in params["points"]]
    runs = {OWN: inputs["own"]} | {point.key: inputs[f"point{k}"] for k, point in enumerate(points)}
    study = assemble(points, runs, [Quantity.read(data) for data in params["quantities"]])
    study.attrs |= params["own"] | {"undone": params["undone"], "complete": int(params["complete"])}
    title = params["title"]
    notes = tuple(dict.fromkeys(f"{track['note']}." for track in params["peers"] if track["note"]))
    notes += (*skipped_sentence(study),)
    errors = study["own_error"].values - study["reference_uncertainty"].fillna(0.0).values
    named = dict(zip(study["quantity"].values.tolist(), errors.tolist(), strict=True))
    mark, others = Mark("this scene", study.attrs["own_seconds"], named), work_precision.peers(study, params["peers"])
    figure = work_precision.make("work_precision", study, f"Error against cost: {title}", (mark,), others)
    return {"nc": study} | files("price", price_list(study, f"What accuracy costs: {title}", notes)) | figure
