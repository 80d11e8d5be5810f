"""Next to stage 4: a variant of a scene -> its watched quantities, over ensemble members where it has contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from flexclear.scene.load import edited
from flexclear.scene.quantity import Quantity
from flexclear.stages import kernels, simulation
from flexclear.stages.graph import Graph
from flexclear.system.errors import InputError, SolverError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: settings of a scene that a watched run ignores
UNSEEN = ("accuracy", "ensemble", "sections", "view")
#: members that one task runs end at these numbers: a study that needs more makes only those that are missing
BATCHES = (4, 8, 16, 32, 64)


def plain(scene: Scene) -> Scene:
    """Return the scene without the settings that request more than one run."""
    return edited(scene, dict.fromkeys(UNSEEN)) if any(getattr(scene, key) for key in UNSEEN) else scene


def tasks(scene: Scene, chosen: Sequence[Quantity], members: int) -> list[Task]:
    """Return the tasks of a variant, one per batch of members; `effect_size.point_of_members` reads their artifacts."""
    variant = plain(scene)
    graph, count = Graph(variant, shown=False), _members(variant, members)
    ends = [*(end for end in BATCHES if end < count), count]
    return [
        Task(
            stage="quantities",
            scene=scene.name,
            part=f"members {first + 1} to {end}" if first else "",
            run="flexclear.stages.watched_quantities:run",
            params={
                "simulate": simulation.params(variant),
                "quantities": [q.to_json() for q in chosen],
                "members": [first, end],
            },
            inputs=graph.bodies(),
            code=("flexclear.stages.kernels", *simulation.CODE),
        )
        for first, end in zip([0, *ends], ends, strict=False)
    ]


def _members(scene: Scene, members: int) -> int:
    """Return the number of members: 0 for a scene without contacts and stops, whose motion needs no ensemble."""
    return members if scene.contacts() or scene.stops() else 0


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Return one point as a dataset, refusals of the solver included, since they, too, show an effect.

    Its attributes `compile_seconds` and `cpu_seconds` are the processor time of the kernels and of the runs [s], and
    `members` is the number of runs.
    """
    from flexclear.artifacts.effect_size import compared_values
    from flexclear.artifacts.points import dataset_of_batch

    scene = simulation.rebuild(params["simulate"], inputs)
    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    progress(None, f"{scene.summary()}")
    reduced, begun = simulation.bundles(inputs), kernels.processor_time()
    with suppress(SolverError, InputError):  # which the point reports
        kernels.warm(scene, reduced, progress)
    compiled = kernels.processor_time()
    first, end = params["members"]
    point = watch(scene, reduced, chosen, end - first, first)
    spent = {
        "members": max(end - first, 1),
        "compile_seconds": compiled - begun,
        "cpu_seconds": kernels.processor_time() - compiled,
    }
    return {"nc": dataset_of_batch({"point": point}, compared_values(scene.owners(), chosen)).assign_attrs(spent)}


def watch(
    scene: Scene, bundles: Mapping[str, xr.Dataset], chosen: Sequence[Quantity], members: int, first: int = 0
) -> Point:
    """Run a scene in this process and return the point of its members from number `first` on; without contacts they are
    ignored."""
    from flexclear.artifacts.effect_size import compared_values
    from flexclear.dynamics.record.point import Runner

    return Runner(bundles, compared_values(scene.owners(), chosen), _members(scene, members), first=first).run(scene)
