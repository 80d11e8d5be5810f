"""``flexclear check``: every mistake of scenes, recipes and sweeps at once, with file and line; nothing is run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.errors import FlexclearError, InputError, InputErrors, ResourceError
from flexclear.pipeline.core.scene import lines
from flexclear.pipeline.core.scene.file_kinds import RECIPE, SCENE, SWEEP, kind_of_file
from flexclear.pipeline.core.scene.limits import Limits
from flexclear.pipeline.core.scene.load import compose, load_scene, read_toml
from flexclear.pipeline.core.scene.plausibility import oddities
from flexclear.pipeline.core.scene.references import dangling
from flexclear.stages import run, s1_mesh, s3_rigid
from flexclear.stages.graph import Graph

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene

#: the message about a file: it is wrong, or asks for too much
MISTAKES = (InputError, ResourceError)


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument(
        "scenes", nargs="+", metavar="SCENE", help="a scene, recipe or sweep file, or a name below scenes/"
    )
    parser.add_argument(
        "--show", action="store_true", help="also write the start pose of each scene, and what does not fit there"
    )
    parser.add_argument("--json", action="store_true", help="print the mistakes as JSON")


def command(options: argparse.Namespace) -> int:
    """Tell all mistakes of all files; exit code 2 where there are some, 4 where a file only asks for too much.

    What is only odd is reported, and is no mistake.
    """
    errors: dict[str, FlexclearError] = {}
    for name in options.scenes:
        mistakes, seen = examined(name)
        if options.show:
            refused = _show(name, quiet=options.json)
            mistakes = mistakes or ([] if refused is None else [refused])
        errors |= {str(mistake): mistake for mistake in mistakes}
        if not mistakes and not options.json:
            print(f"{run.find_scene(name)}: {seen.summary}; no error")
            for odd in seen.odd:
                print(f"flexclear: warning: {lines.located(odd)}", file=sys.stderr)
    if options.json:
        print(json.dumps([_record(mistake) for mistake in errors.values()], indent=2))
    else:
        for mistake in errors.values():
            text = lines.located(mistake) if isinstance(mistake, InputError) else mistake
            print(f"flexclear: {text}", file=sys.stderr)
        if len(errors) > 1:
            print(f"flexclear: {len(errors)} mistakes", file=sys.stderr)
    return min((mistake.exit_code for mistake in errors.values()), default=0)


def _show(name: str, *, quiet: bool) -> InputError | None:
    """Write the start pose of a scene where one can be drawn; returns why it is refused."""
    from flexclear.stages import show

    try:
        if kind_of_file(read_toml(run.find_scene(name))) == SCENE:
            scene = load_scene(run.find_scene(name))
            run.require_names(scene)
            return show.shown(scene, quiet=quiet)
    except MISTAKES:  # told with all others
        pass
    return None


@dataclass(frozen=True, slots=True)
class Seen:
    """What a file is, in words, and what in it looks odd without being a mistake."""

    summary: str = ""
    odd: tuple[InputError, ...] = ()


def examined(name: str) -> tuple[list[FlexclearError], Seen]:
    """All mistakes of a scene, sweep or recipe, and what it is where it can be read."""
    try:
        path = run.find_scene(name)
        return LOOKS[kind_of_file(read_toml(path))](path)
    except MISTAKES as error:
        return _each(error), Seen()


def _of_scene(path: Path) -> tuple[list[FlexclearError], Seen]:
    errors = list[FlexclearError](dangling(compose(path), run.recipe_frames, str(path)))
    scene = None
    try:
        scene = load_scene(path)
    except MISTAKES as error:
        errors += _each(error)
    errors += _collect(_recipes(path))
    if scene is not None:
        errors += _collect([lambda: Graph(scene).up_to("post")], path)
        errors += _collect(_laws(scene), path)
        if not errors and all(s1_mesh.kind_of(Path(mesh)) == "beam" for mesh in scene.recipes().values()):
            errors += _collect([lambda: _assembled(scene)], path)
    seen = Seen(scene.summary(), tuple(oddities(scene))) if scene is not None else Seen()
    return list({str(error): error for error in errors}.values()), seen


def _of_sweep(path: Path) -> tuple[list[FlexclearError], Seen]:
    """Its own mistakes and those of its scene."""
    from flexclear.stages import sweep, sweep_plan

    requested, scene = sweep.read(path)
    errors, seen = examined(str(scene.path))
    if not errors:
        errors = _collect([lambda: sweep_plan.plan(requested, scene, str(path))])
    return errors, replace(seen, summary=f"a sweep over {', '.join(requested.vary)} of {scene.name}: {seen.summary}")


def _of_recipe(path: Path) -> tuple[list[FlexclearError], Seen]:
    """A recipe is examined as where a scene names it, with the limits of a scene that says none."""
    errors = _collect([lambda: s1_mesh.check_size(path, Limits())])
    if not any(isinstance(error, ResourceError) for error in errors):  # what is too large is not meshed
        errors += _collect([lambda: _recipe(path)])
    if errors:
        return errors, Seen()
    table = s1_mesh.params(path)["recipe"]
    frames = ", ".join(table.get("frames", {})) or "none"
    text = f"a mesh recipe, {table['shape']['type']}, frames: {frames}"
    beam = s1_mesh.kind_of(path) == "beam"
    return [], Seen(f"{text}, mass {float(_undeformed(path).mass):.6g} kg" if beam else text)


LOOKS = {SCENE: _of_scene, SWEEP: _of_sweep, RECIPE: _of_recipe}


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

        mesh.build(table, where=str(path))


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

    Where the scene begins at a state that is searched for, that is the mechanism whose joints place the bodies there.
    Of bodies from recipes of beams, which are meshed in no time, mass and frames are known without their modes; of
    flexible ones it is looked whether the joints fit where nothing is deformed.
    """
    from flexclear.pipeline.dynamics.model.assembly import assembled
    from flexclear.pipeline.dynamics.model.mechanism import build
    from flexclear.pipeline.dynamics.model.model import tabulate
    from flexclear.pipeline.dynamics.run.run import placed

    bodies = {name: _undeformed(Path(mesh)) for name, mesh in scene.recipes().items()}
    meshed = {f"{s3_rigid.PREFIX}{name}": bodies[name] for name in scene.meshed()}
    if meshed:
        table = scene.model_dump(mode="python", exclude_none=True)
        table["body"] = s3_rigid.filled(table["body"], meshed)
        scene = type(scene).model_validate(table)
    scene = placed(scene)
    if scene.flexible():
        assembled(build(scene, {name: bodies[name] for name in scene.flexible()}))
    else:
        tabulate(build(scene, {}))


def _undeformed(recipe: Path) -> xr.Dataset:
    """Mass, inertia and frames of a beam (schema RIGID)."""
    from flexclear.pipeline.structure.fe import mesh
    from flexclear.pipeline.structure.fe.recipe import read_recipe
    from flexclear.pipeline.structure.modes import rigid

    return rigid.build(mesh.build(read_recipe(recipe), where=str(recipe)))


def _collect(checks: Iterable[Callable[[], Any]], path: Path | None = None) -> list[FlexclearError]:
    """What the checks raise; errors without a file are placed in that of `path`."""
    errors: list[FlexclearError] = []
    for check in checks:
        try:
            with run.in_file(path):
                check()
        except MISTAKES as error:
            errors += _each(error)
    return errors


def _each(error: FlexclearError) -> list[FlexclearError]:
    return list(error.errors) if isinstance(error, InputErrors) else [error]


def _record(mistake: FlexclearError) -> dict[str, Any]:
    if not isinstance(mistake, InputError):
        return {"file": None, "line": None, "place": "", "problem": str(mistake), "remedy": None}
    location = lines.where(mistake)
    file, line = (str(location[0]), location[1]) if location else (None, None)
    return {
        "file": file,
        "line": line,
        "place": mistake.place,
        "problem": mistake.problem,
        "remedy": mistake.remedy,
    }
