"""Stage 3: mesh and modes -> the reduced modal bundle, which contains all that the dynamics needs of the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.scene.registry import lookup
from flexclear.structure.kinds import STRESSED

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

WHERE = "[output] stress"


def params(scene: Scene, body: str) -> dict[str, Any]:
    """Return whether and where stresses, and whether stiffening, are requested; else no entry."""
    requested: dict[str, Any] = {"stress": True} if body in (scene.output.stress or ()) else {}
    if gauges := scene.output.on(body):
        requested["gauges"] = {name: gauge.model_dump(mode="json", exclude_none=True) for name, gauge in gauges.items()}
    return requested | ({"stiffening": True} if scene.flexible()[body].stiffening is not None else {})


def check(scene: Scene, body: str, kind: str) -> None:
    """Raise InputError where stresses are requested of a kind of body that has none."""
    if "stress" in params(scene, body):
        lookup(STRESSED, kind, kind="stress recovery", where=WHERE)


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Reduce the body to a bundle (schema BUNDLE)."""
    from flexclear.structure.modes import bundle

    progress(None, "inertia integrals")
    mesh, modes = inputs["mesh"], inputs["modes"]
    extra: dict[str, Any] = {}
    if params.get("stress"):
        from flexclear.structure.stress import RECOVERIES

        extra |= RECOVERIES[str(mesh.attrs.get("body_kind", "beam"))](mesh, modes, params.get("gauges", {}))
    return {"nc": bundle.build(mesh, modes, extra, stiffening=params.get("stiffening", False))}
