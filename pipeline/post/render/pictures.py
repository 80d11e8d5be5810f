"""What is made of a run, its reduced bodies and its vibrations: pictures, films, pages, files for other programs."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import xarray as xr

from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.post.overview.page import media, viewer_page
from flexclear.pipeline.post.pages import viewer
from flexclear.pipeline.post.plotting import mode_sheet
from flexclear.pipeline.post.render import gl, gltf, joint_view, pace, paraview, player, vibrations
from flexclear.pipeline.post.render.mechanism import Looks, Mechanism, mechanism
from flexclear.pipeline.post.single_run.series import derive

#: outputs of a series for ParaView, and of a glTF file
SERIES, KEYS = 100, 240


@dataclass(frozen=True)
class Shown:
    """What there is to be shown.

    run: schema RUN; linear: schema LINEAR; bundles: schema BUNDLE by name of the flexible body.  watched,
    curves: as of `film.film`.  title: of pages.
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
        """The run as moving solids; stressed: coloured by von Mises stress."""
        assert self.run is not None
        return mechanism(self.run, self.bundles, self.looks, stressed=stressed)

    def name(self, what: str) -> str:
        """A title of a page."""
        return f"{self.title}: {what}" if self.title else what


def make(what: str, kind: str, shown: Shown) -> dict[str, bytes]:
    """File contents by name.  Raises InputError where `what` cannot be shown so, or the scene has no such thing."""
    return MAKERS[what][kind](shown)


def formats(what: str) -> tuple[str, ...]:
    """As what something can be shown."""
    return tuple(MAKERS[what])


def needs_gl(what: str, kind: str) -> bool:
    """Whether the machine must be able to draw solids for that."""
    return what in ("motion", "stress", "vibrations") and kind in ("png", "gif", "mp4")


def png(pixels: np.ndarray) -> bytes:
    """PNG file of pixels of shape (height, width, 3)."""
    from matplotlib.image import imsave

    buffer = io.BytesIO()
    imsave(buffer, np.ascontiguousarray(pixels), format="png", metadata=cast(Any, {"Software": None}))
    return buffer.getvalue()


def _still(shown: Shown) -> dict[str, bytes]:
    _must_draw()
    from flexclear.pipeline.post.render import film, ruler

    drawn = shown.mechanism()
    picture = ruler.annotated(film.still(drawn, _farthest(drawn.run)), drawn)
    return {"mechanism.png": png(picture)}


def _stress_still(shown: Shown) -> dict[str, bytes]:
    """When the largest stress of the run is largest."""
    _must_draw()
    from flexclear.pipeline.post.render import film, ruler

    drawn = shown.mechanism(stressed=True)
    step = int(np.argmax(drawn.run["von_mises_stress"].values.max(axis=1)))
    return {"stress.png": png(ruler.annotated(film.still(drawn, step, margin=ruler.BAR), drawn, ruler.BAR))}


def _film(kind: str, *, stressed: bool = False) -> Callable[[Shown], dict[str, bytes]]:
    def make_film(shown: Shown) -> dict[str, bytes]:
        _must_draw()
        from flexclear.pipeline.post.render import film

        drawn = shown.mechanism(stressed=stressed)
        suffix, content = film.film(drawn, derive(drawn.run), shown.watched, shown.progress, kind, shown.curves)
        return {f"{'stress' if stressed else 'film'}.{suffix}": content}

    return make_film


def _must_draw() -> None:
    """Before pyvista is imported: without GL libraries it ends the process."""
    if not gl.works():
        raise SolverError(f"no pictures of solids: {gl.remedy()}")


def _motion_page(shown: Shown) -> dict[str, bytes]:
    return {"motion.html": viewer_page(shown.name("motion"), [viewer(player.motion(shown.mechanism()), "Motion")])}


def _stress_page(shown: Shown) -> dict[str, bytes]:
    view = viewer(player.motion(shown.mechanism(stressed=True)), "Von Mises stress")
    return {"stress.html": viewer_page(shown.name("stress"), [view])}


def _motion_gltf(shown: Shown) -> dict[str, bytes]:
    drawn = shown.mechanism()
    count = drawn.run.sizes["time"]
    steps = np.unique(np.linspace(0, count - 1, KEYS).astype(int))
    time = drawn.run["time"].values
    slower = (shown.looks.duration or pace.SECONDS) / float(time[-1] - time[0])
    return {"motion.glb": gltf.motion(drawn, steps, slower)}


def _motion_series(shown: Shown) -> dict[str, bytes]:
    drawn = shown.mechanism()
    times = pace.pace(drawn.run, None, shown.looks.impact_slowdown).times
    times = times[np.unique(np.linspace(0, times.size - 1, SERIES).astype(int))]
    steps = np.unique(np.searchsorted(drawn.run["time"].values, times - 1e-12))
    return paraview.series(drawn, steps)


def _bodies(shown: Shown) -> Mapping[str, xr.Dataset]:
    if not shown.bundles:
        raise InputError("--what modes", "the scene has no flexible body, and so no modes", "show its motion")
    return shown.bundles


def _mode_sheets(shown: Shown) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for body, bundle in _bodies(shown).items():
        seen = player.side(bundle)
        files |= mode_sheet.files(f"modes_{body}", body, bundle, seen.direction, seen.up)
    return files


def _mode_films(kind: str) -> Callable[[Shown], dict[str, bytes]]:
    def make_films(shown: Shown) -> dict[str, bytes]:
        from flexclear.pipeline.post.render import writing

        files = {}
        for body, bundle in _bodies(shown).items():
            seen = player.side(bundle)
            suffix, content = writing.write(mode_sheet.frames(body, bundle, seen.direction, seen.up), 12, kind)
            files[f"modes_{body}.{suffix}"] = content
        return files

    return make_films


def _mode_page(shown: Shown) -> dict[str, bytes]:
    """The mode sets of all bodies next to each other."""
    views = [
        viewer(player.modes(bundle), f"{body}: {mode_sheet.range_text(bundle)}", play=True)
        for body, bundle in _bodies(shown).items()
    ]
    return {"modes.html": viewer_page(shown.name("modes"), views)}


def _mode_gltf(shown: Shown) -> dict[str, bytes]:
    return {
        f"modes_{body}.glb": gltf.modes(body, bundle, player.scales(bundle)) for body, bundle in _bodies(shown).items()
    }


def _mode_series(shown: Shown) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for body, bundle in _bodies(shown).items():
        files |= paraview.modes(f"modes_{body}", bundle, player.scales(bundle))
    return files


def _contacts(shown: Shown) -> list[str]:
    assert shown.run is not None
    if not joint_view.with_clearance(shown.run):
        raise InputError("--what joint", "the scene has no joint with clearance", "show its motion")
    return [str(name) for name in shown.run["contact"].values]


def _joint_figures(shown: Shown) -> dict[str, bytes]:
    from flexclear.pipeline.post.overview import figures
    from flexclear.pipeline.post.plotting import style

    _contacts(shown)
    assert shown.run is not None
    with style.style():
        return figures.contacts(shown.run, derive(shown.run), shown.watched)


def _joint_page(shown: Shown) -> dict[str, bytes]:
    """Each joint's ball or pin in its socket, and their curves below."""
    _contacts(shown)
    assert shown.run is not None
    views = [
        viewer(player.joint(shown.run, k, shown.looks), f"{shown.run['contact'].values[k]}: path of the centre")
        for k in joint_view.with_clearance(shown.run)
    ]
    curves = media(
        "contacts.png",
        _joint_figures(shown)["contacts.png"],
        "Over time",
        "Path of the ball or pin in its socket, the gap, and the normal force over time",
    )
    return {"joint.html": viewer_page(shown.name("joints with clearance"), views, curves)}


def _joint_films(kind: str) -> Callable[[Shown], dict[str, bytes]]:
    def make_films(shown: Shown) -> dict[str, bytes]:
        from flexclear.pipeline.post.render import joint_film, writing

        files = {}
        rate = writing.RATE if kind == "mp4" else writing.RATE // 2
        names = _contacts(shown)
        assert shown.run is not None
        for k in joint_view.with_clearance(shown.run):
            name = names[k]
            pictures = joint_film.frames(shown.run, k, shown.looks.duration, shown.looks.impact_slowdown, rate)
            suffix, content = writing.write(pictures, rate, kind)
            files[f"joint_{name}.{suffix}"] = content
        return files

    return make_films


def _vibrating(shown: Shown) -> tuple[Mechanism, vibrations.Vibrations]:
    """The mechanism at rest, and how it vibrates about that."""
    assert shown.linear is not None
    if not bool((shown.linear["frequency"] > 0.0).any()):
        raise InputError("--what vibrations", "the mechanism has no motion that vibrates in this pose")
    drawn = mechanism(vibrations.as_run(shown.linear), shown.bundles, shown.looks)
    return drawn, vibrations.vibrations(drawn, shown.linear)


def _vibration_page(shown: Shown) -> dict[str, bytes]:
    drawn, vibrating = _vibrating(shown)
    view = viewer(player.vibrations(drawn, vibrating), f"{len(vibrating.labels)} natural vibrations", play=True)
    return {"vibrations.html": viewer_page(shown.name("natural vibrations"), [view])}


def _vibration_sheet(shown: Shown) -> dict[str, bytes]:
    _must_draw()
    from flexclear.pipeline.post.render import vibration_film as film

    return {"vibrations.png": png(film.sheet(*_vibrating(shown)))}


def _vibration_film(kind: str) -> Callable[[Shown], dict[str, bytes]]:
    def make_film(shown: Shown) -> dict[str, bytes]:
        from flexclear.pipeline.post.render import writing

        _must_draw()
        from flexclear.pipeline.post.render import vibration_film as film

        rate = writing.RATE if kind == "mp4" else writing.RATE // 2
        pictures = film.frames(*_vibrating(shown), rate, shown.progress)
        suffix, content = writing.write(pictures, rate, kind)
        return {f"vibrations.{suffix}": content}

    return make_film


def _farthest(run: xr.Dataset) -> int:
    """The output at which the bodies are farthest from where they started."""
    return int(np.argmax(np.abs(run.position.values - run.position.values[:1]).sum(axis=(1, 2))))


#: what is shown, and as what
MAKERS: dict[str, dict[str, Callable[[Shown], dict[str, bytes]]]] = {
    "motion": {
        "png": _still,
        "gif": _film("gif"),
        "mp4": _film("mp4"),
        "html": _motion_page,
        "gltf": _motion_gltf,
        "pvd": _motion_series,
    },
    "stress": {
        "png": _stress_still,
        "gif": _film("gif", stressed=True),
        "mp4": _film("mp4", stressed=True),
        "html": _stress_page,
    },
    "modes": {
        "png": _mode_sheets,
        "gif": _mode_films("gif"),
        "mp4": _mode_films("mp4"),
        "html": _mode_page,
        "gltf": _mode_gltf,
        "pvd": _mode_series,
    },
    "joint": {
        "png": _joint_figures,
        "gif": _joint_films("gif"),
        "mp4": _joint_films("mp4"),
        "html": _joint_page,
    },
    "vibrations": {
        "png": _vibration_sheet,
        "gif": _vibration_film("gif"),
        "mp4": _vibration_film("mp4"),
        "html": _vibration_page,
    },
}
