"""Stage 8: runs, and the same at tighter tolerances -> one dataset, tables and figures of what they differ by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``compare.nc``, its tables and its figures.

    params: `labels` of the runs, the reference first; `quantities` (owner, kind).  inputs: ``run<k>``, and ``tight<k>``
    where there is one.
    """
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.overview import comparison, overlay
    from flexclear.pipeline.post.plotting.table import files

    runs = {label: inputs[f"run{k}"] for k, label in enumerate(params["labels"])}
    tighter = {label: inputs[f"tight{k}"] for k, label in enumerate(params["labels"]) if f"tight{k}" in inputs}
    chosen = [Quantity.read(data) for data in params["quantities"]]
    progress(None, "comparing")
    compared = comparison.assemble(runs, tighter, chosen)
    result: dict[str, Any] = {"nc": compared}
    result |= files("differences", comparison.table(compared)) | files("costs", comparison.costs(compared))
    progress(None, "figures")
    return result | overlay.make("compare", runs, chosen)
