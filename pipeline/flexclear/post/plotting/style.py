"""One look for all plots, and files whose bytes depend on the data only."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

INK, SOFT, GRID = "#222222", "#6b6b6b", "#e3e3e3"
#: letters per inch of a line of a heading
TITLE_LETTERS, SUBTITLE_LETTERS = 9.4, 14.0

RC: dict[str, Any] = {
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titlecolor": INK,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "lines.solid_joinstyle": "round",
    "agg.path.chunksize": 20000,
    "svg.hashsalt": "flexclear",
    "svg.fonttype": "path",
}


@contextmanager
def set_style() -> Iterator[None]:
    """Set Matplotlib to this project's look, whatever the user's settings are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(cast(Any, RC))
        yield


def files(name: str, figure: Figure) -> dict[str, bytes]:
    """Return the figure as ``name.png`` and ``name.svg``, without dates or versions, and close it."""
    result = {}
    # the layout is solved once and then fixed; else each format would solve it again, and draw once more for that
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
    with mpl.rc_context({"figure.constrained_layout.use": False}):
        figure.set_layout_engine(None)
        for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None, "Creator": None})):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, metadata=metadata, facecolor="white")
            result[f"{name}.{kind}"] = buffer.getvalue()
    plt.close(figure)
    return result


def canvas(size: tuple[int, int], **options: Any) -> FigureCanvasAgg:
    """Return a canvas with a figure of so many pixels (width, height); `pixels` returns its picture."""
    return FigureCanvasAgg(Figure(figsize=(size[0] / 100, size[1] / 100), dpi=100, **options))


def pixels(drawn: FigureCanvasAgg) -> np.ndarray:
    """Return the picture of a canvas as bytes, shape (height, width, 3)."""
    return np.asarray(drawn.buffer_rgba())[:, :, :3].copy()


def grid(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure and its axes, always as a 2-D array."""
    return plt.subplots(rows, columns, figsize=size, squeeze=False, **options)


def panels(
    count: int, columns: int, width: float, above: float, height: float, **options: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure and the axes of its panels, row by row; above: height of the figure minus its rows (inches)."""
    rows = -(-count // columns)
    figure, axes = grid(rows, columns, (width, above + height * rows), **options)
    for left in axes.flat[count:]:
        left.set_visible(False)
    return figure, list(axes.flat[:count])


def mark_only_zero(axes: Axes) -> None:
    """Mark only 0 on the upright axis where all lines are zero: its range would be made up."""
    if not any(np.any(np.nan_to_num(np.asarray(line.get_ydata(), dtype=float))) for line in axes.lines):
        axes.set(ylim=(-1.0, 1.0), yticks=[0.0])


def scale_of(axes: Axes) -> str:
    """Return the scale for errors: logarithmic where a line of the axes has a positive value, else linear."""
    values = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    return "log" if any((value > 0.0).any() for value in values) else "linear"


def set_plain_numbers(axis: Axis) -> None:
    """Set plain numbers at 1, 2 and 5 of a logarithmic axis: less than a decade has hardly any power of ten.

    Longer ranges have numbers only at powers of ten, since the others would overlap.
    """

    def written(value: float, _: int | None) -> str:
        low, high = axis.get_view_interval()
        power = bool(np.isclose(np.log10(value) % 1.0, (0.0, 1.0), atol=1e-6).any())
        # 2.2: decades of a logarithmic axis that have space for numbers between the powers of ten
        return f"{value:g}" if power or abs(np.log10(high / low)) < 2.2 else ""

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(written))
    axis.set_minor_formatter(NullFormatter())


def heading(figure: Figure, title: str, subtitle: str = "") -> None:
    """Add a title at the left, and a softer text below; both in as many lines as the width requires."""
    width = figure.get_figwidth()
    lines = textwrap.wrap(title, round(TITLE_LETTERS * width))
    below = textwrap.wrap(subtitle, round(SUBTITLE_LETTERS * width))
    # the layout reserves space for the title's lines: empty ones are for the text below
    text = "\n".join([*lines, *("" for _ in below)])
    figure.suptitle(text, x=0.012, ha="left", fontsize=11.5, fontweight="bold", color=INK, parse_math=False)
    if below:
        top = 0.995 - (0.07 + 0.2 * len(lines)) / figure.get_figheight()
        figure.text(0.012, top, "\n".join(below), ha="left", va="top", fontsize=8.6, color=SOFT)


def shared_legend(figure: Figure, axes: Axes, columns: int, faint: str = "") -> None:
    """Add one legend below all panels, from the labelled lines of `axes`; faint: label of the unchanged line."""
    handles, labels = axes.get_legend_handles_labels()
    legend = figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=8.8, handlelength=2.4)
    for line in legend.get_lines():
        line.set_linewidth(2.2)
        if line.get_label() != faint:
            line.set_alpha(1.0)
