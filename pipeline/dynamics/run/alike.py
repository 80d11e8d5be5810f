"""Engines of other edits of a scene, from one that is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

from flexclear.pipeline.core.artifacts.labelled import Labelled
from flexclear.pipeline.core.scene.drives import PathDrive
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.effects import scheme_of
from flexclear.pipeline.dynamics.model.refill import refilled
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine, assemble
from flexclear.pipeline.dynamics.run.run import engine_of, engines


def engines_alike(
    known: Engine | None, scene: Scene, bundles: Mapping[str, Labelled]
) -> tuple[Engine, Callable[[str], Engine]]:
    """What `engines` gives, to the last bit, at less cost where an engine of another edit of the scene is `known`.

    What has been compiled and judged for that serves this.  known: with the same bundles; it is not changed.  Errors as
    of `engines`.
    """
    model = None if known is None or not _may_serve(known, scene) else refilled(known.model, scene)
    if known is None or model is None:
        return engines(scene, bundles, silent)
    other = cache(lambda name: engine_of(edited(scene, {"solver.integrator": name}), bundles, silent))
    return assemble(model, known.entry, known.method, known.mobility), other


def _may_serve(known: Engine, scene: Scene) -> bool:
    """Whether the scene runs on the same kernels, no other run finds its motion, and its start is no special one."""
    old = known.model.scene
    paths = any(isinstance(drive, PathDrive) for drive in [*old.drive.values(), *scene.drive.values()])
    return not paths and scheme_of(scene.solver) == scheme_of(old.solver) and not known.mobility.singular_start
