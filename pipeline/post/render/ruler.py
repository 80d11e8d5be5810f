"""How long things in a picture are: where points of the world are in it, and a bar of a round length."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render.mechanism import Mechanism
from flexclear.pipeline.post.render.view import ANGLE, eye

#: longest bar [pixels]
LONGEST = 190.0


def project(drawn: Mechanism, points: np.ndarray, size: tuple[int, int], margin: int = 0) -> np.ndarray:
    """Pixels (across, down) of points of the world (n, 3) in a picture as of `film.still`, shape (n, 2)."""
    width, height = size
    where, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    close = (where - focus) / np.linalg.norm(where - focus)
    right = np.cross(drawn.view.up, close)
    right /= np.linalg.norm(right)
    local = (points - where) @ np.column_stack([right, np.cross(close, right), -close])
    scale = 0.5 * height / np.tan(0.5 * np.radians(ANGLE)) / local[:, 2]
    result: np.ndarray = np.column_stack([0.5 * width + scale * local[:, 0], 0.5 * height - scale * local[:, 1]])
    return result


def pixels_per_metre(drawn: Mechanism, size: tuple[int, int], margin: int = 0) -> float:
    """In the plane through the point that is examined, across the line of sight."""
    width, height = size
    where, focus = eye(drawn.view, drawn.cloud, (width - 2 * margin) / height, drawn.looks.zoom)
    return float(0.5 * height / np.tan(0.5 * np.radians(ANGLE)) / np.linalg.norm(where - focus))


def round_length(most: float) -> float:
    """The longest of 1, 2 or 5 times a power of ten that is not above `most`."""
    ten = 10.0 ** np.floor(np.log10(most))
    return float(max(k * ten for k in (1.0, 2.0, 5.0) if k * ten <= most * (1.0 + 1e-12)))


def words(value: float) -> str:
    """A length [m] in the unit in which it has few digits."""
    for unit, size in (("km", 1e3), ("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)):
        if abs(value) >= 0.9995 * size:
            return f"{value / size:.4g} {unit}"
    return f"{value:.3g} m"


def ruler(axes: style.Axes, drawn: Mechanism, size: tuple[int, int], margin: int = 0) -> None:
    """A bar of a round length at the lower right; the axes count pixels from the upper left."""
    scale = pixels_per_metre(drawn, size, margin)
    metres = round_length(LONGEST / scale)
    end, y, half = size[0] - 24.0, size[1] - 30.0, 4.0
    start = end - metres * scale
    axes.plot(
        [start, start, start, end, end, end], [y - half, y + half, y, y, y - half, y + half], color=style.INK, lw=1.6
    )
    axes.text(0.5 * (start + end), y - 13.0, words(metres), fontsize=9.5, color=style.INK, ha="center", va="center")
