"""``flexclear check``: every mistake of scenes, recipes and sweeps at once, with file and line; nothing is run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.errors import InputError, InputErrors
from flexclear.pipeline.core.scene import lines
from flexclear.pipeline.core.scene.load import compose, load_scene, read_toml
from flexclear.pipeline.core.scene.oddities import oddities
from flexclear.pipeline.core.scene.references import dangling
from flexclear.stages import run, s1_mesh, s3_rigid
from flexclear.stages.graph import Graph

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument(
        "scenes", nargs="+", metavar="SCENE", help="a scene, recipe or sweep file, or a name below scenes/"
    )
    parser.add_argument("--json", action="store_true", help="print the mistakes as JSON")


def command(options: argparse.Namespace) -> int:
    """Tell all mistakes of all files; exit code 2 where there are some, not for what is only odd."""
    found: dict[str, InputError] = {}
    for name in options.scenes:
        mistakes, scene = examined(name)
        found |= {str(mistake): mistake for mistake in mistakes}
        if not mistakes and not options.json:
            print(f"{run.find_scene(name)}: {scene.summary() if scene is not None else 'recipe'}; no mistake found")
            for odd in oddities(scene) if scene is not None else ():
                print(f"flexclear: warning: {lines.located(odd)}", file=sys.stderr)
    if options.json:
        print(json.dumps([_record(mistake) for mistake in found.values()], indent=2))
    else:
        for mistake in found.values():
            print(f"flexclear: {lines.located(mistake)}", file=sys.stderr)
        if len(found) > 1:
            print(f"flexclear: {len(found)} mistakes", file=sys.stderr)
    return InputError.exit_code if found else 0


def examined(name: str) -> tuple[list[InputError], Scene | None]:
    """All mistakes of a scene, sweep or recipe, and the scene where there is one that can be read."""
    found: list[InputError] = []
    try:
        path = run.find_scene(name)
        if _is_sweep(path):
            return _of_sweep(path)
        if _is_recipe(path):
            return _collect([partial(_recipe, path)]), None
        found += dangling(compose(path), run.recipe_frames, str(path))
    except InputError as error:
        return _each(error), None
    scene = None
    try:
        scene = load_scene(path)
    except InputError as error:
        found += _each(error)
    found += _collect(_recipes(path))
    if scene is not None:
        found += _collect([lambda: Graph(scene).up_to("post")], path)
        found += _collect(_laws(scene), path)
        if not found and all(s1_mesh.kind_of(Path(mesh)) == "beam" for mesh in scene.recipes().values()):
            found += _collect([lambda: _assembled(scene)], path)
    return list({str(error): error for error in found}.values()), scene


def _is_sweep(path: Path) -> bool:
    """Whether a file is a sweep of a scene: it has no bodies and extends nothing, but says what is varied or kept."""
    table = read_toml(path)
    return not {"body", "extends"} & set(table) and bool({"vary", "keep", "scene"} & set(table))


def _is_recipe(path: Path) -> bool:
    """Whether a file is a mesh recipe: it has no bodies and extends nothing, but says what it is made of."""
    table = read_toml(path)
    return not {"body", "extends"} & set(table) and bool({"shape", "material", "materials"} & set(table))


def _of_sweep(path: Path) -> tuple[list[InputError], Scene | None]:
    """All mistakes of a sweep, its own and those of its scene, and that scene."""
    from flexclear.stages import sweep, sweep_plan

    try:
        wanted, scene = sweep.read(path)
    except InputError as error:
        return _each(error), None
    found, _ = examined(str(scene.path))
    if not found:
        found = _collect([lambda: sweep_plan.plan(wanted, scene, str(path))])
    return found, scene


def _recipes(path: Path) -> Iterator[Callable[[], Any]]:
    """A check for each mesh recipe that a scene names."""
    bodies = compose(path).get("body", {})
    meshes = dict.fromkeys(body["mesh"] for body in bodies.values() if isinstance(body.get("mesh"), str))
    yield from (partial(_recipe, Path(mesh)) for mesh in meshes)


def _recipe(path: Path) -> None:
    """Read a mesh recipe; of a beam, the nodes at which frames and masses have to lie are laid out, too."""
    from flexclear.pipeline.structure.fe.recipe import read_recipe

    table = read_recipe(path)
    if s1_mesh.kind_of(path) == "beam":
        from flexclear.pipeline.structure.fe import mesh

        mesh.build(table, place=str(path))


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


def _assembled(scene: Scene) -> None:
    """Build the mechanism of a scene: poses, axes and loads are then checked against the joints.

    Of bodies from recipes of beams, which are meshed in no time, mass and frames are known without their modes; of
    flexible ones it is looked whether the joints fit where nothing is deformed.
    """
    from flexclear.pipeline.dynamics.model.assembly import assembled
    from flexclear.pipeline.dynamics.model.mechanism import build
    from flexclear.pipeline.dynamics.model.model import tabulate

    bodies = {name: _undeformed(Path(mesh)) for name, mesh in scene.recipes().items()}
    meshed = {f"{s3_rigid.PREFIX}{name}": bodies[name] for name in scene.meshed()}
    if meshed:
        table = scene.model_dump(mode="python", exclude_none=True)
        table["body"] = s3_rigid.filled(table["body"], meshed)
        scene = type(scene).model_validate(table)
    if scene.flexible():
        assembled(build(scene, {name: bodies[name] for name in scene.flexible()}))
    else:
        tabulate(build(scene, {}))


def _undeformed(recipe: Path) -> xr.Dataset:
    """Mass, inertia and frames of a beam (schema RIGID)."""
    from flexclear.pipeline.structure.fe import mesh
    from flexclear.pipeline.structure.fe.recipe import read_recipe
    from flexclear.pipeline.structure.modes import rigid

    return rigid.build(mesh.build(read_recipe(recipe), place=str(recipe)))


def _collect(checks: Iterable[Callable[[], Any]], path: Path | None = None) -> list[InputError]:
    """What the checks raise; errors without a file are placed in that of `path`."""
    found: list[InputError] = []
    for check in checks:
        try:
            with run.in_file(path):
                check()
        except InputError as error:
            found += _each(error)
    return found


def _each(error: InputError) -> list[InputError]:
    return list(error.errors) if isinstance(error, InputErrors) else [error]


def _record(mistake: InputError) -> dict[str, Any]:
    found = lines.where(mistake)
    file, line = (str(found[0]), found[1]) if found else (None, None)
    return {
        "file": file,
        "line": line,
        "place": mistake.place,
        "problem": mistake.problem,
        "remedy": mistake.remedy,
    }
