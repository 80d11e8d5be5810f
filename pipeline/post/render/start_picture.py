"""The picture of a start pose: the drawn mechanism in the middle, its names in columns left and right of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render import film
from flexclear.pipeline.post.render.mechanism import Mechanism
from flexclear.pipeline.post.render.ruler import project, ruler
from flexclear.pipeline.post.render.start_view import LOAD, Mark, StartView

SIZE, MARGIN = (1600, 1000), 330
#: heights of lines of names [pixels]: with their details below, and without; where the columns begin and end
LINES, TOP, BOTTOM = (33.0, 17.0), 70.0, 90.0
#: letters of a detail that have room in a column
LETTERS = 56


def picture(seen: StartView, title: str) -> np.ndarray:
    """Pixels, shape (height, width, 3)."""
    width, height = SIZE
    canvas = style.canvas(SIZE)
    axes = canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.imshow(film.still(seen.drawn, 0, SIZE, MARGIN), extent=(0, width, height, 0), aspect="auto")
    with style.style():
        points = project(seen.drawn, np.array([mark.point for mark in seen.marks]).reshape(-1, 3), SIZE, MARGIN)
        shown = _columns(axes, seen.marks, points)
        axes.text(20, 26, title, fontsize=13, fontweight="bold", color=style.INK, va="center", parse_math=False)
        left_out = [] if shown == len(seen.marks) else [f"{shown} of {len(seen.marks)} names; the page has all"]
        notes = " · ".join([*seen.notes, *left_out])
        axes.text(20, 49, notes, fontsize=9.5, color=style.SOFT, va="center", parse_math=False)
        _directions(axes, seen.drawn, seen.gravity)
        ruler(axes, seen.drawn, SIZE, MARGIN)
    axes.set(xlim=(0, width), ylim=(height, 0))
    canvas.draw()
    return style.pixels(canvas)


def columns(points: np.ndarray, room: int) -> tuple[list[int], list[int]]:
    """Which names stand left and which right, each from top to bottom; the first `room` in each column, at most.

    points: of the names in the picture, shape (n, 2), those that matter most first.
    """
    recorded = list(range(min(len(points), 2 * room)))
    across = sorted(recorded, key=lambda k: (points[k, 0], k))
    half = (len(recorded) + 1) // 2
    middle = 0.5 * SIZE[0]
    # as many on either side as have room; a few more on one where they are
    count = int(np.clip(sum(points[k, 0] < middle for k in recorded), len(recorded) - room, room))
    count = count if abs(count - half) <= 0.25 * len(recorded) else half
    sides = across[:count], across[count:]
    return sorted(sides[0], key=lambda k: points[k, 1]), sorted(sides[1], key=lambda k: points[k, 1])


def _columns(axes: style.Axes, marks: Sequence[Mark], points: np.ndarray) -> int:
    """Draw the names and lines to their points; how many there was room for."""
    tall = SIZE[1] - TOP - BOTTOM
    line = LINES[0] if len(marks) <= 2 * int(tall / LINES[0]) else LINES[1]
    sides = columns(points, int(tall / line))
    for side, names in enumerate(sides):
        for y, k in zip(heights(points[names, 1], line, TOP, SIZE[1] - BOTTOM), names, strict=True):
            mark, right = marks[k], bool(side)
            x = SIZE[0] - MARGIN + 12 if right else MARGIN - 12
            align = "left" if right else "right"
            axes.plot([x + (-5 if right else 5), points[k, 0]], [y, points[k, 1]], color=mark.color, lw=0.7, alpha=0.6)
            axes.plot(*points[k], "o", ms=3.5, color=mark.color)
            axes.text(x, y, mark.text, fontsize=9.5, fontweight="bold", color=mark.color, ha=align, va="center",
                      parse_math=False)  # fmt: skip
            if line == LINES[0]:
                detail = mark.detail if len(mark.detail) <= LETTERS else f"{mark.detail[: LETTERS - 1]}…"
                axes.text(x, y + 14, detail, fontsize=7.8, color=style.SOFT, ha=align, va="center", parse_math=False)
    return sum(map(len, sides))


def heights(requested: np.ndarray, line: float, top: float, bottom: float) -> np.ndarray:
    """Heights as near to those that are requested (ascending) as lines of this height leave room; shape (n,)."""
    result = np.array(requested, dtype=float)
    for k in range(len(result)):
        result[k] = max(result[k], top + 0.5 * line if k == 0 else result[k - 1] + line)
    limit = bottom - 0.5 * line
    for k in reversed(range(len(result))):
        result[k] = min(result[k], limit)
        limit = result[k] - line
    return result


def _directions(axes: style.Axes, drawn: Mechanism, gravity: np.ndarray) -> None:
    """The world's axes and gravity, as they lie in the picture."""
    middle = drawn.cloud.mean(axis=0)
    ways = [(np.eye(3)[k], "xyz"[k], style.SOFT) for k in range(3)]
    size = float(np.linalg.norm(gravity))
    if size > 0.0:
        ways.append((gravity / size, f"gravity {size:.4g} m/s²", LOAD))
    for way, text, color in ways:
        origin = np.array([70.0, SIZE[1] - 75.0]) + (np.array([95.0, -20.0]) if color == LOAD else 0.0)
        ends = project(drawn, np.array([middle, middle + 1e-3 * drawn.size * way]), SIZE, MARGIN)
        unit = project(drawn, np.array([middle, middle + 1e-3 * drawn.size * drawn.view.up]), SIZE, MARGIN)
        arrow = 46.0 * (ends[1] - ends[0]) / float(np.linalg.norm(unit[1] - unit[0]))
        tip, beyond = origin + arrow, 11.0 / max(float(np.linalg.norm(arrow)), 11.0)
        if np.linalg.norm(arrow) > 4.0:
            head = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", (tip[0], tip[1]), (origin[0], origin[1]), arrowprops=head)
        else:
            axes.plot(*origin, "o", ms=6, mfc="none", color=color)
        x, y = tip + beyond * arrow
        if color == LOAD:
            axes.text(x + 6.0, y, text, fontsize=9.5, color=color, ha="left", va="center")
        else:
            axes.text(x, y, text, fontsize=9.5, color=color, ha="center", va="center")
