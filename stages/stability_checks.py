"""Stage 8: a run and its cost study -> the checks of its stability, in words, and a figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``stability.nc`` (value, limit, verdict, remedy over `check`; the answer as an attribute) and a figure.

    inputs: ``run``, ``study`` where there is one, and ``post`` where the scene has an ensemble.
    """
    import xarray as xr

    from flexclear.pipeline.post.answers import stability

    members = float(inputs["post"]["ensemble_horizon"]) if "post" in inputs else None
    result = stability.checks(inputs["run"], inputs.get("study"), members)
    columns = {name: ("check", [str(getattr(c, name)) for c in result]) for name in ("value", "limit", "verdict")}
    columns["remedy"] = ("check", [c.advice for c in result])
    attributes = {"Conventions": "CF-1.11", "answer": stability.answer(inputs["run"], result, members)}
    data = xr.Dataset(columns, {"check": [c.name for c in result]}, attributes)
    return {"nc": data} | stability.figure(inputs["run"])
