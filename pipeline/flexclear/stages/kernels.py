"""Kernels compiled ahead, concurrently, for runs that are measured one at a time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.stages import simulation
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.run.evaluation.engine import Engine
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress


def task(scene: Scene, bundles: Mapping[str, Task]) -> Task:
    """Return the task that compiles the kernels of a scene and of all scenes with equal `kernel_identity`.

    bundles: tasks by the names of the simulate stage's inputs.
    """
    return Task(
        stage="kernels",
        scene=scene.name,
        part=f"{scene.solver.integrator}, {'adaptive' if scene.solver.step is None else 'fixed'} steps",
        run="flexclear.stages.kernels:run",
        params={"simulate": simulation.params(scene)},
        inputs=bundles,
        code=simulation.CODE,
    )


def kernel_identity(scene: Scene) -> tuple[str, ...]:
    """Return a tuple that is equal for scenes that run on the same kernels: numbers are not compiled, and code
    specialised for one topology is left to the runs, a second of processor time each."""
    from flexclear.dynamics.effects import most_parts, schemes
    from flexclear.scene.events import with_switched

    whole = with_switched(scene) if scene.event else scene
    return (repr(most_parts(whole)), *map(repr, schemes(whole)))


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Compile the kernels unless they are on disk; the attribute `compile_seconds` is the processor time spent [s].

    params: `simulate`, the parameters of the simulate stage. inputs: bundles.
    """
    import xarray as xr

    begun = processor_time()
    warm(simulation.rebuild(params["simulate"], inputs), simulation.bundles(inputs), progress)
    return {"nc": xr.Dataset(attrs={"compile_seconds": processor_time() - begun})}


def processor_time() -> float:
    """Return the processor time [s] of this process and of its ended child processes, which may compile, too."""
    return sum(os.times()[:4])


def warm(scene: Scene, reduced: Mapping[str, Labelled], progress: Progress) -> Engine:
    """Compile or fetch what a run calls and call it, so that no measurement contains it; return the engine."""
    from flexclear.dynamics.run.evaluation.start import consistent_start
    from flexclear.dynamics.run.run import engine_of

    engine = engine_of(scene, reduced, progress)
    consistent_start(engine)
    engine.settle(progress)  # as short runs step
    engine.specialised.worthwhile = True  # and as long ones do
    engine.settle(progress)
    return engine
