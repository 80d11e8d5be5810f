"""A film of a run: the moving mechanism, and its curves beside it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr

from flexclear.pipeline.core.progress import Progress, silent
from flexclear.pipeline.post.body_shape import faces
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render.mechanism import (
    CLEARANCE_COLOR,
    IMPACT_COLOR,
    JOINT_COLOR,
    Flexible,
    Mechanism,
    placed,
    pose,
)
from flexclear.pipeline.post.render.panel import panel
from flexclear.pipeline.post.render.stage import SOFT, image, plotter, shading, skin

SECONDS, RATE = 5.6, 30
VIEW, SIDE, HEIGHT = 800, 352, 640


@dataclass(frozen=True, slots=True)
class Actors:
    """What moves in the picture: actors of rigid bodies and balls, meshes of flexible bodies."""

    rigid: tuple[Any, ...]
    balls: tuple[Any, ...]
    flexible: tuple[pv.PolyData, ...]
    pins: tuple[Any, ...] = ()


def still(drawn: Mechanism, step: int, size: tuple[int, int] = (1200, 900)) -> np.ndarray:
    """One picture of the mechanism at an output, shape (height, width, 3)."""
    scene = plotter(size)
    actors = _build(scene, drawn)
    _place(drawn, actors, step, glow=False)
    _look(scene, drawn)
    result = image(scene)
    scene.close()
    return result


def film(
    drawn: Mechanism, post: xr.Dataset, watched: Sequence[str] = (), progress: Progress = silent
) -> tuple[str, bytes]:
    """File suffix and content: MP4 where ffmpeg is there, else GIF; the whole run in SECONDS.

    watched: names of bodies, joints and contacts, of which the first of each is shown beside the mechanism.
    """
    frames = _frames(drawn, post, watched, progress)
    return write(frames, RATE)


def write(frames: Iterator[np.ndarray], rate: int) -> tuple[str, bytes]:
    """Frames of shape (height, width, 3) as MP4, or as GIF where no ffmpeg is found."""
    import imageio.v2 as imageio

    with tempfile.TemporaryDirectory() as folder:
        try:
            path = Path(folder) / "film.mp4"
            # one thread and no metadata: equal frames give equal bytes
            options = [
                "-threads",
                "1",
                "-map_metadata",
                "-1",
                "-fflags",
                "+bitexact",
                "-flags:v",
                "+bitexact",
                "-crf",
                "21",
            ]
            writer = imageio.get_writer(
                path, fps=rate, codec="libx264", quality=None, macro_block_size=16, output_params=options
            )
        except (ImportError, RuntimeError, ValueError):
            path = Path(folder) / "film.gif"
            writer = imageio.get_writer(path, duration=1000.0 / rate, loop=0)
        with writer:
            for frame in frames:
                writer.append_data(frame)
        return path.suffix.lstrip("."), path.read_bytes()


def _frames(drawn: Mechanism, post: xr.Dataset, watched: Sequence[str], progress: Progress) -> Iterator[np.ndarray]:
    time = drawn.run.time.values
    steps = np.searchsorted(time, np.linspace(time[0], time[-1], round(SECONDS * RATE)) - 1e-9)
    scene = plotter((VIEW, HEIGHT))
    actors = _build(scene, drawn)
    _look(scene, drawn)
    slow = SECONDS / (time[-1] - time[0])
    scene.add_text(f"{_pace(slow)}{_exaggeration(drawn)}", position=(16, HEIGHT - 34), font_size=9, color=SOFT)
    with style.style():
        plots = panel(drawn.run, post, (SIDE, HEIGHT), watched)
        for k, step in enumerate(steps):
            struck = _struck(drawn.run, int(steps[k - 1]) if k else 0, int(step))
            _place(drawn, actors, int(step), struck)
            yield np.concatenate([image(scene), plots.frame(int(step))], axis=1)
            if k % 15 == 0:
                progress((k + 1) / steps.size, "film")
    scene.close()


def _pace(slow: float) -> str:
    if 0.95 < slow < 1.05:
        return "as fast as it is"
    return f"{slow:.3g} times slower" if slow > 1.0 else f"{1.0 / slow:.3g} times faster"


def _exaggeration(drawn: Mechanism) -> str:
    return f", deformation {max(body.scale for body in drawn.flexible):.0f} times larger" if drawn.flexible else ""


def _struck(run: xr.Dataset, before: int, now: int) -> bool:
    """Whether any contact was closed since the frame before: impacts are shorter than a frame."""
    return "contact_gap" in run and bool((run.contact_gap.values[before : now + 1] < 0.0).any())


def _build(scene: pv.Plotter, drawn: Mechanism) -> Actors:
    _floor(scene, drawn)
    rigid = tuple(
        scene.add_mesh(
            body.mesh, color=body.color, opacity=body.opacity, smooth_shading=False, specular=0.3, specular_power=18
        )
        for body in drawn.rigid
    )
    balls = tuple(
        scene.add_mesh(
            pv.Sphere(radius=ball.radius, theta_resolution=40, phi_resolution=40),
            color=JOINT_COLOR if ball.contact is None else CLEARANCE_COLOR, smooth_shading=True, specular=0.4,
        )
        for ball in drawn.balls
    )  # fmt: skip
    pins = tuple(
        scene.add_mesh(pin.mesh, color=JOINT_COLOR if pin.contact is None else CLEARANCE_COLOR, specular=0.4)
        for pin in drawn.pins
    )
    return Actors(rigid, balls, tuple(_flexible(scene, drawn, body) for body in drawn.flexible), pins)


def _flexible(scene: pv.Plotter, drawn: Mechanism, body: Flexible) -> pv.PolyData:
    points, size = placed(drawn.run, body, 0)
    q = np.abs(drawn.run.modal_coordinate.values[:, body.columns]).max(axis=1)
    largest = max(float(placed(drawn.run, body, int(np.argmax(q)))[1].max()), 1e-12)
    mesh = skin(points, faces(body.bundle))
    mesh["deflection"] = size
    scene.add_mesh(
        mesh, scalars="deflection", cmap="viridis", clim=(0.0, largest), show_scalar_bar=False, **shading(body.bundle)
    )
    return mesh


def _place(drawn: Mechanism, actors: Actors, step: int, glow: bool) -> None:
    run = drawn.run
    for body, actor in zip(drawn.rigid, actors.rigid, strict=True):
        actor.user_matrix = pose(run, body.index, step)
    for ball, actor in zip(drawn.balls, actors.balls, strict=True):
        actor.position = run.frame_position.values[step, ball.frame]
        if ball.contact is not None:
            actor.prop.color = IMPACT_COLOR if glow else CLEARANCE_COLOR
    for pin, actor in zip(drawn.pins, actors.pins, strict=True):
        matrix = np.eye(4) if pin.owner is None else pose(run, pin.owner, step)
        matrix[:3, 3] = run.frame_position.values[step, pin.frame]
        actor.user_matrix = matrix
        if pin.contact is not None:
            actor.prop.color = IMPACT_COLOR if glow else CLEARANCE_COLOR
    for bent, mesh in zip(drawn.flexible, actors.flexible, strict=True):
        mesh.points, mesh["deflection"] = placed(run, bent, step)


def _floor(scene: pv.Plotter, drawn: Mechanism) -> None:
    """A pale disc under the mechanism; none behind a planar one."""
    if drawn.view.planar:
        return
    bottom = min(drawn.run.frame_position.values[..., 2].min(), drawn.run.position.values[..., 2].min())
    level = float(bottom) - 0.05 * drawn.size
    disc = pv.Disc(
        center=(drawn.centre[0], drawn.centre[1], level),
        inner=0.0,
        outer=0.62 * drawn.size,
        normal=(0, 0, 1),
        c_res=120,
    )
    scene.add_mesh(disc, color="#dfe5ec", ambient=0.12)


def _look(scene: pv.Plotter, drawn: Mechanism) -> None:
    seen = drawn.view
    centre = drawn.centre - (0.0 if seen.planar else 0.04) * drawn.size * seen.up
    reach = 0.85 if seen.planar else 1.12
    eye = centre + reach * drawn.size * seen.direction
    scene.camera_position = [tuple(eye), tuple(centre), tuple(seen.up)]
    scene.enable_anti_aliasing("msaa", multi_samples=8)
