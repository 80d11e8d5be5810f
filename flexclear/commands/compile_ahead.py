"""Kernels compiled before they are needed, for scenes that a user names: in an image, on a cluster, before a lesson.

Nothing is compiled behind a user's back: a process that stays after its command would take a laptop's battery, be
billed or killed by a scheduler, and write into a folder that a container is about to throw away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from flexclear.commands import new
from flexclear.commands.scenes import Workplace, check, graphs
from flexclear.pipeline.core.artifacts.store import Store
from flexclear.stages import simulation

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress
    from flexclear.stages.graph import Graph

#: templates that represent the kinds of parts that most mechanisms have
USUAL = ("pendulum", "four-bar", "slider-crank", "leg")


def compiled(names: list[str], workplace: Workplace) -> list[str]:
    """Compile, or fetch, what runs of scenes call; the usual ones' without names.  What each scene is called.

    Code for one wiring is left to the runs that are long enough for it.
    """
    if names:
        return _all(graphs(names), workplace)
    with TemporaryDirectory() as folder:
        temporary = Workplace(
            Store(Path(folder) / "results"), workplace.sources, workplace.monitor, workplace.jobs, workplace.end
        )
        return _all(graphs([str(new.write(kind, Path(folder) / kind)[0]) for kind in USUAL]), temporary)


def _all(requested: Sequence[Graph], workplace: Workplace) -> list[str]:
    outcome = workplace.bring([task for graph in requested for task in graph.bodies().values()])
    check(outcome)
    workplace.monitor.start(len(requested))
    for graph in requested:
        known = {name: workplace.store.load(outcome.records[id(task)]) for name, task in graph.bodies().items()}
        name = workplace.monitor.begin(graph.scene.name, "kernels")
        _compile(
            simulation.rebuild(graph.simulate.params, known),
            simulation.bundles(known),
            partial(workplace.monitor.update, name),
        )
        workplace.monitor.finish(name, failed=False)
    workplace.monitor.end()
    return [graph.scene.name for graph in requested]


def _compile(scene: Scene, reduced: Mapping[str, xr.Dataset], progress: Progress) -> None:
    """What a scene's methods call, and those that may take over."""
    from flexclear.pipeline.dynamics.compile import functions
    from flexclear.pipeline.dynamics.effects import schemes
    from flexclear.pipeline.dynamics.run.run import engine_of

    model = engine_of(scene, reduced, progress).model
    for scheme in schemes(scene):
        functions.entry(model.parts, scheme, lambda text: progress(None, text)).complete()
