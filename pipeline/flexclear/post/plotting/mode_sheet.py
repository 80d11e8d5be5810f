"""All modes of a body on one sheet: shape, frequency, exaggeration; as a picture or a film, drawn as vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure

from flexclear.post.body_shape import AROUND, circle, faces, format_frequency, is_rod, scale_to, surface
from flexclear.post.plotting import style
from flexclear.post.plotting.style import INK, SOFT

#: direction to the light in the observer's axes: from above the left shoulder
LIGHT = np.array([-0.35, 0.65, 0.68])
AMBIENT = 0.45


@dataclass(frozen=True, slots=True)
class View:
    """A parallel projection: unit vectors to the right, upwards and to the observer, rows of `axes`, shape (3, 3)."""

    axes: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on the paper of points (..., 3), shape (..., 2)."""
        return points @ self.axes[:2].T

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinate of points towards the observer, shape (...)."""
        return points @ self.axes[2]


def view(towards: np.ndarray, up: np.ndarray) -> View:
    """Return the view of an observer in direction `towards`; `up` is upwards on the paper."""
    towards_eye = towards / np.linalg.norm(towards)
    right = np.cross(up, towards_eye)
    right /= np.linalg.norm(right)
    return View(np.array([right, np.cross(towards_eye, right), towards_eye]))


def shell(
    axes: Axes, camera: View, rings: np.ndarray, values: np.ndarray | None, color: str = "#9aa5b1", **look: Any
) -> None:
    """Draw a closed tube of rings (ring, around, 3), whose first and last points coincide.

    values: one per ring in [0, 1], drawn as colours; without them the tube has one colour.
    """
    index = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    faces = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    shades = None if values is None else np.repeat(values, rings.shape[1])
    skin(axes, camera, rings.reshape(-1, 3), faces, shades, color, closed=True, **look)


def skin(
    axes: Axes,
    camera: View,
    points: np.ndarray,
    faces: np.ndarray,
    values: np.ndarray | None,
    color: str = "#9aa5b1",
    *,
    closed: bool = False,
    **look: Any,
) -> None:
    """Draw faces (m, corners) between points (n, 3), the near ones over the far ones.

    values: one per point in [0, 1], drawn as colours.  closed: True when all faces have the same orientation, so that
    those at the back are left out; else either side of a face may be the outer one.
    """
    corners = points[faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    size = np.linalg.norm(normal, axis=1)
    volume = float(np.sum((corners.mean(axis=1) - points.mean(axis=0)) * normal))
    outward = normal / np.where(size > 0.0, size, 1.0)[:, None] @ camera.axes.T * (1.0 if volume >= 0.0 else -1.0)
    shown = (size > 0.0) & (outward[:, 2] > 0.0 if closed else True)
    light = LIGHT / np.linalg.norm(LIGHT)
    lit = outward[shown] @ light if closed else np.abs(outward[shown]) @ np.abs(light)
    corners, faces = corners[shown], faces[shown]
    base = np.array(to_rgb(color)) if values is None else colormaps["viridis"](values[faces].mean(axis=1))[:, :3]
    colors = np.clip(base * (AMBIENT + (1.0 - AMBIENT) * np.clip(lit, 0.0, 1.0))[:, None], 0.0, 1.0)
    order = np.argsort(camera.depth(corners).mean(axis=1), kind="stable")
    # edges of the faces' own colour close the gaps between them, but would show through where they are translucent
    edges = {"edgecolors": colors[order], "lw": 0.3} if "alpha" not in look else {"edgecolors": "none"}
    axes.add_collection(PolyCollection(list(camera.project(corners)[order]), facecolors=colors[order], **edges, **look))


def tube(start: np.ndarray, end: np.ndarray, radius: float, around: int = 24) -> np.ndarray:
    """Return the rings of a straight round bar with flat ends, for `shell`, shape (4, around + 1, 3)."""
    ring = radius * circle(end - start, around)
    return np.stack([start + 0.0 * ring, start + ring, end + ring, end + 0.0 * ring])


def triad(axes: Axes, camera: View, origin: np.ndarray, length: float, names: tuple[str, str, str]) -> None:
    """Draw the three axes of a frame as arrows with names."""
    start = camera.project(origin)
    for direction, name in zip(np.eye(3), names, strict=True):
        end = camera.project(origin + length * direction)
        axes.annotate(
            "",
            (end[0], end[1]),
            (start[0], start[1]),
            arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.1},
            zorder=9,
        )
        axes.annotate(
            name, end + 0.16 * (end - start), ha="center", va="center", fontsize=8.5, color=INK, annotation_clip=False
        )


#: number of modes in a row, and drawn size of the largest displacement as a fraction of the body's length
COLUMNS, FRACTION = 3, 0.14


def files(name: str, body: str, bundle: xr.Dataset, towards: np.ndarray, up: np.ndarray) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``<name>.svg`` of all modes of a body (schema BUNDLE), seen from a direction."""
    with style.set_style():
        return style.files(name, _sheet(body, bundle, view(towards, up), 1.0))


def film_frames(body: str, bundle: xr.Dataset, towards: np.ndarray, up: np.ndarray) -> Iterator[np.ndarray]:
    """Yield pictures of one vibration of all modes, shape (height, width, 3)."""
    with style.set_style():
        camera = view(towards, up)
        drawn: dict[float, np.ndarray] = {}  # both halves of a swing look alike
        # 16: pictures of one vibration in a film
        for phase in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
            fraction = round(float(np.sin(phase)), 6)
            if fraction not in drawn:
                drawn[fraction] = _pixels(_sheet(body, bundle, camera, fraction))
            yield drawn[fraction]


def range_text(bundle: xr.Dataset) -> str:
    """Return the number and kind of the modes, in words."""
    kind = str(bundle.attrs.get("reference", ""))
    return f"{bundle.sizes['mode']} modes{f', {kind}' if kind else ''}"


def _pixels(figure: Figure) -> np.ndarray:
    """Return a figure as pixels, and close it."""
    figure.set_dpi(80)
    drawn = FigureCanvasAgg(figure)
    drawn.draw()
    plt.close(figure)
    pixels = style.pixels(drawn)
    # films need even numbers of pixels
    return pixels[: len(pixels) // 2 * 2, : pixels.shape[1] // 2 * 2]


def _sheet(body: str, bundle: xr.Dataset, camera: View, fraction: float) -> Figure:
    count = bundle.sizes["mode"]
    rest, _ = surface(bundle, np.zeros(count))
    projected = camera.project(rest)
    span = np.ptp(projected, axis=0)
    ratio = float(np.clip((span[1] + 2.2 * FRACTION * span.max()) / (span[0] + 0.1 * span.max()), 0.25, 1.6))
    width = 11.0
    figure, axes = style.panels(count, COLUMNS, width, 1.1, 0.35 + ratio * width / COLUMNS * 0.92)
    for k, panel in enumerate(axes):
        _mode(panel, bundle, camera, k, fraction, rest)
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, 1.0), "viridis"), ax=figure.axes, shrink=0.6, pad=0.01, aspect=30
    )
    bar.set_label("displacement, largest = 1")
    style.heading(
        figure,
        f"{body}: {range_text(bundle)}",
        "mass-normalised shapes (in kg^-1/2) times the factor next to each; dashed: at rest",
    )
    return figure


def _mode(panel: style.Axes, bundle: xr.Dataset, camera: View, mode: int, fraction: float, rest: np.ndarray) -> None:
    q = np.zeros(bundle.sizes["mode"])
    q[mode] = 1.0
    factor = scale_to(bundle, q, FRACTION)
    points, size = surface(bundle, q, fraction * factor)
    moved = size if size.max() > 1e-9 * np.ptp(rest) else np.linalg.norm(points - rest, axis=1)
    full, sizes = surface(bundle, q, factor)
    # by its centre line, or by its skin where that line rests
    skin_moves = sizes.max() <= 1e-9 * np.ptp(rest)
    largest = float(np.linalg.norm(full - rest, axis=1).max()) if skin_moves else max(float(sizes.max()), 1e-300)
    index = faces(bundle)
    share_of = np.clip(moved / largest, 0.0, 1.0)
    if is_rod(bundle):
        # 2: stride of the drawn points around a rod: a sheet shows its modes small
        rings = points.reshape(-1, AROUND + 1, 3)[:, ::2]
        shell(panel, camera, rings, share_of.reshape(-1, AROUND + 1)[:, 0], zorder=2)
    elif index.shape[1] >= 3:
        skin(panel, camera, points, index, share_of, zorder=2)
    else:
        x, y = camera.project(points).T
        panel.scatter(x, y, c=moved / largest, cmap="viridis", vmin=0.0, vmax=1.0, s=9)
    line = camera.project(rest if not is_rod(bundle) else bundle["node_position"].values)
    panel.plot(*line.T, color=SOFT, lw=0.8 if is_rod(bundle) else 0.0, ls="--", zorder=3)
    both = np.concatenate([camera.project(surface(bundle, q, sign * factor)[0]) for sign in (1.0, -1.0)] + [line])
    low, high = both.min(axis=0), both.max(axis=0)
    edge = 0.03 * float((high - low).max())
    panel.set(xlim=(low[0] - edge, high[0] + edge), ylim=(low[1] - edge, high[1] + edge), aspect="equal")
    panel.set_axis_off()
    text = format_frequency(float(bundle["frequency"].values[mode]))
    panel.set_title(f"mode {mode + 1}: {text}, × {factor:.2g} √kg m", fontsize=8.8)
