"""Engines of edited scenes, built from the engine of another edit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.effects import scheme_of
from flexclear.dynamics.model.refill import refill_model
from flexclear.dynamics.run.evaluation.engine import Engine, assemble
from flexclear.dynamics.run.run import engine_of, engines
from flexclear.scene.drives import PathDrive
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent


def engines_alike(
    known: Engine | None, scene: Scene, bundles: Mapping[str, Labelled]
) -> tuple[Engine, Callable[[str], Engine]]:
    """Return the same as `engines`, to the last bit, at less cost when `known` is the engine of another edit.

    Compiled functions and checks of the known engine serve the new one.  known: engine with the same bundles; it is not
    changed.  Raises as `engines` does.
    """
    model = None if known is None or not _may_serve(known, scene) else refill_model(known.model, scene)
    if known is None or model is None:
        return engines(scene, bundles, silent)
    other = cache(lambda name: engine_of(edited(scene, {"solver.integrator": name}), bundles, silent))
    return assemble(model, known.entry, known.method, known.mobility), other


def _may_serve(known: Engine, scene: Scene) -> bool:
    """Return True when the scene uses the same compiled functions, needs no preceding run, and starts ordinarily."""
    old = known.model.scene
    paths = any(isinstance(drive, PathDrive) for drive in [*old.drive.values(), *scene.drive.values()])
    return not paths and scheme_of(scene.solver) == scheme_of(old.solver) and not known.mobility.singular_start
