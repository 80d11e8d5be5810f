"""``flexclear run``, and what all commands and the Python functions have in common: bringing scenes up to date."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.artifacts.paths import results_root
from pipeline.core.artifacts.store import Store, disk_limits, write_dataset
from pipeline.core.errors import FlexclearError, InputError, InputErrors, SolverError
from pipeline.core.scene.load import load_scene
from pipeline.core.workflow.fingerprint import TREE, Sources
from pipeline.core.workflow.progress import WARNING, Monitor
from pipeline.core.workflow.schedule import Failure, Outcome, bring
from pipeline.core.workflow.task import Task
from stages.graph import STAGES, Graph

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="a scene file, or a name below scenes/")
    parser.add_argument(
        "--to", choices=STAGES, default="post", metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.nc", help="copy the dataset of the run here (one scene)")


def command(options: argparse.Namespace) -> None:
    """Bring scenes up to date; say what their bundles lack where those were asked for."""
    if options.out is not None and len(options.scenes) > 1:
        raise InputError("--out", f"takes one scene, not {len(options.scenes)}", "run the scenes one by one")
    if options.out is not None:
        check_target(options.out)
    wanted = graphs(options.scenes)
    place = workplace()
    outcome = place.bring([task for graph in wanted for task in graph.up_to(options.to)])
    check(outcome)
    if options.to == "bundle":
        print("\n\n".join(filter(None, (deficits(graph, place, outcome) for graph in wanted))))
    if options.out is not None:
        copy_run(wanted[0], place, options.out)
    conclude(wanted, place, outcome)


@dataclass(frozen=True)
class Workplace:
    """Where artifacts are kept, where the source lies, and who is told about progress."""

    store: Store
    sources: Sources
    monitor: Monitor = field(default_factory=Monitor)

    def bring(self, tasks: list[Task], jobs: int | None = None) -> Outcome:
        """Bring tasks up to date over the cores there are."""
        return bring(tasks, self.store, self.sources, self.monitor, jobs)


class FailedTasksError(FlexclearError):
    """Some tasks failed; each is told, and the first decides the exit code."""

    def __init__(self, failures: tuple[Failure, ...]) -> None:
        super().__init__("\n".join(failure.message for failure in failures))
        self.exit_code = failures[0].exit_code


class MissedAccuracyError(SolverError):
    """Runs are not as accurate as their scenes ask; what there is is kept, and says so."""


def workplace() -> Workplace:
    """The usual one: results beside the project's sources, or where FLEXCLEAR_RESULTS says."""
    monitor = Monitor()
    root = results_root()
    return Workplace(Store(root, say=monitor.say), Sources(TREE, root / "cache" / "imports.json"), monitor)


def find_scene(name: str) -> Path:
    """The file of a scene given by path or by name (``sps4/csj``). InputError names what is near."""
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        return path
    named = TREE / "scenes" / f"{name}.toml"
    if named.is_file():
        return named
    raise InputError(name, "is neither a scene file nor the name of one below scenes/", _known(name))


def _known(name: str) -> str:
    from pipeline.core.registry import suggestion

    scenes = TREE / "scenes"
    return suggestion(name, sorted(p.relative_to(scenes).with_suffix("").as_posix() for p in scenes.rglob("*.toml")))


def run(scene: Scene, place: Workplace | None = None) -> xr.Dataset:
    """Dataset of the simulate stage, brought up to date; titled as the scene is.

    An edited scene (`override`) is cached like any other but does not take the place of its file's
    results under results/runs.  Raises FlexclearError.
    """
    place = place or workplace()
    import_module("pipeline.core.artifacts.modal")  # gives the dataset its accessor
    task = Graph(scene, shown=as_in_its_file(scene)).simulate
    # in this process: workers would run a caller's script again from its top
    outcome = place.bring([task], jobs=1)
    check(outcome)
    return place.store.load(outcome.records[id(task)]).assign_attrs(title=scene.title)


def bundles(scene: Scene, place: Workplace | None = None, jobs: int | None = 1) -> dict[str, xr.Dataset]:
    """The reduced flexible bodies of a scene by name, brought up to date.

    jobs: as of `Workplace.bring`; one is this process, since workers would run a caller's script again from its top.
    Raises FlexclearError.
    """
    place, graph = place or workplace(), Graph(scene, shown=False)
    outcome = place.bring(list(graph.bundle.values()), jobs)
    check(outcome)
    return _loaded(graph, place, outcome)


def _loaded(graph: Graph, place: Workplace, outcome: Outcome) -> dict[str, xr.Dataset]:
    return {body: place.store.load(outcome.records[id(task)]) for body, task in graph.bundle.items()}


def deficits(graph: Graph, place: Workplace, outcome: Outcome) -> str:
    """What the scene's bundles lack, one table for each flexible body."""
    from pipeline.core.artifacts.deficits import table

    found = _loaded(graph, place, outcome)
    return "\n\n".join(f"{graph.scene.name}, {body}\n{table(data)}" for body, data in found.items())


def linear(
    scene: Scene,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    *,
    moving: bool = False,
    vibrations: bool = True,
    place: Workplace | None = None,
) -> xr.Dataset:
    """Equilibrium of a scene in one pose, and the natural vibrations about it; brought up to date as `run` is."""
    if time is not None and not scene.time.start <= time <= scene.time.end:
        raise InputError(
            "time", f"{time:.6g} s is outside of the scene's {scene.time.start:.6g} to {scene.time.end:.6g} s"
        )
    place = place or workplace()
    graph = Graph(scene, shown=as_in_its_file(scene))
    task = graph.linear(time, drives, moving=moving, vibrations=vibrations)
    outcome = place.bring([task], jobs=1)
    check(outcome)
    return place.store.load(outcome.records[id(task)]).assign_attrs(title=scene.title)


def check(outcome: Outcome) -> None:
    """Raise FailedTasksError when something failed."""
    if outcome.failures:
        raise FailedTasksError(outcome.failures)


def conclude(graphs: Sequence[Graph], place: Workplace, outcome: Outcome) -> None:
    """Tell what the scenes' runs are to be doubted for, as the last thing that a command says.

    Raises MissedAccuracyError, after that, for runs that are not as accurate as their scene asks.
    """
    missed = []
    for graph in graphs:
        record = outcome.records.get(id(graph.simulate))
        if record is None:
            continue
        for sentence in filter(None, record.said.get("warnings", "").split("\n")):
            place.monitor.say(f"{graph.scene.name}: {WARNING}{sentence}")
        verdict, wanted = record.said.get("accuracy_verdict", "met"), graph.scene.accuracy
        if verdict != "met" and wanted is not None:
            text = f"{graph.scene.name} [accuracy]: missed: {verdict}; the run is kept"
            if wanted.allow_missed:
                place.monitor.say(text)
            else:
                missed.append(f"{text}\n  hint: ask for less, or write allow_missed = true in [accuracy]")
    if missed:
        raise MissedAccuracyError("\n".join(missed))


def as_in_its_file(scene: Scene) -> bool:
    """Whether a scene is what its file says, so that its results take their place below results/runs."""
    return scene.path is not None and load_scene(scene.path) == scene


def graphs(names: list[str]) -> list[Graph]:
    """Graphs of the scenes, each once; the mistakes of all scenes are told together."""
    found: dict[str, Graph] = {}
    wrong: list[InputError] = []
    for name in names:
        try:
            graph = Graph(load_scene(find_scene(name)))
            graph.up_to("post")
            found[graph.scene.name] = graph
        except InputErrors as errors:
            wrong.extend(errors.errors)
        except InputError as error:
            wrong.append(error)
    if wrong:
        raise wrong[0] if len(wrong) == 1 else InputErrors(wrong)
    return list(found.values())


def copy_run(graph: Graph, place: Workplace, target: Path) -> None:
    """Write the dataset of the run to a file of the user's, titled, and atomically like any other."""
    dataset = run(graph.scene, place)
    with disk_limits(target.parent):
        write_dataset(target, dataset)


def check_target(target: Path, option: str = "--out") -> None:
    """InputError when a file cannot be put there; asked before the work, not after it."""
    if not target.parent.is_dir():
        raise InputError(f"{option} {target}", "its folder does not exist", f"mkdir -p {target.parent}")
    if target.is_dir():
        raise InputError(f"{option} {target}", "is a folder", "name a file in it")
