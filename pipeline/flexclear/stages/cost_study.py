"""All points of a cost study -> dataset, price list, work-precision figure, and the causes of the error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from flexclear.post.cost import answer, causes, statistics, work_precision
from flexclear.post.cost.causes import causes_of
from flexclear.post.cost.study import Point, assemble, comparable_until, cost, relative_errors, with_reference
from flexclear.post.cost.work_precision import Mark
from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import Progress

#: contact events are located to this fraction of the clearance (flexclear.dynamics.integrate.contact_events)
LOCATED = 1e-12


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``cost.nc`` and its tables and figures.

    params: `points` (key, group, factors, name of the input), `quantities` (owner, kind), `title`, the scene's `own`
    setting (own_integrator, own_rtol or own_step), in words what the budget left `undone`, whether the study is
    `complete`, and `peers`, as in `flexclear.study.cost.read_peers`. The reference is the tightest run among the
    points; a run by another method confirms it.
    """
    points = [Point(p["key"], p["group"], p["factors"]) for p in params["points"]]
    runs = {p["key"]: inputs[p["input"]] for p in params["points"]}
    chosen = [Quantity.read(data) for data in params["quantities"]]
    points = with_reference(points, runs, chosen)
    study = assemble(points, runs, chosen)
    study.attrs |= params["own"] | {"undone": params["undone"], "complete": int(params["complete"])}
    asis = next(runs[p.key] for p in points if p.key == "as it is")
    study.attrs |= {"own_seconds": cost(asis, "cpu_seconds"), "own_evaluations": cost(asis, "evaluations")}
    ensembles = {
        name.removeprefix("ensemble:"): data
        for name, data in inputs.items()
        if name.startswith("ensemble:") and "refused" not in data.attrs
    }
    # the last ensemble is the one at the tightest tolerance
    tightest = next(reversed(ensembles.values()), None)
    split = {q.name: causes_of(q, points, runs, LOCATED, tightest) for q in chosen}
    title = params["title"]
    notes = tuple(dict.fromkeys(f"{track['note']}." for track in params["peers"] if track["note"]))
    notes += (*answer.undone(study),)
    study = causes.with_causes(study, split)
    result: dict[str, Any] = {"nc": study}
    result |= files("price", answer.price_list(study, f"What accuracy costs: {title}", notes))
    result |= files("causes", causes.table(split, f"Where the error comes from: {title}"))
    marks = _marks(points, runs, chosen)
    result |= work_precision.make(
        "work_precision", study, f"Error against cost: {title}", marks, work_precision.peers(study, params["peers"])
    )
    if ensembles:
        result |= files("statistics", statistics.table(ensembles, f"Beyond the horizon: {title}"))
    return result


def _marks(points: list[Any], runs: Mapping[str, xr.Dataset], chosen: list[Any]) -> tuple[Any, ...]:
    """Return the scene as it is and the paper's choice of method and step as marked points of the figure."""
    reference, marks = runs[next(p.key for p in points if p.group == "reference")], []
    for name, group in (("this scene", "sampling"), ("paper's choice", "paper")):
        run = next((runs[p.key] for p in points if p.group == group and "refused" not in runs[p.key].attrs), None)
        if run is not None:
            errors = relative_errors(run, reference, chosen, comparable_until(points, runs))
            marks.append(Mark(name, cost(run, "cpu_seconds"), errors))
    return tuple(marks)
