"""Scenes that a command or a Python function names: read, checked, brought up to date."""

from __future__ import annotations

import argparse
import json
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from flexclear.artifacts import maintenance
from flexclear.artifacts.disk import disk_limits, encode_with_digest, publish, read_checked, sha256
from flexclear.artifacts.paths import DATA, results_root
from flexclear.artifacts.store import PARTIAL, Store
from flexclear.post.pages import media
from flexclear.post.plotting.table import as_html, from_markdown
from flexclear.scene import toml_files
from flexclear.scene.load import is_file, load_scene, scene_name, table_with_changes
from flexclear.scene.plausibility import implausible_values
from flexclear.scene.quantity import KINDS, parse
from flexclear.scene.references import dangling_names
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.segments import body_frames
from flexclear.scene.toml_files import read_toml
from flexclear.scene.units import quantity
from flexclear.stages import export, simulation
from flexclear.stages.derived_series import origins
from flexclear.stages.graph import Graph
from flexclear.stages.meshing import kind_of
from flexclear.stages.notebook import run_head
from flexclear.stages.workplace import Made, Workplace, add_options, open_workplace, relative
from flexclear.system.errors import InputError, ResourceError, SolverError, errors_from, errors_of, refuse
from flexclear.system.external_files import convert_reader_errors, require_file
from flexclear.system.version import DISTRIBUTION
from flexclear.workflow.progress import WARNING
from flexclear.workflow.schedule import Outcome

if TYPE_CHECKING:
    import xarray as xr

#: parts without which the others form a scene as well
ACTING = ("drive", "load", "stop", "gear")
#: folder below a scene's results that is not for users
FACTS = ".facts"


def scene_arguments(parser: argparse.ArgumentParser, *more: str, **changed: Any) -> None:
    """Add the arguments of all commands that bring scenes up to date; more, changed: see `workplace.add_options`."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="a scene file, or a name below scenes/")
    add_options(parser, "usual", *more, **changed)


def print_files(folder: Path, files: Mapping[str, str]) -> None:
    """Print one line that lists the files that exist in a folder, with their descriptions."""
    existing = [f"{name} ({text})" for name, text in files.items() if (folder / name).is_file()]
    if existing:
        print(f"{relative(folder)}: {', '.join(existing)}")


def pictures(made: Made | None, captions: Mapping[str, Sequence[str]]) -> str:
    """Return the existing pictures and films of an artifact as HTML; captions: caption and description by file name."""
    files = made.record.files if made is not None else {}
    return "".join(media(name, made.read(name), *text) for name, text in captions.items() if made and name in files)


def tables(made: Made, *names: str) -> str:
    """Return Markdown tables of an artifact as HTML."""
    return "".join(as_html(from_markdown(made.text(name))) for name in names)


def joint_folder_name(names: Sequence[str]) -> str:
    """Return the name of a folder for results of several scenes."""
    return "+".join(name.replace("/", "_").replace(" ", "_") for name in names)


class MissedAccuracyError(SolverError):
    """Error for runs that are not as accurate as their scenes ask; the runs are stored, with their verdicts."""


def find_scene(name: str) -> Path:
    """Return the file of a scene given by path or by name (``sps4/csj``). InputError suggests similar names."""
    path = Path(name)
    if path.suffix == ".toml" or is_file(path):
        return path
    named = DATA / "scenes" / f"{name}.toml"
    if is_file(named):
        return named
    scenes = DATA / "scenes"
    known = sorted(p.relative_to(scenes).with_suffix("").as_posix() for p in scenes.rglob("*.toml"))
    raise InputError(name, "is neither a scene file nor the name of one below scenes/", suggestion(name, known))


def run(scene: Scene, workplace: Workplace | None = None) -> xr.Dataset:
    """Return the dataset of the simulate stage, brought up to date; titled and named as the scene is.

    An edited scene (`override`) is cached like any other but does not replace its file's results under results/runs.
    Raises FlexclearError.
    """
    examine(scene)
    workplace = workplace or open_workplace()

    task = Graph(scene, shown=as_in_its_file(scene)).simulate
    # in this process: a worker would run a caller's script again from its top
    (made,) = workplace.datasets(task, jobs=1)
    from flexclear.artifacts.recorded import with_dataframe

    return with_dataframe(made.assign_attrs(title=scene.title, scene=scene.name, **origins(scene)), scene, run_head)


def results(scene: Scene | str | Path) -> xr.DataTree:
    """Return the datasets of a scene below results/runs, or the dataset in a file, as a tree; nothing is run.

    InputError without results, or for a file with other contents.
    """
    import xarray as xr

    if str(scene).endswith(".nc"):
        path = Path(str(scene))
        return xr.DataTree.from_dict({path.stem: _dataset(path)}, name=path.absolute().parent.name)
    name = scene if isinstance(scene, str) else scene_name(scene) if isinstance(scene, Path) else scene.name
    name = scene_name(Path(name)) if name.endswith(".toml") else name
    folder = results_root() / "runs" / name
    files = sorted(
        path
        for path in folder.rglob("*.nc")
        if len(path.relative_to(folder).parts) <= 2 and not path.stem.endswith(PARTIAL)
    )
    if not files:
        raise InputError(name, f"there are no results in {relative(folder)}", f"flexclear run {name}")
    changed = maintenance.shown_faults(Store(results_root()), folder)
    if changed:
        raise ResourceError(f"{changed[0]}: flexclear run {name}")
    if _of_another_run(folder):
        files = [path for path in files if path != folder / "post.nc"]
    # datasets are loaded and closed: the garbage collector closes open ones inside of whatever NetCDF call runs then
    tree = {path.relative_to(folder).with_suffix("").as_posix(): xr.load_dataset(path) for path in files}
    return xr.DataTree.from_dict(tree, name=folder.name)


def _dataset(path: Path) -> xr.Dataset:
    """Return the dataset in a file; InputError for one that is no scene's (a sweep's, another program's)."""
    import xarray as xr

    require_file(path, str(path))
    remedy = "name a scene, or a file below results/runs such as run.nc; xarray.open_dataset opens any other"
    with convert_reader_errors(path, str(path), "cannot be read as a NetCDF dataset", remedy):
        dataset = xr.load_dataset(path, engine="netcdf4")
    if not str(dataset.attrs.get("source")).startswith(f"{DISTRIBUTION} "):
        why = "is not a dataset of a scene: it has no attribute `source` that names flexclear"
        raise InputError(str(path), why, remedy)
    return dataset


def _of_another_run(folder: Path) -> bool:
    """Return True when the shown post.nc is derived from another run than the shown one, as after edits and
    `fc.run`."""
    store, where = Store(results_root()), folder.relative_to(results_root()).as_posix()
    post, made = store.last_shown(where, "post"), store.last_shown(where, "simulate")
    return post is not None and made is not None and post.facts.get("input run") != made.digest


def bundles(scene: Scene, workplace: Workplace | None = None) -> dict[str, xr.Dataset]:
    """Return the reduced flexible bodies of a scene by name, brought up to date in this process.

    Raises FlexclearError.
    """
    tasks = Graph(scene, shown=False).bundle
    return dict(zip(tasks, (workplace or open_workplace()).datasets(*tasks.values(), jobs=1), strict=True))


def deficits(graph: Graph, workplace: Workplace) -> str:
    """Return a table for each flexible body of what its bundle lacks."""
    from flexclear.artifacts.compliance import table

    reduced = dict(zip(graph.bundle, workplace.datasets(*graph.bundle.values()), strict=True))
    return "\n\n".join(f"{graph.scene.name}, {body}\n{table(data)}" for body, data in reduced.items())


def linear(
    scene: Scene, time: float | None = None, workplace: Workplace | None = None, task: str = "linear", **pose: Any
) -> xr.Dataset:
    """Return the equilibrium of a scene in one pose, and its natural vibrations; brought up to date as `run` is.

    task, pose: `Graph.linear` or `Graph.state_space`, and its arguments.
    """
    if time is not None and not scene.time.start <= time <= scene.time.end:
        raise InputError(
            "time", f"{time:.6g} s is outside of the scene's {scene.time.start:.6g} to {scene.time.end:.6g} s"
        )
    made = getattr(Graph(scene, shown=as_in_its_file(scene)), task)(time, **pose)
    return (workplace or open_workplace()).datasets(made)[0].assign_attrs(title=scene.title, scene=scene.name)


def conclude(graphs: Sequence[Graph], workplace: Workplace, outcome: Outcome, plans: Sequence[str] = ()) -> None:
    """Report the warnings and accuracy verdicts of the scenes' runs, as the last output of a command.

    Then raises MissedAccuracyError for runs that are not as accurate as requested, and for the sentences in `plans`.
    """
    missed = [*plans]
    for graph in graphs:
        record = outcome.records.get(graph.simulate)
        if record is None:
            continue
        for sentence in filter(None, record.said.get("warnings", "").split("\n")):
            workplace.monitor.say(f"{graph.scene.name}: {WARNING}{sentence}")
        verdict, requested = record.said.get("accuracy_verdict", "met"), graph.scene.accuracy
        if verdict != "met":
            asked = "[accuracy]" if requested else "accuracy by default"
            text = f"{graph.scene.name} {asked}: {verdict}; the run is stored"
            if requested is None or requested.allow_missed:
                workplace.monitor.say(text)
            else:
                missed.append(f"{text}\n  hint: request less, or write allow_missed = true in [accuracy]")
    if missed:
        raise MissedAccuracyError("\n".join(missed))


def as_in_its_file(scene: Scene) -> bool:
    """Return True when a scene is as its file has it, so that its results are shown below results/runs."""
    return scene.path is not None and load_scene(scene.path) == scene


def overrides(settings: Sequence[str]) -> dict[str, object]:
    """Parse ``KEY=VALUE`` texts into edits of a scene; values are TOML, else text. InputError for other texts."""
    changes: dict[str, object] = {}
    for text in settings:
        key, sign, value = text.partition("=")
        if not sign or not key.strip():
            raise InputError(f"--set {text}", "is not KEY=VALUE", "write --set joint.A1.clearance='0.2 mm'")
        try:
            changes[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except ValueError:  # not TOML, or a number with more digits than Python reads
            changes[key.strip()] = value.strip()
        except RecursionError:
            raise InputError(f"--set {text}", "nests tables or lists too deeply to be read") from None
    return changes


def load_by_name(name: str, settings: Sequence[str] = ()) -> Scene:
    """Load the scene called `name` and apply `settings`; its own name then contains them, and so do its results.

    Raises InputErrors; where only some parts cannot be read, also for the others.
    """
    path = find_scene(name)
    try:
        scene = load_scene(path, overrides(settings))
    except InputError as error:
        refuse([*errors_of(error), *errors_from([partial(_check_rest, path, settings, str(error))])])
        raise
    scene._name = with_edits(scene.name, settings)
    return scene


def _check_rest(path: Path, settings: Sequence[str], errors: str) -> None:
    """Check the parts that no error names of a scene that cannot be read, where these form a scene on their own."""
    wrong = set(re.findall(r"\[(\w+)\.([\w-]+)", errors))
    if not wrong or any(family not in ACTING for family, _ in wrong):
        return
    table = table_with_changes(path, overrides(settings))
    for family in ACTING:
        table[family] = {name: part for name, part in table.get(family, {}).items() if (family, name) not in wrong}
    left = {key: value for key, value in table.items() if key not in ("view", "accuracy", "event")}
    with suppress(ValidationError, ResourceError), errors_in_file(path):
        simulation.check_parts(simulation.params(Scene.model_validate(left)))


def with_edits(name: str, settings: Sequence[str]) -> str:
    """Return the name with its changes, as a folder's name; long changes are shortened to a start and a digest."""
    if not settings:
        return name
    suffix = ",".join(re.sub(r"[^\w.=+-]+", "_", text) for text in settings).rstrip(".")  # Windows drops final dots
    # 100: largest length of the `--set` changes in a folder's name [bytes]
    short = suffix if len(suffix.encode()) <= 100 else f"{suffix[:40]},{sha256(suffix.encode())[:16]}"
    return f"{name},{short}"


def graphs(names: list[str], settings: Sequence[str] = ()) -> list[Graph]:
    """Return the graphs of the scenes with `settings` (KEY=VALUE) applied, each once; errors of all are raised
    together."""
    by_scene: dict[Path | str, Graph] = {}
    wrong: list[InputError] = []
    for name in names:
        try:
            graph = Graph(load_by_name(name, settings))
            examine(graph.scene, settings)
            with errors_in_file(graph.scene.path):
                graph.up_to("post")
            path = graph.scene.path
            by_scene[graph.scene.name if path is None or settings else path.resolve()] = graph
        except InputError as error:
            wrong += errors_of(error)
    refuse([toml_files.with_line_number(error) for error in wrong])
    _refuse_namesakes([graph.scene for graph in by_scene.values()])
    return list(by_scene.values())


@contextmanager
def errors_in_file(path: Path | None) -> Iterator[None]:
    """Add this file to the location of errors that have none."""
    try:
        yield
    except InputError as error:
        raise toml_files.with_file_name(error, path) from None


def implausibilities(scene: Scene, settings: Sequence[str] = ()) -> list[InputError]:
    """Return plausibility warnings about a scene; those about values from `settings` are located there."""
    changed = overrides(settings)
    warnings = []
    for warning in implausible_values(scene):
        key = warning.place.partition("[")[2].rstrip("]")
        place = f"--set {key}" if key in changed else warning.place
        warnings.append(InputError(place, warning.problem, warning.remedy))
    return warnings


def examine(scene: Scene, settings: Sequence[str] = ()) -> None:
    """Print plausibility warnings; raise InputErrors for dangling names. Both come before any computation."""
    require_names(scene)
    for warning in implausibilities(scene, settings):
        print(f"flexclear: {WARNING}{toml_files.with_line_number(warning)}", file=sys.stderr)


def require_names(scene: Scene) -> None:
    """Raise InputErrors for dangling names in a scene, before any mesh or mode is computed for it."""
    table = scene.model_dump(mode="python", exclude_none=True)
    where = str(scene.path or scene.name)
    refuse([*dangling_names(table, body_frames, where), *missing_stress_errors(scene)])


def missing_stress_errors(scene: Scene) -> Iterator[InputError]:
    """Yield an error for each requested stress that the body's recipe does not give."""
    requested = [(f"accuracy.{name}", name) for name in (scene.accuracy.quantities if scene.accuracy else ())]
    requested += [("view.watch", name) for name in (scene.view and scene.view.watch) or ()]
    for place, name in requested:
        for term in parse(name, scene.owners()).terms():
            body, kind = term.owner.partition(".")[0], KINDS[term.kind]
            if kind.owner not in ("section", "gauge") or body not in scene.flexible():
                continue
            with suppress(InputError):  # a recipe that cannot be read is reported elsewhere
                recipe = Path(scene.flexible()[body].mesh)
                solid, outlines = kind_of(recipe) == "solid", '"type": "general"' not in json.dumps(read_toml(recipe))
                if (kind.owner == "section" and solid) or (kind.variable.endswith("stress") and not outlines):
                    lacks = "a solid, which has no sections" if solid else "a rod with sections of unknown outline"
                    remedy = f"request {body}.peak_von_mises" if solid else f"request {body}.section_force"
                    where = f"{scene.path or scene.name} [{place}]"
                    yield InputError(where, f"'{name}' is not recorded: '{body}' is {lacks}", remedy)


def copy_run(graph: Graph, workplace: Workplace, target: Path) -> None:
    """Write the dataset of the run to a file of the user's, titled, and atomically like any other."""
    dataset = run(graph.scene, workplace)
    with disk_limits(target.parent):
        export.write(dataset, target)


def check_out(
    out: Path | None, given: Sequence[str], what: str = "scene", endings: Sequence[str] = tuple(export.NEEDS)
) -> None:
    """Raise InputError for `--out` where no file of one of the scenes can be written; called before the work."""
    if out is None:
        return
    if len(given) > 1:
        raise InputError("--out", f"takes one {what}, not {len(given)}", f"run the {what}s one by one")
    export.check_format(out, endings)
    check_target(out)


def moment(text: str | None) -> float | None:
    """Return the time that `--at` names [s]; InputError for text that is no time."""
    try:
        return None if text is None else quantity(text, "time")
    except ValueError as error:
        raise InputError(f"--at {text}", str(error), "give seconds, or a number with a unit of time") from None


def write_page(page: Path, text: str, files: Mapping[str, bytes]) -> None:
    """Write a page in Markdown, with its files in a folder of the same name next to it."""
    folder = page.parent / page.stem
    with disk_limits(page.parent):
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            publish(folder / name, content)
        publish(page, text.encode())


def check_target(target: Path, option: str = "--out") -> None:
    """Raise InputError when a file cannot be written there; called before the work."""
    where = f"{option} {target}"
    try:
        if not target.parent.is_dir():
            raise InputError(where, "its folder does not exist", f"mkdir -p {target.parent}")
        if target.is_dir():
            raise InputError(where, "is a folder", "name a file in it")
        if target.exists() and not target.is_file():  # replacing a device by a file would destroy it
            raise InputError(where, "is not an ordinary file", "name an ordinary file")
    except OSError as error:
        raise InputError(where, f"cannot be a file: {error.strerror}", "name another one") from None


def _refuse_namesakes(scenes: list[Scene]) -> None:
    """Raise InputError when two files given together have the same scene name."""
    folders: dict[str, Path] = {}
    for scene in scenes:
        path = _file(scene)
        if path is not None and folders.setdefault(scene.name, path) != path:
            raise InputError(
                str(path),
                f"is called '{scene.name}', as is {folders[scene.name]}: their results would replace each other",
                "rename one, or call the command from a folder above both, where their paths name them",
            )


def claim(scene: Scene, store: Store) -> str | None:
    """Note that results/runs/<name> belongs to this file; return a sentence when it belonged to another one."""
    path = _file(scene)
    if path is None:
        return None
    note = store.root / "runs" / scene.name / FACTS / "scene.owner"
    before = (read_checked(note) or {}).get("file")
    if before == str(path):
        return None
    with disk_limits(note.parent):
        note.parent.mkdir(parents=True, exist_ok=True)
        publish(note, encode_with_digest({"file": str(path)}))
    if not isinstance(before, str) or not is_file(Path(before)):
        return None
    return f"results/runs/{scene.name} showed {before} and now shows {path}, which has the same name"


def _file(scene: Scene) -> Path | None:
    return None if scene.path is None else scene.path.resolve()
