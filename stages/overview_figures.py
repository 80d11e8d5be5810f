"""Stage 7: a run -> general figures of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress


def params(scene: Scene) -> dict[str, Any]:
    """What is examined."""
    return {"watched": [quantity.written() for quantity in scene.watched()]}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """PNG and SVG by file name; inputs are ``run`` and ``post``."""
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.overview import figures

    progress(None, "figures")
    return dict(figures.make(inputs["run"], [Quantity.read(data) for data in params["watched"]], inputs["post"]))
