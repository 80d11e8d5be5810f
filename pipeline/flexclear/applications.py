"""What programs on top of this one use besides the public functions: tasks of their own, stored as stages are.

A task names a function, its parameters and the artifacts of scenes that the function reads; `Workplace.bring` runs the
tasks that are out of date. `flexclear.publishing` has tables, figures and pages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from flexclear.artifacts.store import Record
from flexclear.dynamics import simulate
from flexclear.dynamics.analyses import cost
from flexclear.scene.schema import Scene
from flexclear.stages import kernels, simulation
from flexclear.stages.derived_series import origins
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace, add_options, check, open_workplace
from flexclear.system.progress import Progress, silent
from flexclear.workflow.schedule import Outcome
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.record.cost import Cost

#: code that decides results of functions that use `flexclear.publishing`, for `Task.code`
PUBLISHING = ("flexclear.publishing", "flexclear.post")


def task_over(graphs: Iterable[Graph], run: str, variants: Callable[[Scene], Iterable[Scene]], **more: Any) -> Task:
    """Return a task whose function runs scenes itself; `scenes_of` gives it the scenes and their flexible bodies.

    run: ``"module:function"``.  variants: the scenes that it runs for one of these; their kernels are compiled ahead,
    while other tasks run.  more: further arguments of `Task`.
    """
    listed, compiled = list(graphs), dict[tuple[str, ...], Task]()
    for graph in listed:
        for variant in variants(graph.scene):
            compiled.setdefault(kernels.kernel_identity(variant), kernels.task(variant, graph.bodies()))
    return Task(
        run=run,
        params={graph.scene.name: simulation.params(graph.scene) for graph in listed},
        inputs={f"{one.scene.name}:{name}": task for one in listed for name, task in one.bodies().items()}
        | {f"kernels/{k}": task for k, task in enumerate(compiled.values())},
        code=("flexclear.stages.kernels", *simulation.CODE),
        **more,
    )


def scenes_of(
    params: Mapping[str, Any], inputs: Mapping[str, Labelled]
) -> Iterator[tuple[str, Scene, dict[str, Labelled]]]:
    """Yield name, scene and flexible bodies of each scene of a task that `task_over` returned."""
    for name, table in params.items():
        mine = {key.removeprefix(f"{name}:"): data for key, data in inputs.items() if key.startswith(f"{name}:")}
        yield name, simulation.rebuild(table, mine), simulation.bundles(mine)
