"""Stages 5 to 8: what is drawn and judged of runs: a verdict on sections, general figures, comparisons, stability."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import xarray as xr

from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.post.answers import stability as checked
from flexclear.pipeline.post.overview import comparison as compared_runs
from flexclear.pipeline.post.overview import figures
from flexclear.pipeline.post.plotting.table import files

if TYPE_CHECKING:
    from flexclear.pipeline.core.system.progress import Progress


def verdict(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Verdict (schema VERDICT) and its figure; the input is ``sections``, and `params` names their scene."""
    from flexclear.pipeline.post.sections import verdict_page
    from flexclear.pipeline.post.sections.verdict import derive

    sections = inputs["sections"].assign_attrs(scene=params["scene"])
    judged = derive(sections)
    return {"nc": judged, **verdict_page.make(sections, judged)}


def overview(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """PNG and SVG by file name; inputs are ``run`` and ``post``, and `params` says what is `watched`."""
    progress(None, "figures")
    return dict(figures.make(inputs["run"], [Quantity.read(data) for data in params["watched"]], inputs["post"]))


def comparison(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``compare.nc``, its tables and its figures.

    params: `labels` of the runs, the reference first; `quantities` (owner, kind).  inputs: ``run<k>``, and ``tight<k>``
    where there is one.
    """
    runs = {label: inputs[f"run{k}"] for k, label in enumerate(params["labels"])}
    tighter = {label: inputs[f"tight{k}"] for k, label in enumerate(params["labels"]) if f"tight{k}" in inputs}
    chosen = [Quantity.read(data) for data in params["quantities"]]
    progress(None, "comparing")
    compared = compared_runs.assemble(runs, tighter, chosen)
    result: dict[str, Any] = {"nc": compared}
    result |= files("differences", compared_runs.table(compared)) | files("costs", compared_runs.costs(compared))
    progress(None, "figures")
    return result | compared_runs.make("compare", runs, chosen)


def stability(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``stability.nc`` (value, limit, verdict, remedy over `check`; the answer as an attribute) and a figure.

    params: `by_need`, whether the program chose the integrator.
    inputs: ``run``, ``study`` where there is one, and ``post`` where the scene has an ensemble.
    """
    members = float(inputs["post"]["ensemble_horizon"]) if "post" in inputs else None
    result = checked.checks(inputs["run"], inputs.get("study"), members, by_need=params["by_need"])
    columns = {name: ("check", [str(getattr(c, name)) for c in result]) for name in ("value", "limit", "verdict")}
    columns["remedy"] = ("check", [c.advice for c in result])
    attributes = {"Conventions": "CF-1.11", "answer": checked.answer(inputs["run"], result, members)}
    data = xr.Dataset(columns, {"check": [c.name for c in result]}, attributes)
    return {"nc": data} | checked.figure(inputs["run"])
