"""Stage 6: a run -> pictures, film and interactive page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stages.s4_simulate import bundles

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.progress import Progress


def gl_state() -> str:
    """Which GL libraries this machine has; part of the key of everything that is rendered."""
    from pipeline.post.render import gl

    return gl.state()


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Pictures by file name; inputs are ``run`` and ``bundle/<body>``."""
    from pipeline.post.render.pictures import pictures

    return dict(pictures(inputs["run"], bundles(inputs), progress=progress))
