"""Stage 4: scene and bundles -> one run, or an ensemble of runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.progress import Progress
    from pipeline.core.scene.schema import Scene


def params(scene: Scene, *, ensemble: bool = False, sections: bool = False) -> dict[str, Any]:
    """What the engine sees of a scene. Titles and the place of files on disk are not part of it,
    nor are the ensemble and the sections of a single run, nor in an ensemble the accuracy of a single run, nor
    whether that may be missed."""
    left_out: dict[str, Any] = dict.fromkeys(("title", "description", "accuracy" if ensemble else "ensemble"), True)
    if not ensemble:
        left_out["accuracy"] = {"allow_missed"}
    if not sections:
        left_out["sections"] = True
    table = scene.model_dump(mode="json", exclude=left_out, exclude_none=True)
    for body in scene.flexible():
        table["body"][body]["mesh"] = Path(table["body"][body]["mesh"]).name
    return {"name": scene.name, "scene": table}


def modules(scene: Scene) -> tuple[str, ...]:
    """Modules that a run reaches by its parts' names, so that editing a law leaves scenes without it alone.

    Raises InputError when a name is not listed in its family.
    """
    from pipeline.dynamics.compile import sources

    return sources.modules(scene)


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """One run (schema RUN); inputs are ``bundle/<body>``.  What the bundles lack where it matters is told, and kept."""
    from pipeline import dynamics

    scene, reduced = rebuild(params), bundles(inputs)
    lacks = missing_compliance(scene, reduced)
    for text in lacks:
        progress(None, text)
    found = dynamics.simulate(scene, reduced, progress)
    told = "\n".join(filter(None, [str(found.attrs.get("warnings", "")), *lacks]))
    return {"nc": found.assign_attrs(warnings=told) if told else found}


def missing_compliance(scene: Scene, reduced: Mapping[str, xr.Dataset]) -> list[str]:
    """Sentences about flexible bodies whose modes lack static compliance between the frames that joints use."""
    from pipeline.core.artifacts import deficits

    found = []
    for body, bundle in reduced.items():
        ends = (end.partition(".") for joint in scene.joint.values() for end in joint.between)
        used = [frame for owner, _, frame in ends if owner == body]
        if used and "compliance_share" in bundle:
            found += deficits.warnings(bundle, used, body)
    return found


def run_ensemble(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """All members (schema ENSEMBLE); inputs are ``bundle/<body>``."""
    from pipeline import dynamics

    return {"nc": dynamics.ensemble(rebuild(params), bundles(inputs), progress)}


def bundles(inputs: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """The inputs called ``bundle/<body>``, by body."""
    return {name.removeprefix("bundle/"): data for name, data in inputs.items() if name.startswith("bundle/")}


def rebuild(params: Mapping[str, Any]) -> Scene:
    """The scene again, from what `params` kept of it; its title is its name."""
    from pipeline.core.scene.schema import Scene

    scene = Scene.model_validate({**params["scene"], "title": params["name"]})
    scene._name = params["name"]
    return scene
