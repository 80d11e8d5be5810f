"""A film of a run: the moving mechanism, and its curves next to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr
from vtkmodules.vtkCommonCore import vtkLogger

from flexclear.post.body_shape import faces, has_edges
from flexclear.post.overview.curves import in_unit
from flexclear.post.plotting import style
from flexclear.post.render import film_speed, layout, mechanism, ruler
from flexclear.post.render.panel import panel
from flexclear.post.render.surfaces import Surface
from flexclear.post.render.view import ANGLE, View, axes_of, eye, upright
from flexclear.scene.quantity import Quantity
from flexclear.system.progress import Progress, silent

VIEW, SIDE, HEIGHT = 656, 304, 540
#: colour of the bar: red, green, blue
INK = (34, 34, 34)
BACKGROUND, BACKGROUND_TOP = "#ffffff", "#e6ecf2"
SOFT = "#5b6570"
#: empty rows of a picture above and below its parts, at least
ROOM = 6
#: half the height of what the eye sees, over its distance
SLOPE = float(np.tan(0.5 * np.radians(ANGLE)))


@dataclass(frozen=True, slots=True)
class Actors:
    """Moving objects of the picture: an actor of each part, meshes of flexible bodies."""

    parts: tuple[Any, ...]
    flexible: tuple[pv.PolyData, ...]


@dataclass
class Strip:
    """The rows of a film's picture in which something is drawn, from `top` to before `bottom`: the others never change.

    A picture costs what its pixels cost. scene: the film's.  empty: its picture without actors.  cloud: points that are
    in the strip from its begin [m], shape (n, 3); it grows where a part leaves it.
    """

    scene: pv.Plotter
    empty: np.ndarray
    cloud: np.ndarray
    top: int = HEIGHT
    bottom: int = 0

    def image(self) -> np.ndarray:
        """Return the current picture at its full height."""
        corners = list(product(*np.reshape(self.scene.renderer.ComputeVisiblePropBounds(), (3, 2))))
        top, bottom = self._rows(np.array(corners))
        if top < self.top or bottom > self.bottom:
            first, last = self._rows(self.cloud)
            self._draw_only(min(top, first, self.top), max(bottom, last, self.bottom))
        picture = self.empty.copy()
        picture[self.top : self.bottom] = image(self.scene)
        return picture

    def _rows(self, points: np.ndarray) -> tuple[int, int]:
        """Return the first row in which points [m] are drawn, and the one after the last: all, unless all points are in
        front of the eye."""
        camera = self.scene.camera
        position, focus, upwards = (np.array(v) for v in (camera.position, camera.focal_point, camera.up))
        _, up, back = ((points - position) @ axes_of(View(position - focus, upwards, False), position, focus)).T
        if not (back < 0.0).all():
            return 0, HEIGHT
        rows = np.clip(0.5 * HEIGHT * (1.0 + up / (back * SLOPE)), 0.0, HEIGHT)
        return max(int(rows.min()) - ROOM, 0), min(int(rows.max()) + ROOM, HEIGHT)

    def _draw_only(self, top: int, bottom: int) -> None:
        """Let the plotter draw these rows only, with their part of the background."""
        self.top, self.bottom, height = top, bottom, bottom - top
        self.scene.window_size = [VIEW, height]
        self.scene.camera.view_angle = np.degrees(2.0 * np.arctan(SLOPE * height / HEIGHT))
        self.scene.camera.SetWindowCenter(0.0, (HEIGHT - top - bottom) / height)
        low, high = (np.array(pv.Color(color).float_rgb) for color in (BACKGROUND, BACKGROUND_TOP))
        ends = [low + (high - low) * (1.0 - row / HEIGHT) for row in (bottom, top)]
        self.scene.set_background(ends[0], top=ends[1])


def still(drawn: mechanism.Mechanism, step: int, size: tuple[int, int] = (1200, 900), margin: int = 0) -> np.ndarray:
    """Draw the mechanism at an output, shape (height, width, 3); margin: empty space at both sides [pixels]."""
    scene = plotter(size)
    actors = _build(scene, drawn)
    _place(drawn, actors, step, impact=False)
    place_camera(scene, drawn, margin)
    result = image(scene)
    scene.close()
    return result


def frames(
    drawn: mechanism.Mechanism,
    post: xr.Dataset,
    rate: int,
    watched: Sequence[str] = (),
    curves: Sequence[Quantity] = (),
    progress: Progress = silent,
) -> Iterator[np.ndarray]:
    """Yield the pictures of the whole run, shape (height, width, 3).

    rate: pictures a second.  watched: names of bodies, joints and contacts; the first of each kind is shown next to the
    mechanism.  curves: quantities that are shown instead. Around the strongest impacts time is stretched
    (`film_speed`).
    """
    shown = film_speed.frame_times(drawn.run, drawn.looks.duration, drawn.looks.impact_slowdown, rate)
    steps = shown.steps(drawn.run)
    scene = plotter((VIEW, HEIGHT))
    strip = Strip(scene, image(scene), drawn.cloud)
    actors = _build(scene, drawn)
    margin = 0 if drawn.stress is None else ruler.BAR
    place_camera(scene, drawn, margin)
    # matplotlib draws the words below: a text in the scene costs as much as the mechanism
    caption = film_speed.Caption((VIEW, 26), SOFT)
    larger = "".join(f", {text}" for text in ruler.exaggeration(drawn))
    scale = ruler.pixels_per_metre(drawn, (VIEW, HEIGHT), margin)
    bar = ruler.round_length(0.2 * VIEW / scale)
    long = round(bar * scale)
    legend = None if drawn.stress is None else ruler.color_bar(drawn.stress, HEIGHT)
    with style.set_style():
        plots = panel(drawn.run, post, (SIDE, HEIGHT), watched, curves)
        for k, step in enumerate(steps):
            impact = _in_contact(drawn.run, int(steps[k - 1]) if k else 0, int(step))
            _place(drawn, actors, int(step), impact)
            picture = strip.image()
            caption.onto(picture, f"{film_speed.speed_text(float(shown.slower[k]))}{larger}, bar: {in_unit(bar, 'm')}")
            picture[-36:-33, VIEW - 16 - long : VIEW - 16] = INK
            if legend is not None:
                ruler.with_color_bar(picture, legend)
            yield np.concatenate([picture, plots.frame(int(step))], axis=1)
            if k % 15 == 0:
                progress((k + 1) / steps.size, "film")
    scene.close()


def _in_contact(run: xr.Dataset, before: int, now: int) -> bool:
    """Return True when any contact was closed since the frame before: impacts are shorter than a frame."""
    return "contact_gap" in run and bool((run.contact_gap.values[before : now + 1] < 0.0).any())


def _build(scene: pv.Plotter, drawn: mechanism.Mechanism) -> Actors:
    floor(scene, drawn)
    parts = tuple(solid(scene, part.surface, part.color, part.opacity) for part in drawn.parts)
    return Actors(parts, tuple(_surface_of_flexible(scene, drawn, body) for body in drawn.flexible))


def solid(scene: pv.Plotter, surface: Surface, color: str, opacity: float, mesh: pv.PolyData | None = None) -> Any:
    """Return a surface as an actor, shaded by its own normals: round ones smoothly, edges sharp."""
    shown = polydata(surface) if mesh is None else mesh
    actor = scene.add_mesh(shown, color=color, opacity=opacity, specular=0.3, specular_power=18)
    actor.prop.interpolation = "Phong"
    return actor


def _surface_of_flexible(scene: pv.Plotter, drawn: mechanism.Mechanism, body: mechanism.Flexible) -> pv.PolyData:
    points, shade = mechanism.shaded_points(drawn.run, body, 0)
    mesh = skin(points, faces(body.bundle))
    mesh["shade"] = shade
    q = np.abs(drawn.run.modal_coordinate.values[:, body.columns]).max(axis=1)
    largest = drawn.stress or max(float(mechanism.drawn_points(drawn.run, body, int(np.argmax(q)))[1].max()), 1e-12)
    if body.color is not None:
        scene.add_mesh(mesh, color=body.color, **shading(body.bundle))
        return mesh
    scene.add_mesh(
        mesh,
        scalars="shade",
        cmap=ruler.STRESS_COLORS if body.stressed else "viridis",
        clim=(0.0, largest),
        show_scalar_bar=False,
        **shading(body.bundle),
    )
    return mesh


def _place(drawn: mechanism.Mechanism, actors: Actors, step: int, impact: bool) -> None:
    for part, actor in zip(drawn.parts, actors.parts, strict=True):
        if part.owner is not None:
            actor.user_matrix = layout.part_pose(drawn.run, part, step)
        if part.contact is not None:
            actor.prop.color = layout.IMPACT_COLOR if impact else layout.CLEARANCE_COLOR
    for bent, mesh in zip(drawn.flexible, actors.flexible, strict=True):
        mesh.points, mesh["shade"] = mechanism.shaded_points(drawn.run, bent, step)


def floor(scene: pv.Plotter, drawn: mechanism.Mechanism) -> None:
    """Add a pale disc under the mechanism, unless the motion is planar or the scene sets the direction of view."""
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


def place_camera(scene: pv.Plotter, drawn: mechanism.Mechanism, margin: int = 0) -> None:
    """Place lights, and the camera so that all that is drawn over the run is in the picture, between its margins
    [pixels]."""
    axes = np.eye(3) if drawn.view.planar else upright(drawn.view.up)
    for light, intensity in (((-2.0, 3.0, 4.0), 0.62), ((4.0, 1.0, 2.0), 0.3), ((-1.0, -4.0, 1.0), 0.35)):
        scene.add_light(pv.Light(position=tuple(axes @ light), intensity=intensity, light_type="scene light"))
    width, height = scene.window_size
    position, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    scene.camera_position = [tuple(position), tuple(focus), tuple(drawn.view.up)]
    scene.camera.view_angle = ANGLE
    scene.enable_anti_aliasing("msaa", multi_samples=4)


def plotter(size: tuple[int, int]) -> pv.Plotter:
    """Return an off-screen plotter. Call it only where `post.render.gl.can_draw()`."""
    # without a display VTK warns and then draws off-screen all the same
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    scene = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    scene.set_background(BACKGROUND, top=BACKGROUND_TOP)
    scene.add_light(pv.Light(light_type="headlight", intensity=0.35))
    return scene


def skin(points: np.ndarray, faces: np.ndarray) -> pv.PolyData:
    """Join points (n, 3) by faces (m, corners); faces of one corner are bare points."""
    points = np.ascontiguousarray(points)
    return pv.PolyData(points) if faces.shape[1] == 1 else pv.PolyData.from_regular_faces(points, faces)


def polydata(surface: Surface) -> pv.PolyData:
    """Return a surface for pyvista, its normals included."""
    mesh = pv.PolyData.from_regular_faces(surface.points, surface.triangles)
    mesh.point_data["Normals"] = surface.normals.astype(np.float32)
    mesh.point_data.active_normals_name = "Normals"
    return mesh


def shading(bundle: xr.Dataset) -> dict[str, Any]:
    """Return the shading of a body's skin: rods smooth, solids with their edges, bare nodes as dots."""
    if bundle.sizes["corner"] == 1:
        return {"style": "points", "point_size": 9.0, "render_points_as_spheres": True}
    return {"smooth_shading": True, "split_sharp_edges": has_edges(bundle)}


def image(scene: pv.Plotter) -> np.ndarray:
    """Return the current picture as bytes, shape (height, width, 3)."""
    scene.reset_camera_clipping_range()  # the parts have moved
    scene.render()  # else a second screenshot would show the first one again
    return np.asarray(scene.screenshot(return_img=True))
