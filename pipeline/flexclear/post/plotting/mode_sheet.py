"""All modes of a body on one sheet: shape, frequency, exaggeration; as a picture or a film."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from flexclear.post.plotting import style
from flexclear.post.plotting.drawing import View, shell, skin, view
from flexclear.post.plotting.style import SOFT
from flexclear.post.shapes.body_shape import AROUND, faces, hertz, is_rod, scale_to, surface

#: number of modes in a row, and drawn size of the largest displacement as a fraction of the body's length
COLUMNS, FRACTION = 3, 0.14
#: stride of the drawn points around a rod: a sheet shows its modes small
EVERY = 2
#: pictures of one vibration in a film
FRAMES = 16


def files(name: str, body: str, bundle: xr.Dataset, towards: np.ndarray, up: np.ndarray) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``<name>.svg`` of all modes of a body (schema BUNDLE), seen from a direction."""
    with style.style():
        return style.files(name, _sheet(body, bundle, view(towards, up), 1.0))


def film_frames(body: str, bundle: xr.Dataset, towards: np.ndarray, up: np.ndarray) -> Iterator[np.ndarray]:
    """Yield pictures of one vibration of all modes, shape (height, width, 3)."""
    with style.style():
        camera = view(towards, up)
        drawn: dict[float, np.ndarray] = {}  # both halves of a swing look alike
        for phase in np.linspace(0.0, 2.0 * np.pi, FRAMES, endpoint=False):
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
        rings = points.reshape(-1, AROUND + 1, 3)[:, ::EVERY]
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
    text = hertz(float(bundle["frequency"].values[mode]))
    panel.set_title(f"mode {mode + 1}: {text}, × {factor:.2g} √kg m", fontsize=8.8)
