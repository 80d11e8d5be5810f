"""Pictures, films, pages and files for other programs from a run, its reduced bodies and its vibrations."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.image import imsave

from flexclear.post.overview import figures
from flexclear.post.pages import media, viewer, viewer_page
from flexclear.post.plotting import mode_sheet, style
from flexclear.post.render import film_speed, gl, gltf, panel, paraview, player, vibrations
from flexclear.post.render.mechanism import Looks, Mechanism, cloud, mechanism
from flexclear.post.single_run.series import derive
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress, silent

#: outputs of a series for ParaView, and of a glTF file
SERIES, KEYS = 100, 240


@dataclass(frozen=True)
class Shown:
    """Data and settings of pictures.

    run: schema RUN; linear: schema LINEAR; bundles: schema BUNDLE by name of the flexible body.  watched, curves: as of
    `film.frames`.  title: of pages.
    """

    run: xr.Dataset | None = None
    linear: xr.Dataset | None = None
    bundles: Mapping[str, xr.Dataset] = field(default_factory=dict)
    looks: Looks = field(default_factory=Looks)
    watched: Sequence[str] = ()
    curves: Sequence[Quantity] = ()
    title: str = ""
    progress: Progress = silent

    def mechanism(self, *, stressed: bool = False) -> Mechanism:
        """Return the run as moving solids; stressed: coloured by von Mises stress."""
        return mechanism(self.of_run, self.bundles, self.looks, stressed=stressed)

    @property
    def of_run(self) -> xr.Dataset:
        """The run, which must exist."""
        assert self.run is not None
        return self.run

    def page(self, what: str, views: Sequence[str], below: str = "") -> bytes:
        """Return a page of views, with the scene and the subject as its title."""
        return viewer_page(f"{self.title}: {what}" if self.title else what, views, below)


Maker = Callable[[Shown, str], dict[str, bytes]]


def make(what: str, kind: str, shown: Shown) -> dict[str, bytes]:
    """Return file contents by name.  Raises InputError for a scene without the requested subject."""
    return MAKERS[what][kind](shown, kind)


def png(pixels: np.ndarray) -> bytes:
    """Return the PNG file of pixels of shape (height, width, 3)."""
    buffer = io.BytesIO()
    imsave(buffer, np.ascontiguousarray(pixels), format="png", metadata=cast(Any, {"Software": None}))
    return buffer.getvalue()


def _still(shown: Shown, kind: str, *, stressed: bool = False) -> dict[str, bytes]:
    """Draw the output at which the bodies are farthest from their start, or the stress is largest."""
    _must_draw()
    from flexclear.post.render import film, ruler

    drawn, margin = shown.mechanism(stressed=stressed), ruler.BAR if stressed else 0
    moved = np.abs(drawn.run.position.values - drawn.run.position.values[:1]).sum(axis=(1, 2))
    step = int(np.argmax(drawn.run["von_mises_stress"].values.max(axis=1) if stressed else moved))
    drawn = replace(drawn, cloud=cloud(drawn.run, drawn.parts, drawn.flexible, [step]))
    picture = film.still(drawn, step, margin=margin)
    return {f"{'stress' if stressed else 'mechanism'}.png": png(ruler.with_scale_bar(picture, drawn, margin))}


def _film(shown: Shown, kind: str, *, stressed: bool = False) -> dict[str, bytes]:
    _must_draw()
    from flexclear.post.render import film

    drawn, rate = shown.mechanism(stressed=stressed), film_speed.pictures_per_second(kind)
    frames = film.frames(drawn, derive(drawn.run), rate, shown.watched, shown.curves, shown.progress)
    suffix, content = film_speed.write(frames, rate, kind)
    return {f"{'stress' if stressed else 'film'}.{suffix}": content}


def _must_draw() -> None:
    """Raise SolverError without GL libraries, before pyvista is imported: the import would end the process."""
    if not gl.can_draw():
        raise SolverError(f"no pictures of solids: {gl.remedy()}")


def _motion_page(shown: Shown, kind: str, *, stressed: bool = False) -> dict[str, bytes]:
    what, caption = ("stress", "Von Mises stress") if stressed else ("motion", "Motion")
    view = viewer(player.motion(shown.mechanism(stressed=stressed)), caption)
    return {f"{what}.html": shown.page(what, [view])}


def _motion_gltf(shown: Shown, kind: str) -> dict[str, bytes]:
    drawn = shown.mechanism()
    time = drawn.run["time"].values
    steps = np.unique(np.linspace(0, time.size - 1, KEYS).astype(int))
    slower = (shown.looks.duration or film_speed.SECONDS) / float(time[-1] - time[0])
    return {"motion.glb": gltf.motion(drawn, steps, slower)}


def _motion_series(shown: Shown, kind: str) -> dict[str, bytes]:
    drawn = shown.mechanism()
    steps = film_speed.frame_times(drawn.run, None, shown.looks.impact_slowdown).steps(drawn.run, SERIES)
    return paraview.series(drawn, np.unique(steps))


def _bodies(shown: Shown) -> Mapping[str, xr.Dataset]:
    if not shown.bundles:
        raise InputError("--what modes", "the scene has no flexible body and therefore no modes", "show its motion")
    return shown.bundles


def _view_of_body(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction of view of a body, and the upward direction."""
    view = player.side(bundle)
    return view.direction, view.up


def _mode_sheets(shown: Shown, kind: str) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for body, bundle in _bodies(shown).items():
        files |= mode_sheet.files(f"modes_{body}", body, bundle, *_view_of_body(bundle))
    return files


def _mode_films(shown: Shown, kind: str) -> dict[str, bytes]:
    files = {}
    for body, bundle in _bodies(shown).items():
        suffix, content = film_speed.write(mode_sheet.film_frames(body, bundle, *_view_of_body(bundle)), 12, kind)
        files[f"modes_{body}.{suffix}"] = content
    return files


def _mode_page(shown: Shown, kind: str) -> dict[str, bytes]:
    """Return a page with the mode sets of all bodies next to each other."""
    views = [
        viewer(player.modes(bundle), f"{body}: {mode_sheet.range_text(bundle)}", play=True)
        for body, bundle in _bodies(shown).items()
    ]
    return {"modes.html": shown.page("modes", views)}


def _mode_gltf(shown: Shown, kind: str) -> dict[str, bytes]:
    return {
        f"modes_{body}.glb": gltf.modes(body, bundle, player.scales(bundle)) for body, bundle in _bodies(shown).items()
    }


def _mode_series(shown: Shown, kind: str) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for body, bundle in _bodies(shown).items():
        files |= paraview.modes(f"modes_{body}", bundle, player.scales(bundle))
    return files


def _joints(shown: Shown) -> dict[int, str]:
    """Return joints with clearance by their columns among the contacts."""
    joints = panel.contacts_with_clearance(shown.of_run)
    if not joints:
        raise InputError("--what joint", "the scene has no joint with clearance", "show its motion")
    return {k: str(shown.of_run["contact"].values[k]) for k in joints}


def _joint_figures(shown: Shown, kind: str) -> dict[str, bytes]:
    _joints(shown)
    with style.set_style():
        return figures.contacts(shown.of_run, derive(shown.of_run), shown.watched)


def _joint_page(shown: Shown, kind: str) -> dict[str, bytes]:
    """Return a page with each joint's ball or pin in its socket, and their curves below."""
    views = [
        viewer(player.joint(shown.of_run, k, shown.looks), f"{name}: path of the centre")
        for k, name in _joints(shown).items()
    ]
    words = "Path of the ball or pin in its socket, the gap, and the normal force over time"
    curves = media("contacts.png", _joint_figures(shown, kind)["contacts.png"], "Over time", words)
    return {"joint.html": shown.page("joints with clearance", views, curves)}


def _joint_films(shown: Shown, kind: str) -> dict[str, bytes]:
    files, rate = {}, film_speed.pictures_per_second(kind)
    for k, name in _joints(shown).items():
        pictures = panel.joint_frames(shown.of_run, k, shown.looks.duration, shown.looks.impact_slowdown, rate)
        suffix, content = film_speed.write(pictures, rate, kind)
        files[f"joint_{name}.{suffix}"] = content
    return files


def _vibrating_mechanism(shown: Shown) -> tuple[Mechanism, vibrations.Vibrations]:
    """Return the mechanism at rest, and its vibrations about that pose."""
    assert shown.linear is not None
    if not bool((shown.linear["frequency"] > 0.0).any()):
        raise InputError("--what vibrations", "the mechanism has no vibration in this pose")
    drawn = mechanism(vibrations.as_run(shown.linear), shown.bundles, shown.looks)
    return drawn, vibrations.vibrations(drawn, shown.linear)


def _vibration_page(shown: Shown, kind: str) -> dict[str, bytes]:
    drawn, vibrating = _vibrating_mechanism(shown)
    view = viewer(player.vibrations(drawn, vibrating), f"{len(vibrating.labels)} natural vibrations", play=True)
    return {"vibrations.html": shown.page("natural vibrations", [view])}


def _vibration_sheet(shown: Shown, kind: str) -> dict[str, bytes]:
    _must_draw()
    return {"vibrations.png": png(vibrations.sheet(*_vibrating_mechanism(shown)))}


def _draw_vibrations(shown: Shown, kind: str) -> dict[str, bytes]:
    _must_draw()
    rate = film_speed.pictures_per_second(kind)
    suffix, content = film_speed.write(
        vibrations.frames(*_vibrating_mechanism(shown), rate, shown.progress), rate, kind
    )
    return {f"vibrations.{suffix}": content}


#: functions by subject and format
MAKERS: dict[str, dict[str, Maker]] = {
    "motion": {
        "png": _still,
        "gif": _film,
        "mp4": _film,
        "html": _motion_page,
        "gltf": _motion_gltf,
        "pvd": _motion_series,
    },
    "stress": {
        kind: partial(make, stressed=True)
        for kind, make in {"png": _still, "gif": _film, "mp4": _film, "html": _motion_page}.items()
    },
    "modes": {
        "png": _mode_sheets,
        "gif": _mode_films,
        "mp4": _mode_films,
        "html": _mode_page,
        "gltf": _mode_gltf,
        "pvd": _mode_series,
    },
    "joint": {"png": _joint_figures, "gif": _joint_films, "mp4": _joint_films, "html": _joint_page},
    "vibrations": {"png": _vibration_sheet, "gif": _draw_vibrations, "mp4": _draw_vibrations, "html": _vibration_page},
}
