"""Stage 2: mesh -> frequencies and mass-normalised shapes under one reference condition."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stages.families import module

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.parts import FlexibleBody
    from pipeline.core.workflow.execute import Progress

CONDITIONS = "pipeline.structure.modes.reference"


def params(body: FlexibleBody) -> dict[str, Any]:
    """Which coordinates are kept; nothing else of the body."""
    return body.modes.model_dump(mode="json", exclude={"source"})


def modules(body: FlexibleBody, where: str) -> tuple[str, ...]:
    """Module of the reference condition; InputError when there is none of that name."""
    return (module(CONDITIONS, body.modes.reference, where=where),)


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The modes (schema MODES)."""
    from pipeline.structure import modes

    interfaces = params["interfaces"]
    return {
        "nc": modes.solve(
            inputs["mesh"],
            params["reference"],
            params["count"],
            interfaces=None if interfaces is None else tuple(interfaces),
        )
    }
