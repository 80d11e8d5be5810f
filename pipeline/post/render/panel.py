"""The plots that run beside a film: drawn once, then only the moving marks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from pipeline.post.models import MODELS, PLATFORM
from pipeline.post.plotting import style

#: of scenes that are none of the paper's models
OTHER = "#0072B2"


@dataclass(frozen=True, slots=True)
class Panel:
    """A figure whose still part is kept as pixels; `cursors` are (dot, x, y) and `clock` shows the time."""

    canvas: FigureCanvasAgg
    background: Any
    cursors: tuple[tuple[Any, np.ndarray, np.ndarray], ...]
    clock: Any
    time: np.ndarray  #: [s]

    def frame(self, step: int) -> np.ndarray:
        """Pixels at one output, shape (height, width, 3)."""
        self.canvas.restore_region(self.background)
        for dot, x, y in self.cursors:
            dot.set_data([x[step]], [y[step]])
            dot.axes.draw_artist(dot)
        self.clock.set_text(f"t = {1e3 * self.time[step]:.1f} ms")
        self.canvas.figure.draw_artist(self.clock)
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()


def panel(run: xr.Dataset, post: xr.Dataset, size: tuple[int, int]) -> Panel:
    """Plots of one run: the watched body's motion, the reaction, and the ball in its socket where there is one."""
    contact = "contact" in run.sizes
    canvas = FigureCanvasAgg(
        Figure(figsize=(size[0] / 100, size[1] / 100), dpi=100, layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.1))
    )
    figure = canvas.figure
    axes = figure.subplots(3 if contact else 2, 1, height_ratios=[1, 1, 1.7] if contact else [1, 1])
    cursors = [_motion(axes[0], run, post), (_reaction if post.sizes["joint"] else _energy)(axes[1], run, post)]
    if contact:
        cursors.append(_socket(axes[2], run, post))
    figure.suptitle(" ", fontsize=13)  # keeps the place of the clock
    clock = figure.text(
        0.5, 0.972, "", ha="center", va="center", fontsize=13, fontweight="bold", color=style.INK, animated=True
    )
    canvas.draw()
    return Panel(canvas, canvas.copy_from_bbox(figure.bbox), tuple(cursors), clock, run.time.values)


def watched(run: xr.Dataset) -> int:
    """The platform where there is one, else the body that moves farthest."""
    names = [str(body) for body in run.body.values]
    if PLATFORM in names:
        return names.index(PLATFORM)
    way = np.linalg.norm(run.position.values - run.position.values[:1], axis=-1)
    return int(np.argmax(way.max(axis=0)))


def _motion(axes: style.Axes, run: xr.Dataset, post: xr.Dataset) -> tuple[Any, np.ndarray, np.ndarray]:
    body = watched(run)
    angle = np.degrees(post.rotation.values[:, body])
    axes.set_title(f"{run.body.values[body]}: rotation (°)")
    return _curve(axes, run, angle, _color(run))


def _reaction(axes: style.Axes, run: xr.Dataset, post: xr.Dataset) -> tuple[Any, np.ndarray, np.ndarray]:
    name = str(run.contact.values[0]) if "contact" in run.sizes else str(post.joint.values[0])
    force = post.reaction.sel(joint=name).values
    kind = "contact force" if "contact" in run.sizes else "reaction"
    axes.set_title(f"{name}: {kind} (N)")
    return _curve(axes, run, force, _color(run), 0.8)


def _energy(axes: style.Axes, run: xr.Dataset, post: xr.Dataset) -> tuple[Any, np.ndarray, np.ndarray]:
    """Instead of a reaction, where there is no joint."""
    axes.set_title("kinetic energy (J)")
    return _curve(axes, run, run.kinetic.values, _color(run))


def _color(run: xr.Dataset) -> str:
    """The colour that the model of the run has in all figures; one of its own for other scenes."""
    return next((m.color for m in MODELS if m.scene == run.attrs.get("scene")), OTHER)


def _curve(
    axes: style.Axes, run: xr.Dataset, values: np.ndarray, color: str, width: float = 1.6
) -> tuple[Any, np.ndarray, np.ndarray]:
    time = 1e3 * run.time.values
    axes.plot(time, values, color=color, lw=width)
    axes.set(xlabel="time (ms)", xlim=(time[0], time[-1]))
    (dot,) = axes.plot([], [], "o", color=style.INK, ms=6, animated=True)
    return dot, time, values


def _socket(axes: style.Axes, run: xr.Dataset, post: xr.Dataset) -> tuple[Any, np.ndarray, np.ndarray]:
    x, y = 1e3 * run.contact_offset.values[:, 0, 0], 1e3 * run.contact_offset.values[:, 0, 2]
    radius = 1e3 * float(post.clearance[0])
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.fill(radius * np.cos(turn), radius * np.sin(turn), color="#f3f3f3", ec="#a8a8a8", lw=1.0)
    axes.plot(x, y, color=_color(run), lw=0.5, alpha=0.7)
    axes.set_title("ball centre in the socket (mm)")
    axes.set(
        xlabel="x",
        ylabel="z",
        aspect="equal",
        xlim=(-1.15 * radius, 1.15 * radius),
        ylim=(-1.15 * radius, 1.15 * radius),
    )
    (dot,) = axes.plot([], [], "o", color=style.INK, ms=7, animated=True)
    return dot, x, y
