"""A film of a run: the moving mechanism, and its curves next to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr

from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render import pace
from flexclear.pipeline.post.render.mechanism import (
    CLEARANCE_COLOR,
    IMPACT_COLOR,
    Flexible,
    Mechanism,
    part_pose,
    placed,
    shade,
)
from flexclear.pipeline.post.render.panel import panel
from flexclear.pipeline.post.render.ruler import (
    BAR,
    STRESS_COLORS,
    color_bar,
    exaggeration,
    pixels_per_metre,
    round_length,
    with_color_bar,
    words,
)
from flexclear.pipeline.post.render.stage import SOFT, image, plotter, polydata, shading, skin
from flexclear.pipeline.post.render.surfaces import Surface
from flexclear.pipeline.post.render.view import ANGLE, eye
from flexclear.pipeline.post.render.writing import RATE, write
from flexclear.pipeline.post.shapes.body_shape import faces

VIEW, SIDE, HEIGHT = 656, 304, 540
#: colour of the bar: red, green, blue
INK = (34, 34, 34)


@dataclass(frozen=True, slots=True)
class Actors:
    """What moves in the picture: an actor of each part, meshes of flexible bodies."""

    parts: tuple[Any, ...]
    flexible: tuple[pv.PolyData, ...]


def still(drawn: Mechanism, step: int, size: tuple[int, int] = (1200, 900), margin: int = 0) -> np.ndarray:
    """One picture of the mechanism at an output, shape (height, width, 3); margin: left at both sides [pixels]."""
    scene = plotter(size)
    actors = _build(scene, drawn)
    _place(drawn, actors, step, glow=False)
    look(scene, drawn, margin)
    result = image(scene)
    scene.close()
    return result


def film(
    drawn: Mechanism,
    post: xr.Dataset,
    watched: Sequence[str] = (),
    progress: Progress = silent,
    kind: str = "mp4",
    curves: Sequence[Quantity] = (),
) -> tuple[str, bytes]:
    """File suffix and content: MP4 where that is asked for and ffmpeg is there, else GIF; the whole run.

    watched: names of bodies, joints and contacts, of which the first of each is shown next to the mechanism.  curves:
    quantities that are shown instead of them.
    Around the strongest impacts time is stretched, so that they are seen (`pace`).
    """
    rate = RATE if kind == "mp4" else RATE // 2
    return write(_frames(drawn, post, watched, curves, progress, rate), rate, kind)


def _frames(
    drawn: Mechanism,
    post: xr.Dataset,
    watched: Sequence[str],
    curves: Sequence[Quantity],
    progress: Progress,
    rate: int,
) -> Iterator[np.ndarray]:
    time = drawn.run.time.values
    shown = pace.pace(drawn.run, drawn.looks.duration, drawn.looks.impact_slowdown, rate)
    steps = np.clip(np.searchsorted(time, shown.times - 1e-12 * (time[-1] - time[0])), 0, time.size - 1)
    scene = plotter((VIEW, HEIGHT))
    actors = _build(scene, drawn)
    margin = 0 if drawn.stress is None else BAR
    look(scene, drawn, margin)
    # words are drawn by matplotlib below: a text in the scene costs as much as the mechanism
    caption = pace.Caption((VIEW, 26), SOFT)
    larger = "".join(f", {text}" for text in exaggeration(drawn))
    scale = pixels_per_metre(drawn, (VIEW, HEIGHT), margin)
    bar = round_length(0.2 * VIEW / scale)
    long = round(bar * scale)
    legend = None if drawn.stress is None else color_bar(drawn.stress, HEIGHT)
    with style.style():
        plots = panel(drawn.run, post, (SIDE, HEIGHT), watched, curves)
        for k, step in enumerate(steps):
            struck = _struck(drawn.run, int(steps[k - 1]) if k else 0, int(step))
            _place(drawn, actors, int(step), struck)
            picture = image(scene)
            caption.onto(picture, f"{pace.speed_text(float(shown.slower[k]))}{larger}, bar: {words(bar)}")
            picture[-36:-33, VIEW - 16 - long : VIEW - 16] = INK
            if legend is not None:
                with_color_bar(picture, legend)
            yield np.concatenate([picture, plots.frame(int(step))], axis=1)
            if k % 15 == 0:
                progress((k + 1) / steps.size, "film")
    scene.close()


def _struck(run: xr.Dataset, before: int, now: int) -> bool:
    """Whether any contact was closed since the frame before: impacts are shorter than a frame."""
    return "contact_gap" in run and bool((run.contact_gap.values[before : now + 1] < 0.0).any())


def _build(scene: pv.Plotter, drawn: Mechanism) -> Actors:
    floor(scene, drawn)
    parts = tuple(solid(scene, part.surface, part.color, part.opacity) for part in drawn.parts)
    return Actors(parts, tuple(_flexible(scene, drawn, body) for body in drawn.flexible))


def solid(scene: pv.Plotter, surface: Surface, color: str, opacity: float, mesh: pv.PolyData | None = None) -> Any:
    """A surface as an actor, shaded by its own normals: round ones smoothly, edges sharp."""
    shown = polydata(surface) if mesh is None else mesh
    actor = scene.add_mesh(shown, color=color, opacity=opacity, specular=0.3, specular_power=18)
    actor.prop.interpolation = "Phong"
    return actor


def _flexible(scene: pv.Plotter, drawn: Mechanism, body: Flexible) -> pv.PolyData:
    mesh = skin(placed(drawn.run, body, 0)[0], faces(body.bundle))
    mesh["shade"] = shade(drawn.run, body, 0)
    q = np.abs(drawn.run.modal_coordinate.values[:, body.columns]).max(axis=1)
    largest = drawn.stress or max(float(placed(drawn.run, body, int(np.argmax(q)))[1].max()), 1e-12)
    if body.color is not None:
        scene.add_mesh(mesh, color=body.color, **shading(body.bundle))
        return mesh
    scene.add_mesh(
        mesh,
        scalars="shade",
        cmap=STRESS_COLORS if body.stressed else "viridis",
        clim=(0.0, largest),
        show_scalar_bar=False,
        **shading(body.bundle),
    )
    return mesh


def _place(drawn: Mechanism, actors: Actors, step: int, glow: bool) -> None:
    for part, actor in zip(drawn.parts, actors.parts, strict=True):
        if part.owner is not None:
            actor.user_matrix = part_pose(drawn.run, part, step)
        if part.contact is not None:
            actor.prop.color = IMPACT_COLOR if glow else CLEARANCE_COLOR
    for bent, mesh in zip(drawn.flexible, actors.flexible, strict=True):
        mesh.points, mesh["shade"] = placed(drawn.run, bent, step)[0], shade(drawn.run, bent, step)


def floor(scene: pv.Plotter, drawn: Mechanism) -> None:
    """A pale disc under the mechanism; none behind a planar one, and none where its scene says from where to look."""
    if drawn.view.planar or drawn.looks.direction is not None:
        return
    up = drawn.view.up
    height = drawn.cloud @ up
    flat = drawn.cloud - np.outer(height, up)
    middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    radius = 1.25 * float(np.linalg.norm(flat - middle, axis=1).max()) or drawn.size
    disc = pv.Disc(
        center=middle + (float(height.min()) - 0.02 * drawn.size) * up, inner=0.0, outer=radius, normal=up, c_res=120
    )
    scene.add_mesh(disc, color="#dfe5ec", ambient=0.12)


def look(scene: pv.Plotter, drawn: Mechanism, margin: int = 0) -> None:
    """Put the camera where all that is drawn over the run is in the picture, between its margins [pixels]."""
    width, height = scene.window_size
    position, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    scene.camera_position = [tuple(position), tuple(focus), tuple(drawn.view.up)]
    scene.camera.view_angle = ANGLE
    scene.enable_anti_aliasing("msaa", multi_samples=4)
