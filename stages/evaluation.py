"""Stages 5 to 8: what is drawn and judged of runs: a verdict on sections, general figures, comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

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
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.overview import figures

    progress(None, "figures")
    return dict(figures.make(inputs["run"], [Quantity.read(data) for data in params["watched"]], inputs["post"]))


def comparison(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``compare.nc``, its tables and its figures.

    params: `labels` of the runs, the reference first; `quantities` (owner, kind).  inputs: ``run<k>``, and ``tight<k>``
    where there is one.
    """
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.overview import comparison
    from flexclear.pipeline.post.overview import comparison as compared_runs
    from flexclear.pipeline.post.plotting.table import files

    runs = {label: inputs[f"run{k}"] for k, label in enumerate(params["labels"])}
    tighter = {label: inputs[f"tight{k}"] for k, label in enumerate(params["labels"]) if f"tight{k}" in inputs}
    chosen = [Quantity.read(data) for data in params["quantities"]]
    progress(None, "comparing")
    compared = compared_runs.assemble(runs, tighter, chosen)
    result: dict[str, Any] = {"nc": compared}
    result |= files("differences", compared_runs.table(compared)) | files("costs", compared_runs.costs(compared))
    progress(None, "figures")
    return result | comparison.make("compare", runs, chosen)
