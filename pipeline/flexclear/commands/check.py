"""``flexclear check``: all errors of scenes, recipes and sweeps at once, with file and line; nothing is run.

The checks take seconds, without compilation: meshes, modes of small ones, the start, free motions.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.scene import toml_files
from flexclear.scene.limits import Limits
from flexclear.scene.load import RECIPE, SCENE, SWEEP, compose, is_file, kind_of_file
from flexclear.scene.references import dangling_names
from flexclear.scene.segments import body_frames, cut_segments
from flexclear.scene.toml_files import read_toml
from flexclear.scene.variants import ideal_scene, replaceable_contacts
from flexclear.stages import meshing, modal_analysis, reduction, scenes, show, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import add_options, open_workplace
from flexclear.system.errors import FlexclearError, InputError, ResourceError, SolverError, errors_of, refuse
from flexclear.system.progress import silent
from flexclear.workflow.execute import states

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.dynamics.model.mechanism import Mechanism
    from flexclear.dynamics.model.mobility import Mobility
    from flexclear.dynamics.model.model import Model
    from flexclear.scene.parts import FlexibleBody
    from flexclear.scene.schema import Scene
    from flexclear.structure.fe import model as fe
    from flexclear.workflow.task import Task

#: errors about a file: it is wrong, or asks for too much
MISTAKES = (InputError, ResourceError)
#: larger mesh files, and meshes with more unknowns, are checked by the run only [bytes, unknowns]
LARGEST_FILE, LARGEST_MESH = 20 << 20, 150_000
#: extents of a mesh from a file outside of which its unit of length is doubted [m]
SMALLEST_MESH_SIZE, LARGEST_MESH_SIZE = 1e-3, 10.0
#: the start of mechanisms with more free coordinates is checked by the run only, as where a flexible body of a mesh
#: with more unknowns was never reduced
MOST_COORDINATES, MOST_REDUCED = 60, 1_000
#: parts without which the start pose of a mechanism is another
PLACING = ("[drive.", "[start.", "[gear.")
#: number of unused frames that are listed
LISTED_FRAMES = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument(
        "scenes", nargs="+", metavar="SCENE", help="a scene, recipe or sweep file, or a name below scenes/"
    )
    parser.add_argument(
        "--show", action="store_true", help="also draw the start pose of each scene, with gaps where joints do not fit"
    )
    add_options(parser, "set", "json", "said")


def run_command(options: argparse.Namespace) -> int:
    """Print all errors of all files; exit code 2 for errors, 4 where a file only asks for too much.

    Implausible values are warnings, which leave the exit code 0.
    """
    errors: dict[str, FlexclearError] = {}
    warnings: dict[str, InputError] = {}
    for name in options.scenes:
        refused = _draw_start(name, options.set, quiet=options.json) if options.show else None
        findings = examine(name, options.set, refused)
        errors |= {str(mistake): mistake for mistake in findings.errors}
        warnings |= {str(warning): warning for warning in findings.warnings}
        if not findings.errors and not options.json and not options.quiet:
            print(f"{scenes.find_scene(name)}: {'; '.join(findings.notes)}; no error")
    if options.json:
        print(json.dumps(Findings([*errors.values()], [*warnings.values()]).records(), indent=2))
    else:
        for warning in warnings.values():
            print(f"flexclear: warning: {toml_files.with_line_number(warning)}", file=sys.stderr)
        for mistake in errors.values():
            text = toml_files.with_line_number(mistake) if isinstance(mistake, InputError) else mistake
            print(f"flexclear: {text}", file=sys.stderr)
        if len(errors) > 1:
            print(f"flexclear: {len(errors)} errors", file=sys.stderr)
    return min((mistake.exit_code for mistake in errors.values()), default=0)


def _draw_start(name: str, settings: Sequence[str], *, quiet: bool) -> InputError | None:
    """Write the start pose of a scene if it can be drawn; return the error that refuses it, or None."""
    try:
        if kind_of_file(read_toml(scenes.find_scene(name))) == SCENE:
            scene = scenes.load_by_name(name, settings)
            scenes.require_names(scene)
            return show.show_start(scene, quiet=quiet)[1]
    except MISTAKES:  # listed with all others
        pass
    return None


@dataclass
class Findings:
    """errors: refusals.  warnings: doubtful values.  notes: kind and facts of the file, in words."""

    errors: list[FlexclearError] = field(default_factory=list)
    warnings: list[InputError] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def attempt(self, check: Callable[[], Any], path: Path | None = None) -> bool:
        """Run a check and collect its errors, located in a file.  Returns True when the check passes."""
        try:
            with scenes.errors_in_file(path):
                check()
        except MISTAKES as error:
            raised = errors_of(error) if isinstance(error, InputError) else [error]
            self.errors += [one for one in raised if str(one) not in map(str, self.errors)]
            return False
        return True

    def records(self) -> list[dict[str, Any]]:
        """Return errors and warnings as tables: severity, file, line, place, problem, remedy."""
        found = (("error", self.errors), ("warning", self.warnings))
        return [_table_of_finding(mistake, severity) for severity, mistakes in found for mistake in mistakes]


def examine(name: str, settings: Sequence[str] = (), refused: InputError | None = None) -> Findings:
    """Return all errors and warnings of a scene, sweep or recipe, and a description where it can be read.

    settings: changes of the scene, ``KEY=VALUE`` as of `--set`.  refused: error of the drawn start, which counts where
    the mechanism is too large for a check of its start.
    """
    findings = Findings()
    findings.attempt(partial(_examine, name, settings, findings))
    findings.errors += [refused] if refused is not None and not findings.errors else []
    return findings


def _examine(name: str, settings: Sequence[str], findings: Findings) -> None:
    path = scenes.find_scene(name)
    {SCENE: _examine_scene, SWEEP: _check_sweep, RECIPE: _check_recipe}[kind_of_file(read_toml(path))](
        path, settings, findings
    )


def _examine_scene(path: Path, settings: Sequence[str], findings: Findings) -> None:
    findings.attempt(lambda: refuse(dangling_names(cut_segments(compose(path), str(path)), body_frames, str(path))))
    loaded: list[Scene] = []
    findings.attempt(lambda: loaded.append(scenes.load_by_name(str(path), settings)))
    # bodies may share a recipe, which is meshed once
    mesh_of = cache(partial(body_of_recipe, limits=loaded[0].limits if loaded else Limits()))
    bodies = compose(path).get("body", {}).values()
    for mesh in dict.fromkeys(body["mesh"] for body in bodies if isinstance(body.get("mesh"), str)):
        findings.errors += mesh_of(Path(mesh))[1].errors
    for scene in loaded:
        findings.errors += scenes.missing_stress_errors(scene)
        complete = findings.attempt(partial(Graph(scene).up_to, "post"), path) and not findings.errors
        for name, part in scene.flexible().items():
            findings.attempt(partial(_check_reference, name, part), path)
        findings.attempt(partial(simulation.check_parts, simulation.params(scene)), path)
        if scene.sections is not None:
            findings.attempt(partial(_check_sections, scene), path)
        unplaced = any(part in str(error) for error in findings.errors for part in PLACING)
        findings.warnings += scenes.implausibilities(scene, settings)
        findings.notes.append(scene.summary())
        if complete and not unplaced:
            compute(scene, mesh_of, findings)


def _check_sections(scene: Scene) -> None:
    """Check the period of the sections, which a run ignores."""
    from flexclear.dynamics.model.checks import section_period

    section_period(scene)


def _check_sweep(path: Path, settings: Sequence[str], findings: Findings) -> None:
    """Check a sweep file and its scene."""
    from flexclear.stages.sweeps import sweep_plan
    from flexclear.study import sweep

    requested, scene = sweep.read(path)
    _examine(str(scene.path), (), findings)
    if not findings.errors:
        findings.attempt(lambda: sweep_plan.plan(requested, scene, str(path)))
    findings.notes = [f"a sweep over {', '.join(requested.vary)} of {scene.name}: {'; '.join(findings.notes)}"]


def _check_recipe(path: Path, settings: Sequence[str], findings: Findings) -> None:
    """Check a recipe as a scene would use it, with the default limits of a scene."""
    body, of_mesh = body_of_recipe(path)
    findings.errors += of_mesh.errors
    if findings.errors:
        return
    table = meshing.params(path)["recipe"]
    mass = f", mass {float(body.rigid.mass):.6g} kg" if body is not None else ""
    frames = ", ".join(table.get("frames", {})) or "none"
    findings.warnings += of_mesh.warnings
    findings.notes.append(f"a mesh recipe, {table['shape']['type']}, frames: {frames}{mass}")


def _table_of_finding(mistake: FlexclearError, severity: str) -> dict[str, Any]:
    record = {"severity": severity, "file": None, "line": None, "place": "", "problem": str(mistake), "remedy": None}
    if not isinstance(mistake, InputError):
        return record
    location = toml_files.locate_error(mistake)
    file, line = (str(location[0]), location[1]) if location else (None, None)
    place = {"file": file, "line": line, "place": mistake.place}
    return {**record, **place, "problem": mistake.problem, "remedy": mistake.remedy}


@dataclass(frozen=True)
class Body:
    """A mesh without its modes.  rigid: mass, inertia and frames (schema RIGID).  interfaces: those of the recipe."""

    mesh: xr.Dataset
    model: fe.Model
    rigid: xr.Dataset
    interfaces: tuple[str, ...]


#: type of `body_of_recipe` as a function of a recipe's path
MeshOf = Callable[..., tuple[Body | None, Findings]]


def compute(whole: Scene, mesh_of: MeshOf, findings: Findings) -> None:
    """Check meshes and requested modes of a scene whose recipes can be read, then the mechanism that they form."""
    bodies: dict[str, Body] = {}
    for name, path in whole.recipes().items():
        body, of_mesh = mesh_of(Path(path), segment=getattr(whole.body[name], "segment", None))
        findings.errors += of_mesh.errors
        findings.warnings += of_mesh.warnings
        bodies |= {name: body} if body is not None else {}
    for name, part in whole.flexible().items():
        if name in bodies:
            findings.attempt(partial(_check_modes, bodies[name], name, part), whole.path)
    if set(bodies) != set(whole.recipes()):
        return
    if findings.attempt(partial(_check_assembly, whole, bodies, findings), whole.path) and not findings.errors:
        _free_motions(whole, bodies, findings)


def body_of_recipe(
    path: Path, limits: Limits | None = None, segment: tuple[int, int] | None = None
) -> tuple[Body | None, Findings]:
    """Return the body of a recipe if its mesh is allowed and takes seconds (else None), with errors and warnings.

    segment: of its rod; default: the whole.
    """
    findings = Findings()
    made: list[Body] = []
    if findings.attempt(partial(meshing.check_size, path, limits or Limits())):
        findings.attempt(lambda: made.extend(_mesh_recipe(path, segment, findings)))
    return (made[0] if made else None), findings


def _mesh_recipe(path: Path, segment: tuple[int, int] | None, findings: Findings) -> Iterator[Body]:
    from flexclear.structure.fe.recipe import parse
    from flexclear.structure.kinds import kind
    from flexclear.structure.modes import bundle

    table = meshing.params(path)["recipe"]
    parse(table, str(path))
    opened = meshing.files(table, path.parent).values()
    if any(is_file(file) and file.stat().st_size > LARGEST_FILE for file in opened):
        return
    try:
        mesh = kind.build(table, path.parent, segment=segment)
    except InputError as error:
        raise meshing.in_recipe(error, path) from None
    findings.warnings += _unit_warnings(mesh, table, path)
    if 3 * mesh.sizes.get("node", 0) > LARGEST_MESH:
        return
    model = kind.of_mesh(mesh).assemble(mesh)
    yield Body(mesh, model, bundle.rigid_of(model, mesh.attrs["title"]), tuple(mesh.attrs["interfaces"].split()))


def _unit_warnings(mesh: xr.Dataset, table: dict[str, object], path: Path) -> Iterator[InputError]:
    """Yield a warning for a mesh from a file whose size suggests another unit of length; files do not state theirs."""
    import numpy as np

    shape = table["shape"]
    if not isinstance(shape, dict) or shape.get("type") != "mesh-file":
        return
    size, unit = float(np.ptp(mesh["node_position"].values, axis=0).max()), shape.get("length_unit")
    if not SMALLEST_MESH_SIZE <= size <= LARGEST_MESH_SIZE:
        other = "mm" if size > LARGEST_MESH_SIZE else "m"
        yield InputError(
            f"{path} [shape.length_unit]",
            f"with lengths in {unit} the mesh is {size:.4g} m long",
            f'write length_unit = "{other}" if the mesh is in {other}',
        )


def _check_reference(name: str, part: FlexibleBody) -> None:
    with _errors_in_body(name, part):
        modal_analysis.check(modal_analysis.params(part))


def _check_modes(body: Body, name: str, part: FlexibleBody) -> None:
    from flexclear.structure.modes.solution import require_possible

    with _errors_in_body(name, part):
        require_possible(body.model, part.modes, body.interfaces)


@contextmanager
def _errors_in_body(name: str, part: FlexibleBody) -> Iterator[None]:
    """Add a body, or the rod of which it is a segment, to the place of an error, which is a key of the body."""
    try:
        yield
    except InputError as error:
        written = name.rpartition("_")[0] if part.segment else name
        raise InputError(f"[body.{written}.{error.place}]", error.problem, error.remedy) from None


def _check_assembly(whole: Scene, bodies: Mapping[str, Body], findings: Findings) -> None:
    """Assemble the mechanism at its start, which checks poses, axes, loads and loose joints against each other.

    Flexible bodies are undeformed; where their modes are at hand, and of rigid mechanisms, rank, drives and the start
    of the run are checked, too.
    """
    from flexclear.dynamics.analyses import start_refusals
    from flexclear.dynamics.model.assembly import assemble
    from flexclear.dynamics.model.checks import mechanism_errors
    from flexclear.dynamics.model.plausibility import doubts, start_errors, unused_frames

    mechanism = _mechanism(whole, bodies)
    sound = findings.attempt(lambda: refuse(mechanism_errors(whole, mechanism)), whole.path)
    moving: list[tuple[Model, Mobility]] = []
    if mechanism.all_rigid and sound:
        moving = [_model_and_mobility(mechanism)]
        mechanism = moving[0][0].mechanism
    else:
        mechanism = assemble(mechanism)
    refuse(start_errors(mechanism, final=whole.start is None or whole.start.at != "equilibrium"))
    reduced = _reduce_bodies(whole, bodies) if sound else None
    moving = [_model_and_mobility(_mechanism(whole, bodies, reduced))] if reduced else moving
    for known in (one for one in moving if one[0].nv <= MOST_COORDINATES):
        for check in start_refusals(_fill_in_recipes(whole, bodies), reduced or {}, *known):
            findings.attempt(_convert_start_errors()(check), whole.path)
    if not _starts_ideal(whole):
        _note_choice(whole, mechanism, findings)
    for place, text, remedy in doubts(mechanism):
        findings.warnings.append(toml_files.with_file_name(InputError(place, text, remedy), whole.path))
    unused = unused_frames(mechanism)
    if unused:
        more = f" and {len(unused) - LISTED_FRAMES} more" if len(unused) > LISTED_FRAMES else ""
        findings.notes.append(f"unused frames: {', '.join(unused[:LISTED_FRAMES])}{more}")


def _model_and_mobility(mechanism: Mechanism) -> tuple[Model, Mobility]:
    """Return the model of a mechanism and how it can move; raise InputError where it cannot."""
    from flexclear.dynamics.model.mobility import analyse
    from flexclear.dynamics.model.model import tabulate
    from flexclear.dynamics.run.evaluation.engine import refuse_singular

    model = tabulate(mechanism)
    mobility = analyse(model)
    with _convert_start_errors():
        refuse_singular(model, mobility)
    return model, mobility


def _reduce_bodies(whole: Scene, bodies: Mapping[str, Body]) -> dict[str, xr.Dataset] | None:
    """Return the flexible bodies with their modes: of small meshes computed, of others from the store; None where one
    is not there."""
    reduced: dict[str, xr.Dataset] = {}
    for name, part in whole.flexible().items():
        mesh, requested = bodies[name].mesh, reduction.params(whole, name)
        if bodies[name].model.size <= MOST_REDUCED:
            with _errors_in_body(name, part), _convert_start_errors():
                modes = modal_analysis.run(modal_analysis.params(part), {"mesh": mesh}, silent)["nc"]
            reduced[name] = reduction.run(requested, {"mesh": mesh, "modes": modes}, silent)["nc"]
        elif found := _stored_dataset(Graph(whole).bundle[name]):
            reduced[name] = found
        else:
            return None
    return reduced


def _stored_dataset(task: Task) -> xr.Dataset | None:
    """Return the main file of a task's artifact where that is up to date."""
    place = open_workplace()
    if place.store.last_shown(task.folder, task.label) is None:
        return None
    record = states([task], place.store, place.sources)[-1].record
    return None if record is None else place.store.load(record)


@contextmanager
def _convert_start_errors() -> Iterator[None]:
    """Turn errors that the run would meet at its start into errors of the scene."""
    try:
        yield
    except SolverError as error:
        raise InputError("[start]", str(error)) from None


def _starts_ideal(whole: Scene) -> bool:
    """Return True for a scene that starts as its ideal mechanism does."""
    return whole.start is not None and whole.start.at == "ideal"


def _note_choice(whole: Scene, mechanism: Mechanism, findings: Findings) -> None:
    """Warn of a start that the scene does not choose; frames moved within their tolerance are no choice."""
    if "[start.joint." in mechanism.choice:
        findings.warnings.append(toml_files.with_file_name(InputError("[start]", mechanism.choice), whole.path))


def _fill_in_recipes(whole: Scene, bodies: Mapping[str, Body]) -> Scene:
    """Return the scene with the numbers of those rigid bodies that recipes describe."""
    meshed = {f"{simulation.RIGID}{name}": bodies[name].rigid for name in whole.meshed_bodies()}
    if not meshed:
        return whole
    table = whole.model_dump(mode="python", exclude_none=True)
    table["body"] = simulation.fill_in_recipes(table["body"], meshed)
    return type(whole).model_validate(table)


def _mechanism(whole: Scene, bodies: Mapping[str, Body], bundles: Mapping[str, xr.Dataset] | None = None) -> Mechanism:
    """Return the mechanism of a scene where it starts; without bundles flexible bodies have no modes."""
    from flexclear.dynamics.model.mechanism import build
    from flexclear.dynamics.run.run import scene_in_place

    whole = _fill_in_recipes(whole, bodies)
    return build(scene_in_place(whole), bundles or {name: bodies[name].rigid for name in whole.flexible()})


def _free_motions(whole: Scene, bodies: Mapping[str, Body], findings: Findings) -> None:
    """Note the free motions besides the drives, with rigid bodies and loose joints closed, where these fit."""
    from flexclear.dynamics.model.mobility import analyse
    from flexclear.dynamics.model.model import tabulate

    idealised = bool(replaceable_contacts(whole) or whole.flexible())
    try:
        model = tabulate(_mechanism(ideal_scene(whole) if idealised else whole, bodies))
        free = analyse(model).mobility
    except InputError:  # the mechanism moves only with flexible bodies or with clearance
        return
    if _starts_ideal(whole):
        _note_choice(whole, model.mechanism, findings)
    closed = " with loose joints closed" if replaceable_contacts(whole) else ""
    findings.notes.append(f"free motions in addition to the drives{closed}: {free}")
