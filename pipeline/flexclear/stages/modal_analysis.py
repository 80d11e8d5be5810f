"""Stage 2: mesh -> frequencies and mass-normalised shapes under one reference condition."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.scene.registry import lookup

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.parts import FlexibleBody
    from flexclear.system.progress import Progress


def params(body: FlexibleBody) -> dict[str, Any]:
    """Return the selected modal coordinates; nothing else of the body decides its modes."""
    return body.modes.model_dump(mode="json", exclude={"source"}, exclude_none=True)


def check(params: Mapping[str, Any]) -> None:
    """Raise InputError for the name of an unknown reference condition."""
    from flexclear.structure.modes.reference import CONDITIONS

    for key in ("reference", "of"):
        if params.get(key):
            lookup(CONDITIONS, params[key], kind="reference condition", where=f"modes.{key}")


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Compute the modes (schema MODES) as ``nc``, and their shapes for ParaView as ``vtu``."""
    from flexclear.structure.fe.vtu import of_modes
    from flexclear.structure.modes.basis import ModeRequest
    from flexclear.structure.modes.solution import solve

    count = params.get("count")
    result = solve(
        inputs["mesh"],
        params["reference"],
        interfaces=params.get("interfaces"),
        requested=ModeRequest(
            count=None if count == "all" else count,
            up_to=params.get("up_to"),
            compliance=params.get("compliance"),
            mass=params.get("mass"),
        ),
        held=params.get("held", ()),
        of=params.get("of"),
        progress=progress,
    )
    return {"nc": result, "vtu": of_modes(result)}
