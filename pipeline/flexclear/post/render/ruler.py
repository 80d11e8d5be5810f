"""Lengths in a picture: projection of points of the world, and a bar of a round length."""

from __future__ import annotations

import numpy as np

from flexclear.post.overview.curves import format_to_digits, in_unit, readable_unit
from flexclear.post.plotting import style
from flexclear.post.render.mechanism import SOCKET, Mechanism
from flexclear.post.render.view import ANGLE, axes_of, eye
from flexclear.post.single_run.series import parameters

#: colours of stress, and the width at either side of a picture for the bar of these colours [pixels]
STRESS_COLORS, BAR = "turbo", 100


def project(drawn: Mechanism, points: np.ndarray, size: tuple[int, int], margin: int = 0) -> np.ndarray:
    """Return pixels (across, down) of points of the world (n, 3) in a picture as of `film.still`, shape (n, 2)."""
    width, height = size
    where, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    local = (points - where) @ axes_of(drawn.view, where, focus)
    scale = -0.5 * height / np.tan(0.5 * np.radians(ANGLE)) / local[:, 2]
    return np.column_stack([0.5 * width + scale * local[:, 0], 0.5 * height - scale * local[:, 1]])


def pixels_per_metre(drawn: Mechanism, size: tuple[int, int], margin: int = 0) -> float:
    """Return the scale in the plane through the focus, across the line of sight [pixels/m]."""
    width, height = size
    where, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    return float(0.5 * height / np.tan(0.5 * np.radians(ANGLE)) / np.linalg.norm(where - focus))


def round_length(most: float) -> float:
    """Return the longest of 1, 2 or 5 times a power of ten that is not above `most`."""
    ten = 10.0 ** np.floor(np.log10(most))
    return float(max(k * ten for k in (1.0, 2.0, 5.0) if k * ten <= most * (1.0 + 1e-12)))


def exaggeration(drawn: Mechanism) -> list[str]:
    """Return sentences on exaggerated parts with their factors, and on the colours of deflection."""
    scale = max((body.scale for body in drawn.flexible), default=0.0)
    larger = "true deformation" if scale == 1.0 else f"deformation {format_to_digits(scale, 3)} times larger"
    texts = [larger] if drawn.flexible else []
    if any(body.color is None and not body.stressed for body in drawn.flexible):
        texts.append("brightest at the largest deflection of a body")
    factors = []
    for joint in parameters(drawn.run).get("joint", {}).values():
        radius = joint.get("ball_radius", joint.get("pin_radius"))
        if joint.get("clearance") and radius:
            factors.append((SOCKET - 1.0) * float(radius) / float(joint["clearance"]))
    if factors:
        low, high = (format_to_digits(value, 2) for value in (min(factors), max(factors)))
        texts.append(f"clearances drawn {low if low == high else f'{low} to {high}'} times larger")
    return texts


def with_scale_bar(pixels: np.ndarray, drawn: Mechanism, margin: int = 0) -> np.ndarray:
    """Return a picture as of `film.still` with a bar and the factors of exaggeration, same shape."""
    height, width = pixels.shape[:2]
    if drawn.stress is not None:
        pixels = with_color_bar(pixels.copy(), color_bar(drawn.stress, height))
    canvas = style.canvas((width, height))
    axes = canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.imshow(pixels, extent=(0, width, height, 0), aspect="auto", interpolation="nearest")
    if texts := exaggeration(drawn):
        pale = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 3.0}
        text = axes.text(20, height - 18, "\n".join(texts), va="bottom", bbox=pale, parse_math=False)
        text.set(fontsize=10.5, color=style.SOFT)
    ruler(axes, drawn, (width, height), margin)
    axes.set(xlim=(0, width), ylim=(height, 0))
    canvas.draw()
    return style.pixels(canvas)


def color_bar(largest: float, height: int) -> np.ndarray:
    """Return the colours of stress from zero to the largest [Pa], with numbers: pixels (height, BAR, 3)."""
    factor, unit = readable_unit(largest, "Pa")
    canvas = style.canvas((BAR, height))
    axes = canvas.figure.add_axes((0.16, 0.25, 0.16, 0.5))
    axes.imshow(np.linspace(1.0, 0.0, 256)[:, None], aspect="auto", cmap=STRESS_COLORS, extent=(0.0, 1.0, 0.0, 1.0))
    ticks = np.linspace(0.0, 1.0, 5)
    axes.yaxis.tick_right()
    axes.set(xticks=[], yticks=ticks, yticklabels=[f"{t * factor * largest:.3g}" for t in ticks])
    axes.tick_params(labelsize=9, length=2)
    canvas.figure.text(0.16, 0.77, f"von Mises\nstress ({unit})", fontsize=9, va="bottom")
    canvas.draw()
    return style.pixels(canvas)


def with_color_bar(pixels: np.ndarray, bar: np.ndarray) -> np.ndarray:
    """Add a bar at the left edge of a picture, in place, where nothing else is drawn."""
    pixels[:, : bar.shape[1]] = np.minimum(pixels[:, : bar.shape[1]], bar)
    return pixels


def ruler(axes: style.Axes, drawn: Mechanism, size: tuple[int, int], margin: int = 0) -> None:
    """Draw a bar of a round length at the lower right; the axes count pixels from the upper left."""
    scale = pixels_per_metre(drawn, size, margin)
    # 190.0: longest bar [pixels]
    metres = round_length(190.0 / scale)
    end, y, half = size[0] - 24.0, size[1] - 30.0, 4.0
    start = end - metres * scale
    axes.plot(
        [start, start, start, end, end, end], [y - half, y + half, y, y, y - half, y + half], color=style.INK, lw=1.6
    )
    axes.text(
        0.5 * (start + end), y - 13.0, in_unit(metres, "m"), fontsize=9.5, color=style.INK, ha="center", va="center"
    )
