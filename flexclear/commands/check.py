"""``flexclear check``: every mistake of scenes, recipes and sweeps at once, with file and line; nothing is run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.commands import examination, scenes
from flexclear.commands.examination import MISTAKES
from flexclear.pipeline.core.scene import lines
from flexclear.pipeline.core.scene.file_kinds import RECIPE, SCENE, SWEEP, kind_of_file
from flexclear.pipeline.core.scene.limits import Limits
from flexclear.pipeline.core.scene.load import compose, read_toml
from flexclear.pipeline.core.scene.references import dangling
from flexclear.pipeline.core.system.errors import FlexclearError, InputError, InputErrors, ResourceError
from flexclear.stages import meshing
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import add_options

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument(
        "scenes", nargs="+", metavar="SCENE", help="a scene, recipe or sweep file, or a name below scenes/"
    )
    parser.add_argument(
        "--show", action="store_true", help="also write the start pose of each scene, and what does not fit there"
    )
    add_options(parser, "set", "json", "said")


def command(options: argparse.Namespace) -> int:
    """Print all mistakes of all files; exit code 2 where there are some, 4 where a file only asks for too much.

    Implausible values are warnings, which leave the exit code 0.
    """
    errors: dict[str, FlexclearError] = {}
    warnings: dict[str, InputError] = {}
    for name in options.scenes:
        mistakes, seen = examined(name, options.set)
        if options.show:
            refused = _show(name, options.set, quiet=options.json)
            mistakes = mistakes or ([] if refused is None else [refused])
        errors |= {str(mistake): mistake for mistake in mistakes}
        warnings |= {str(warning): warning for warning in seen.warnings}
        if not mistakes and not options.json and not options.quiet:
            print(f"{scenes.find_scene(name)}: {seen.summary}; no error")
    if options.json:
        records = [_record(mistake, "error") for mistake in errors.values()]
        print(json.dumps([*records, *(_record(warning, "warning") for warning in warnings.values())], indent=2))
    else:
        for warning in warnings.values():
            print(f"flexclear: warning: {lines.located(warning)}", file=sys.stderr)
        for mistake in errors.values():
            text = lines.located(mistake) if isinstance(mistake, InputError) else mistake
            print(f"flexclear: {text}", file=sys.stderr)
        if len(errors) > 1:
            print(f"flexclear: {len(errors)} mistakes", file=sys.stderr)
    return min((mistake.exit_code for mistake in errors.values()), default=0)


def _show(name: str, settings: Sequence[str], *, quiet: bool) -> InputError | None:
    """Write the start pose of a scene where one can be drawn; returns why it is refused."""
    from flexclear.commands import show

    try:
        if kind_of_file(read_toml(scenes.find_scene(name))) == SCENE:
            scene = scenes.loaded(name, settings)
            scenes.require_names(scene)
            return show.shown(scene, quiet=quiet)[1]
    except MISTAKES:  # listed with all others
        pass
    return None


@dataclass(frozen=True, slots=True)
class Seen:
    """What a file is, in words, and what in it looks implausible without being wrong."""

    summary: str = ""
    warnings: tuple[InputError, ...] = ()


def examined(name: str, settings: Sequence[str] = ()) -> tuple[list[FlexclearError], Seen]:
    """All mistakes of a scene, sweep or recipe, and what it is where it can be read.

    settings: as `--set` has them; a scene is examined with these changes.
    """
    try:
        path = scenes.find_scene(name)
        kind = kind_of_file(read_toml(path))
        return _of_scene(path, settings) if kind == SCENE else OTHERS[kind](path)
    except MISTAKES as error:
        return _each(error), Seen()


def _of_scene(path: Path, settings: Sequence[str] = ()) -> tuple[list[FlexclearError], Seen]:
    errors = list[FlexclearError](dangling(compose(path), scenes.recipe_frames, str(path)))
    scene = None
    try:
        scene = scenes.loaded(str(path), settings)
    except MISTAKES as error:
        errors += _each(error)
    recipes = _collect(_recipes(path))
    errors += recipes
    if scene is None:
        return _once(errors), Seen()
    errors += _collect([lambda: Graph(scene).up_to("post")], path)
    errors += _collect(_laws(scene), path)
    warnings, summary = scenes.implausibilities(scene, settings), scene.summary()
    if not errors:
        found = examination.scene(scene)
        errors, warnings = found.errors, [*warnings, *found.warnings]
        summary = "; ".join([summary, *found.notes])
    return _once(errors), Seen(summary, tuple(warnings))


def _once(errors: Iterable[FlexclearError]) -> list[FlexclearError]:
    return list({str(error): error for error in errors}.values())


def _of_sweep(path: Path) -> tuple[list[FlexclearError], Seen]:
    """Its own mistakes and those of its scene."""
    from flexclear.commands import sweep
    from flexclear.stages.sweeps import sweep_plan

    requested, scene = sweep.read(path)
    errors, seen = examined(str(scene.path))
    if not errors:
        errors = _collect([lambda: sweep_plan.plan(requested, scene, str(path))])
    return errors, replace(seen, summary=f"a sweep over {', '.join(requested.vary)} of {scene.name}: {seen.summary}")


def _of_recipe(path: Path) -> tuple[list[FlexclearError], Seen]:
    """A recipe is examined as where a scene names it, with the limits of a scene that says none."""
    errors = _collect([lambda: meshing.check_size(path, Limits())])
    if any(isinstance(error, ResourceError) for error in errors):  # what is too large is not meshed
        return errors, Seen()
    body, found = examination.recipe(path)
    errors = _once([*errors, *found.errors])
    if errors:
        return errors, Seen()
    table = meshing.params(path)["recipe"]
    frames = ", ".join(table.get("frames", {})) or "none"
    text = f"a mesh recipe, {table['shape']['type']}, frames: {frames}"
    text += f", mass {float(body.rigid.mass):.6g} kg" if body is not None else ""
    return [], Seen(text, tuple(found.warnings))


OTHERS = {SWEEP: _of_sweep, RECIPE: _of_recipe}


def _recipes(path: Path) -> Iterator[Callable[[], Any]]:
    """A check for each mesh recipe that a scene names, also of a scene with other mistakes."""
    from flexclear.pipeline.structure.fe.recipe import read_recipe

    bodies = compose(path).get("body", {})
    meshes = dict.fromkeys(body["mesh"] for body in bodies.values() if isinstance(body.get("mesh"), str))
    for mesh in meshes:
        if meshing.kind_of(Path(mesh)) == "beam":  # lays out the nodes at which frames and masses have to lie, too
            yield partial(_beam, Path(mesh))
        else:
            yield partial(read_recipe, Path(mesh))


def _beam(path: Path) -> None:
    from flexclear.pipeline.structure.fe import beam_mesh
    from flexclear.pipeline.structure.fe.recipe import parse, read_recipe

    beam_mesh.build(parse(read_recipe(path), str(path)), path.parent, str(path))


def _laws(scene: Scene) -> Iterator[Callable[[], Any]]:
    """A check for each prescribed coordinate: whether there is such a one, and its values fit."""
    from flexclear.pipeline.dynamics.model.driving import prescribed
    from flexclear.pipeline.dynamics.model.laws import checked_law

    for name, drive in scene.drive.items():
        if getattr(drive, "joint", None) in (None, *scene.joint):
            alone = scene.model_copy(update={"drive": {name: drive}})

            def check(alone: Scene = alone) -> None:
                for one in prescribed(alone):
                    checked_law(alone, one.law, one.dimension, one.place)

            yield check


def _collect(checks: Iterable[Callable[[], Any]], path: Path | None = None) -> list[FlexclearError]:
    """What the checks raise; errors without a file are placed in that of `path`."""
    errors: list[FlexclearError] = []
    for check in checks:
        try:
            with scenes.in_file(path):
                check()
        except MISTAKES as error:
            errors += _each(error)
    return errors


def _each(error: FlexclearError) -> list[FlexclearError]:
    return list(error.errors) if isinstance(error, InputErrors) else [error]


def _record(mistake: FlexclearError, severity: str) -> dict[str, Any]:
    record = {"severity": severity, "file": None, "line": None, "place": "", "problem": str(mistake), "remedy": None}
    if not isinstance(mistake, InputError):
        return record
    location = lines.where(mistake)
    file, line = (str(location[0]), location[1]) if location else (None, None)
    place = {"file": file, "line": line, "place": mistake.place}
    return {**record, **place, "problem": mistake.problem, "remedy": mistake.remedy}
