"""Stages 5 to 8: drawings and judgements of runs: verdict on sections, general figures, comparisons, stability."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from flexclear.post.answers import stability as checked
from flexclear.post.overview import comparison as compared_runs
from flexclear.post.overview import figures
from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import Progress


def verdict(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Classify the motion (schema VERDICT) and draw its figure; the input is ``sections``, `params` names its scene."""
    from flexclear.post.sections import verdict_page
    from flexclear.post.sections.verdict import derive

    sections = inputs["sections"].assign_attrs(scene=params["scene"])
    judged = derive(sections)
    return {"nc": judged, **verdict_page.make(sections, judged)}


def overview(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Draw the general figures (PNG and SVG by file name) of ``run`` and ``post``; params: `watched` quantities."""
    progress(None, "figures")
    return dict(figures.make(inputs["run"], [Quantity.from_json(data) for data in params["watched"]], inputs["post"]))


def comparison(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``compare.nc``, its tables and its figures.

    params: `labels` of the runs, the reference first; `quantities` (owner, kind). inputs: ``run<k>``, and optionally
    ``tight<k>``.
    """
    runs = {label: inputs[f"run{k}"] for k, label in enumerate(params["labels"])}
    tighter = {label: inputs[f"tight{k}"] for k, label in enumerate(params["labels"]) if f"tight{k}" in inputs}
    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    progress(None, "comparing")
    compared = compared_runs.assemble(runs, tighter, chosen)
    result: dict[str, Any] = {"nc": compared}
    result |= files("differences", compared_runs.table(compared)) | files("costs", compared_runs.costs(compared))
    progress(None, "figures")
    return result | compared_runs.make("compare", runs, chosen)


def stability(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``stability.nc`` (value, limit, verdict, remedy over `check`; attribute `answer`) and its figure.

    params: `by_need`, True when the program chose the integrator. inputs: ``run``, and where they exist ``study`` and,
    for a scene with an ensemble, ``post``.
    """
    members = float(inputs["post"]["ensemble_horizon"]) if "post" in inputs else None
    result = checked.checks(inputs["run"], inputs.get("study"), members, by_need=params["by_need"])
    columns = {name: ("check", [str(getattr(c, name)) for c in result]) for name in ("value", "limit", "verdict")}
    columns["remedy"] = ("check", [c.advice for c in result])
    attributes = {"Conventions": "CF-1.11", "answer": checked.answer(inputs["run"], result, members)}
    data = xr.Dataset(columns, {"check": [c.name for c in result]}, attributes)
    return {"nc": data} | checked.figure(inputs["run"])
