"""``flexclear show``: the start pose of scenes with all names, as a picture and a page; nothing is run or compiled."""

from __future__ import annotations

import html
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.post.pages import small_picture, viewer, viewer_page
from flexclear.post.render import gl
from flexclear.scene import notebook, toml_files
from flexclear.stages import meshing, rendering, scenes, simulation
from flexclear.stages.workplace import relative
from flexclear.system.errors import FlexclearError, InputError, ResourceError
from flexclear.system.progress import silent

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.post.render.start_view import StartView
    from flexclear.scene.schema import Scene


def show_start(
    scene: Scene, folder: Path | None = None, *, quiet: bool = False
) -> tuple[list[Path], InputError | None]:
    """Write picture and page, and print where they are; return the files, and the start's error or None."""
    with scenes.errors_in_file(scene.path):
        view, refused = draw_start(scene)
    files = files_of(scene, view, Path.cwd() if folder is None else folder, quiet=quiet)
    if not quiet:
        print(f"{scene.summary()}: {', '.join(relative(file) for file in files)}")
    for gap in view.gaps:
        print(f"flexclear: joint {gap.joint} does not fit at the start: {gap.words}", file=sys.stderr)
    return files, None if refused is None else toml_files.with_file_name(refused, scene.path)


@dataclass(frozen=True)
class Page:
    """Result of `flexclear.show`: a page to turn, which a notebook shows."""

    page: bytes = field(repr=False)

    def _repr_html_(self) -> str:
        """Return the page for a notebook, in a frame of its own so that its style stays there."""
        text = html.escape(self.page.decode(), quote=True)
        return f'<iframe srcdoc="{text}" width="100%" height="760" style="border:0"></iframe>'


@dataclass(frozen=True)
class Start(Page):
    """The page of a scene's start, with the view, and the error that refuses the start."""

    view: StartView
    refused: InputError | None

    @property
    def gaps(self) -> dict[str, str]:
        """Description of each joint's gap, by name; empty where all joints fit."""
        return {gap.joint: gap.words for gap in self.view.gaps}


def start(scene: Scene, folder: Path | None = None) -> Start:
    """Return the start pose of a scene; write picture and page where a folder is given.  Raises InputError."""
    view, refused = start_in_file(scene)
    if folder is not None:
        files_of(scene, view, folder)
    return Start(_page(scene, view), view, refused)


def motion(run: xr.Dataset, folder: Path | None = None) -> Page:
    """Return the page of a run; write it where a folder is given.  Raises InputError for bodies that are not known."""
    from flexclear.artifacts.recorded import scene_of
    from flexclear.post.single_run.series import parameters

    scene, bodies = scene_of(run), parameters(run).get("body")
    if not bodies:
        raise InputError("show", "the dataset is not that of a run", "give what fc.run returns, or a scene")
    if scene is None and any(body["type"] == "flexible" for body in bodies.values()):
        problem = "the shapes of flexible bodies are not in the dataset of a run from a file, or made from another"
        raise InputError("show", problem, "give what fc.run returns: fc.show(fc.run(scene))")
    params: dict[str, Any] = {"what": "motion", "format": "html", "title": str(run.attrs.get("title", ""))}
    bundles = {} if scene is None else scenes.bundles(scene)
    inputs = {"run": run, **{f"bundle/{name}": bundle for name, bundle in bundles.items()}}
    files = rendering.run(params if scene is None else rendering.params(scene, "motion", "html"), inputs, silent)
    if folder is not None:
        _write(folder, files)
    return Page(*files.values())


def _small(scene: Scene) -> str:
    """Return a picture of a scene's start for a notebook; nothing where none can be drawn."""
    from flexclear.post.render.pictures import png
    from flexclear.post.render.sketch import sketch

    try:
        return small_picture(png(sketch(start_in_file(scene)[0].drawn)))
    except FlexclearError:
        return ""


notebook.PICTURES.append(_small)


def start_in_file(scene: Scene) -> tuple[StartView, InputError | None]:
    """Return the start pose as `draw_start` does, of a scene whose names are checked; errors say the file."""
    scenes.require_names(scene)
    with scenes.errors_in_file(scene.path):
        return draw_start(scene)


def draw_start(scene: Scene) -> tuple[StartView, InputError | None]:
    """Return the start pose with its names, and the error that refuses it.  Raises InputError if none can be drawn."""
    from flexclear.dynamics.model.start_pose import start_pose
    from flexclear.dynamics.run.run import scene_in_place
    from flexclear.post.render.mechanism import Looks
    from flexclear.post.render.start_view import Missing, start_view

    bodies = {name: _body(scene.body[name], Path(recipe)) for name, recipe in scene.recipes().items()}
    looks = rendering.params(scene, "motion", "pvd")
    filled = _with_numbers(scene, bodies, lone := _unplaced_bodies(scene))
    pose = start_pose(filled, scene_in_place(filled), {name: bodies[name] for name in scene.flexible()}, bodies)
    gaps = [Missing(gap.joint, gap.start, gap.end, gap.angle) for gap in pose.gaps]
    view = start_view(pose.data, bodies, gaps, Looks(bodies=looks.get("bodies", {}), **looks.get("view", {})))
    if lone:
        note = f"drawn at the origin, since they have neither pose nor joint: {', '.join(lone)}"
        view = replace(view, notes=(*view.notes, note))
    return view, pose.refused


def files_of(scene: Scene, view: StartView, folder: Path, *, quiet: bool = False) -> list[Path]:
    """Write the page, and the picture where this machine can draw.  Raises ResourceError."""
    stem = Path(scene.name).name
    content = {f"{stem}_start.html": _page(scene, view)}
    if gl.can_draw():
        from flexclear.post.render.pictures import png
        from flexclear.post.render.start_view import picture

        content[f"{stem}_start.png"] = png(picture(view, scene.title or stem))
    elif not quiet:
        print(f"flexclear: warning: no picture, only the page: {gl.remedy()}", file=sys.stderr)
    return _write(folder, content)


def _write(folder: Path, content: dict[str, bytes]) -> list[Path]:
    try:
        for name, data in content.items():
            (folder / name).write_bytes(data)
    except OSError as error:
        raise ResourceError(f"{folder}: cannot be written: {error.strerror}") from None
    return [folder / name for name in content]


def figure(scene: Scene, view: StartView) -> str:
    """Return the start pose as a view to turn, a part of a page."""
    from flexclear.post.render.start_view import page_view

    return viewer(page_view(view), title_of(scene))


def title_of(scene: Scene) -> str:
    """Return the title of a scene, or the name of its file."""
    return scene.title or Path(scene.name).name


def _page(scene: Scene, view: StartView) -> bytes:
    return viewer_page(f"{title_of(scene)}: start", [figure(scene, view)])


def _body(body: Any, recipe: Path) -> xr.Dataset:
    """Return rigid-body data and drawn surface of a body with a mesh."""
    from flexclear.structure.kinds import kind
    from flexclear.structure.modes import bundle

    table: dict[str, Any] = meshing.params(recipe)["recipe"]
    return bundle.rigid_drawing(kind.build(table, recipe.parent, segment=body.segment))


def _unplaced_bodies(scene: Scene) -> list[str]:
    """Return the bodies that neither a pose nor a joint places, as in scenes about a body's modes alone."""
    joined = {frame.partition(".")[0] for joint in scene.joint.values() for frame in joint.between}
    paths = {drive.frame.partition(".")[0] for drive in scene.drive.values() if hasattr(drive, "frame")}
    return [n for n, b in scene.body.items() if getattr(b, "pose", b) is None and n not in joined | paths]


def _with_numbers(scene: Scene, bodies: dict[str, xr.Dataset], lone: list[str]) -> Scene:
    """Return the scene with numbers instead of the recipes of rigid bodies, and without deformation at the start.

    lone: bodies that are put at the origin.
    """
    table = scene.model_dump(mode="python", exclude_none=True)
    table["body"] = simulation.fill_in_recipes(
        table["body"], {f"{simulation.RIGID}{n}": bodies[n] for n in scene.meshed_bodies()}
    )
    table.get("start", {}).pop("modal", None)
    for name in lone:
        table["body"][name]["pose"] = {}
    return type(scene).model_validate(table)
