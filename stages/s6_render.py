"""Stage 6: a run -> pictures, film and interactive page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.stages.s4_simulate import bundles

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.progress import Progress
    from flexclear.pipeline.core.scene.schema import Scene


def gl_state() -> str:
    """Which GL libraries this machine has; part of the key of everything that is rendered."""
    from flexclear.pipeline.post.render import gl

    return gl.state()


def params(scene: Scene) -> dict[str, Any]:
    """GL libraries, what is watched, and from where, if the scene says so."""
    asked = scene.view.direction if scene.view is not None else None
    watched = list(dict.fromkeys(quantity.owner for quantity in scene.watched()))
    return {"gl": gl_state(), "watched": watched} | ({} if asked is None else {"direction": list(asked)})


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Pictures by file name; inputs are ``run`` and ``bundle/<body>``."""
    from flexclear.pipeline.post.render.pictures import pictures

    view = {"watched": params["watched"], "direction": params.get("direction")}
    return dict(pictures(inputs["run"], bundles(inputs), progress=progress, **view))
