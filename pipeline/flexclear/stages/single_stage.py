"""One stage of a scene alone, on the files that the stages before it have written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.stages.graph import STAGES, Graph
from flexclear.stages.workplace import Made, Workplace, relative
from flexclear.system.errors import InputError
from flexclear.workflow.execute import states
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Step:
    """One artifact of a stage: the files that were read and written, and the dataset among the latter.

    body: whose artifact it is; empty for the whole scene.
    """

    body: str
    reads: Sequence[Path]
    writes: Sequence[Path]
    result: xr.Dataset

    def __str__(self) -> str:
        """Return a line for each file, and one with the sizes of the result."""
        lines = [f"reads  {relative(path)}" for path in self.reads]
        lines += [f"writes {relative(path)}" for path in self.writes]
        sizes = ", ".join(f"{name} {size}" for name, size in self.result.sizes.items())
        return "\n".join([*lines, f"       {sizes}"])


def single_stage(graph: Graph, stage: str, workplace: Workplace) -> list[Step]:
    """Run one stage of a scene, for each body where the stage has bodies, unless its files are up to date.

    The stages before it are not run. Raises InputError where their files are missing or out of date, FlexclearError.
    """
    tasks, root = graph.of(stage), workplace.store.root
    above = [one for task in tasks.values() for one in task.inputs.values()]
    for state in states(above, workplace.store, workplace.sources):
        if state.record is None and state.task.stage in STAGES:
            where, path = relative(_shown_path(root, state.task)), graph.scene.path
            why = f"is missing or out of date: {state.why[0]}"
            raise InputError(
                where, why, f"make {state.task.stage} SCENE={relative(path) if path else graph.scene.name}"
            )
    return [_step(graph, one) for one in workplace.made(*tasks.values(), jobs=1)]


def _step(graph: Graph, made: Made) -> Step:
    task, scene = made.task, graph.scene
    source = scene.recipes()[task.part] if task.stage == "mesh" else scene.path
    reads = [] if source is None else [Path(source)]
    reads += [*task.files.values(), *(_shown_path(made.store.root, one) for one in task.inputs.values() if one.folder)]
    return Step(
        task.part, reads, [made.folder / task.names.get(name, name) for name in made.record.files], made.dataset()
    )


def _shown_path(root: Path, task: Task) -> Path:
    """Return where the dataset of a task is shown."""
    return root / task.folder / task.names["nc"]
