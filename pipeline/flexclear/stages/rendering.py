"""Stage 6: run, reduced bodies or vibrations -> pictures, films, interactive pages, files for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.post.render import gl
from flexclear.scene.parts import UNSEEN
from flexclear.scene.quantity import Quantity
from flexclear.stages.simulation import bundles
from flexclear.system.external_files import companion_files

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: subjects and their formats; repeated here, because the modules that draw take long to import
FORMATS: dict[str, tuple[str, ...]] = {
    "motion": ("png", "gif", "mp4", "html", "gltf", "pvd"),
    "stress": ("png", "gif", "mp4", "html"),
    "modes": ("png", "gif", "mp4", "html", "gltf", "pvd"),
    "joint": ("png", "gif", "mp4", "html"),
    "vibrations": ("png", "gif", "mp4", "html"),
}
#: subjects whose films show curves next to them
FILMED = ("motion", "stress")


def params(scene: Scene, what: str, kind: str) -> dict[str, Any]:
    """Return subject, format, view, watched parts, and the GL libraries where pictures depend on them."""
    values: dict[str, Any] = {"what": what, "format": kind}
    if what in ("motion", "stress", "vibrations") and kind in ("png", "gif", "mp4"):
        values["gl"] = gl.library_state()  # which GL libraries this machine has
    if kind == "html":
        values["title"] = scene.title
    if what != "modes":
        values["bodies"] = _looks(scene)
    if scene.view is not None and what != "modes":
        view = scene.view.model_dump(mode="json", exclude={"watch", "source"}, exclude_none=True)
        values |= {"view": view} if view else {}
    if (what == "joint" and kind in ("png", "html")) or (what in FILMED and kind in ("gif", "mp4")):
        terms = [term for quantity in scene.watched_quantities() for term in quantity.terms()]
        values["watched"] = list(dict.fromkeys(term.owner for term in terms if term.owner))
        if what in FILMED and scene.view is not None and scene.view.watch is not None:
            values["curves"] = [quantity.to_json() for quantity in scene.watched_quantities()]
    return values


def _looks(scene: Scene) -> dict[str, Any]:
    """Return shapes and colours of bodies that have some; files by name, since the key contains their content."""
    looks = {n: b.model_dump(mode="json", include=set(UNSEEN), exclude_none=True) for n, b in scene.body.items()}
    return {name: look for name, look in looks.items() if look}


def files(scene: Scene, what: str) -> dict[str, Path]:
    """Return the files of the shapes shown, and those that their formats read with them, by path."""
    looks = _looks(scene).values() if what != "modes" else ()
    named = [Path(shape["file"]) for look in looks for shape in look.get("geometry", ()) if shape["type"] == "file"]
    return {str(file): file for path in named for file in (path, *companion_files(path))}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Draw the files, by name; inputs are ``run`` or ``linear``, and ``bundle/<body>``."""
    from flexclear.post.render.mechanism import Looks
    from flexclear.post.render.pictures import Shown, make

    shown = Shown(
        run=inputs.get("run"),
        linear=inputs.get("linear"),
        bundles=bundles(inputs),
        looks=Looks(bodies=params.get("bodies", {}), **params.get("view", {})),
        watched=params.get("watched", ()),
        curves=[Quantity.from_json(data) for data in params.get("curves", ())],
        title=str(params.get("title", "")),
        progress=progress,
    )
    progress(None, f"{params['what']} as {params['format']}")
    return dict(make(params["what"], params["format"], shown))
