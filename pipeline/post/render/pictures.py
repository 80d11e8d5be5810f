"""All pictures of one scene: start, film, mode shapes to turn and for ParaView."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import xarray as xr

from flexclear.pipeline.core.log import LOG
from flexclear.pipeline.core.progress import Progress, silent
from flexclear.pipeline.post.render import gl
from flexclear.pipeline.post.series import derive


def pictures(
    run: xr.Dataset,
    bundles: Mapping[str, xr.Dataset],
    post: xr.Dataset | None = None,
    progress: Progress = silent,
    *,
    watched: Sequence[str] = (),
    direction: Sequence[float] | None = None,
) -> dict[str, bytes]:
    """File contents by name: ``mechanism.png``, ``film.mp4`` (or gif), ``mode_<body>.html``, ``modes_<body>.vtu``.

    run: schema RUN.  bundles: schema BUNDLE by name of the flexible body.  watched: as of `film.film`.
    direction: from the mechanism to the eye, instead of what suits it.  Without GL libraries the
    result is empty, and one line on stderr says what to install.
    """
    if not gl.works():
        LOG.warning("no pictures; %s", gl.remedy())
        return {}
    # pyvista is imported only where it can draw
    from flexclear.pipeline.post.render import film, mechanism

    post = derive(run) if post is None else post
    drawn = mechanism.mechanism(run, bundles, direction)
    result = {"mechanism.png": png(film.still(drawn, _farthest(run)))}
    suffix, content = film.film(drawn, post, watched, progress)
    result[f"film.{suffix}"] = content
    for body, bundle in bundles.items():
        result |= shape_files(body, bundle)
    return result


def shape_files(body: str, bundle: xr.Dataset) -> dict[str, bytes]:
    """``mode_<body>.html`` with the first mode, and ``modes_<body>.vtu`` with all; GL must work."""
    from flexclear.pipeline.post.render import shapes

    return {f"mode_{body}.html": shapes.page(bundle, 0), f"modes_{body}.vtu": shapes.vtu(bundle)}


def png(pixels: np.ndarray) -> bytes:
    """PNG file of pixels of shape (height, width, 3)."""
    from matplotlib.image import imsave

    buffer = io.BytesIO()
    imsave(buffer, np.ascontiguousarray(pixels), format="png", metadata=cast(Any, {"Software": None}))
    return buffer.getvalue()


def _farthest(run: xr.Dataset) -> int:
    """The output at which the bodies are farthest from where they started."""
    return int(np.argmax(np.abs(run.position.values - run.position.values[:1]).sum(axis=(1, 2))))
