"""Next to stage 4: a variant of a scene -> its quantities, of one measured run or over ensemble members.

The cost of a measured run is that of its integration: the record has the same number of rows at every tolerance and
step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity, parse
from flexclear.stages import kernels, simulation
from flexclear.stages.graph import Graph
from flexclear.system.errors import InputError, SolverError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: settings of a scene that runs of members ignore
UNSEEN = ("accuracy", "ensemble", "sections", "view")
#: members that one task runs end at these numbers: a study that needs more makes only those that are missing
BATCHES = (4, 8, 16, 32, 64)


def plain(scene: Scene) -> Scene:
    """Return the scene without the settings that request more than one run."""
    return edited(scene, dict.fromkeys(UNSEEN)) if any(getattr(scene, key) for key in UNSEEN) else scene


def member_tasks(scene: Scene, chosen: Sequence[Quantity], members: int) -> list[Task]:
    """Return the tasks of a variant, one per batch of members; `effect_size.point_of_members` reads their artifacts."""
    variant = plain(scene)
    count, bodies = _count_members(variant, members), Graph(variant, shown=False).bodies()
    ends = [*(end for end in BATCHES if end < count), count]
    written = [q.to_json() for q in chosen]
    return [
        _task("members", variant, f"members {first + 1} to {end}" if first else "", written, bodies, [first, end])
        for first, end in zip([0, *ends], ends, strict=False)
    ]


def measuring_task(scene: Scene, key: str, names: Sequence[str], run: Task | None = None) -> Task:
    """Return the task that measures the run of a scene alone, and keeps these quantities.

    key: the name of the run.  run: the task of the scene's own run, where this is the same one.
    """
    bodies = Graph(scene, shown=False).bodies()
    return _task("measure", scene, key, list(names), bodies | ({} if run is None else {"run": run}))


def _task(
    function: str, scene: Scene, part: str, chosen: list[Any], inputs: Mapping[str, Task], members: Sequence[int] = ()
) -> Task:
    return Task(
        stage="cost-point" if function == "measure" else "quantities",
        scene=scene.name,
        part=part,
        run=f"flexclear.stages.variant_runs:{function}",
        params={"simulate": simulation.params(scene), "quantities": chosen}
        | ({"members": list(members)} if members else {}),
        inputs=inputs,
        code=("flexclear.stages.kernels", *simulation.CODE),
        exclusive=function == "measure",
    )


def _count_members(scene: Scene, members: int) -> int:
    """Return the number of members: 0 for a scene without contacts and stops, whose motion needs no ensemble."""
    return members if scene.contacts() or scene.stops() else 0


def members(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Return one point as a dataset, refusals of the solver included, since they, too, show an effect.

    Its attributes `compile_seconds` and `cpu_seconds` are the processor time of the kernels and of the runs [s], and
    `members` is the number of runs.
    """
    from flexclear.artifacts.effect_size import compared_values
    from flexclear.artifacts.points import dataset_of_batch

    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    scene, reduced, compiling = _with_kernels(params, inputs, progress)
    begun, (first, end) = kernels.processor_time(), params["members"]
    point = watch(scene, reduced, chosen, end - first, first)
    spent = {
        "members": max(end - first, 1),
        "compile_seconds": compiling,
        "cpu_seconds": kernels.processor_time() - begun,
    }
    return {"nc": dataset_of_batch({"point": point}, compared_values(scene.owners(), chosen)).assign_attrs(spent)}


def measure(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Return the recorded quantities, ``cpu_repeat(repeat)`` of the integration, and other costs as attributes, among
    them the median time of the recording.

    params: `simulate`, the parameters of the simulate stage, and names of `quantities`.  inputs: bundles; `run`, the
    same run, where it is known, whose horizon is then kept as well.  With events, whose phases begin anew, all work of
    the run is measured.  Where the solver refuses the run, the dataset is empty and its attribute `refused` holds the
    reason: that, too, is a result of a study.
    """
    import numpy as np
    import xarray as xr

    from flexclear.artifacts import quantities
    from flexclear.dynamics import analyses, simulate
    from flexclear.system.platforms import peak_memory

    scene, reduced, compiling = _with_kernels(params, inputs, progress)
    begun = kernels.processor_time()
    try:
        if scene.event:
            done = simulate(scene, reduced, progress)
            integration, recording = [kernels.processor_time() - begun], [0.0]
        else:
            cost = analyses.cost(scene, reduced, progress)
            done, integration, recording = cost.run, [*cost.integration], [*cost.recording]
    except SolverError as error:
        return {"nc": xr.Dataset(attrs={"refused": str(error), "compile_seconds": compiling})}
    kept = inputs.get("run", done)
    recorded = quantities.select_variables(kept, [parse(name, scene.owners()) for name in params["quantities"]])
    attributes = {"units": "s", "long_name": "processor time of the integration of a warm run"}
    recorded["cpu_repeat"] = (("repeat",), integration, attributes)
    costs = {"evaluations": done.attrs["evaluations"], "peak_memory": peak_memory()}
    costs |= {"recording_seconds": float(np.median(recording)), "compile_seconds": compiling}
    return {"nc": recorded.assign_attrs(costs)}


def _with_kernels(
    params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress
) -> tuple[Scene, dict[str, xr.Dataset], float]:
    """Return scene, bundles and the processor time [s] in which the scene's kernels were compiled or fetched."""
    scene, reduced = simulation.rebuild(params["simulate"], inputs), simulation.bundles(inputs)
    progress(None, f"{scene.summary()}")
    begun = kernels.processor_time()
    with suppress(SolverError, InputError):  # which the run itself reports
        kernels.warm(scene, reduced, progress)
    return scene, reduced, kernels.processor_time() - begun


def watch(
    scene: Scene, bundles: Mapping[str, xr.Dataset], chosen: Sequence[Quantity], members: int, first: int = 0
) -> Point:
    """Run a scene in this process and return the point of its members from number `first` on; without contacts they are
    ignored."""
    from flexclear.artifacts.effect_size import compared_values
    from flexclear.dynamics.record.point import Runner

    return Runner(bundles, compared_values(scene.owners(), chosen), _count_members(scene, members), first=first).run(
        scene
    )
