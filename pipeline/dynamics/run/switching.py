"""An integration that changes its method on the way: an implicit one takes over where an explicit one would crawl."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.core.integrators import INTEGRATORS
from pipeline.core.scene.load import edited
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.run.engine import Engine, Progress
from pipeline.dynamics.run.handover import StiffError
from pipeline.dynamics.run.trajectory import Trajectory, integrate


def implicit(scene: Scene) -> Scene:
    """The scene with the integrator that takes over."""
    return edited(scene, {"solver.integrator": INTEGRATORS[scene.solver.integrator].hands_over_to})


def follow(
    engine: Engine, y: np.ndarray, progress: Progress, other: Callable[[], Engine]
) -> tuple[Engine, Trajectory, str]:
    """The trajectory from a consistent start y, the engine that came to its end, and why it is another; else nothing.

    other: gives the engine of `implicit`, asked only when it is needed.
    """
    try:
        return engine, integrate(engine, y, progress), ""
    except StiffError as stiff:
        progress(None, f"{stiff}; going on with {engine.method.traits.hands_over_to}")
        second = other()
        return second, integrate(second, y, progress, left=stiff.handover), str(stiff)
