"""Figure 10."""

from __future__ import annotations

from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.text import Text

from flexclear.papers.wang_wang_2019.figures import Data, Figure
from flexclear.papers.wang_wang_2019.models import FAR_CSJ_CB
from flexclear.pipeline.post.plotting import style

#: boxes of the three columns: text, and the paper's step that it is
STRUCTURE = (
    ("recipe → mesh of beam elements", ""),
    ("modes under a reference condition,\nstatic shapes", "1"),
    ("inertia invariants and stiffness\nof the modes, stored in a bundle", "1"),
)
START = (
    ("joints → tree and closures,\nrigidly joined bodies merged", "2"),
    ("consistent start: closures and\ntheir rates to rounding", "2, 4"),
)
LOOP = (
    ("step of a chosen or given length:\ninertia, forces, closure forces", "7, 8"),
    ("error in the tolerance?\nelse the step again, shorter", ""),
    ("gap through zero within the step?\nthen the step ends there: mode and\nimpact rate change", "5, 6"),
    ("largest force and penetration,\nsticking: located, recorded", ""),
    ("closures beyond the tolerance?\nthen projected", "4"),
)
BLUE, GREEN, ORANGE = "#0072B2", "#009E73", "#E69F00"
#: where the boxes of the three parts are, from above, as fractions of the height; (b) is below (a)
ROWS = ((0.92, 0.72, 0.52), (0.28, 0.08), (0.92, 0.71, 0.49, 0.27, 0.08))


def make(data: Data) -> Drawing:
    """The boxes, with the counts of the paper's full model."""
    attributes = data[f"{FAR_CSJ_CB.scene}:run"].attrs
    figure, axes = style.grid(1, 2, (9.0, 5.2))
    left, right = axes.flat
    for panel, boxes, rows, color in zip(
        (left, left, right), (STRUCTURE, START, LOOP), ROWS, (BLUE, GREEN, ORANGE), strict=True
    ):
        drawn = _column(panel, boxes, rows, color)
    _arrow(right, drawn[-1], drawn[0], "bar,fraction=0.6")
    left.set_title("(a) once per flexible body")
    right.set_title("(c) step after step")
    left.text(0.0, 0.385, "(b) once per run", fontsize=left.title.get_fontsize(), fontweight="bold", color=style.INK)
    style.heading(
        figure,
        "Figure 10: contacts end steps where they begin and end; the paper looks at them at the ends of steps of 10 µs",
        f"next to the boxes: steps of the paper's section 6.1. {FAR_CSJ_CB.label}: {attributes['steps']} steps, "
        f"{attributes['evaluations']} evaluations, {attributes['projections']} projections",
    )
    return figure


def _column(axes: Axes, boxes: tuple[tuple[str, str], ...], rows: tuple[float, ...], color: str) -> list[Text]:
    """Boxes below each other, joined by arrows."""
    drawn = []
    for (text, step), y in zip(boxes, rows, strict=True):
        box = {"boxstyle": "round,pad=0.45", "fc": "white", "ec": color, "lw": 1.5}
        drawn.append(axes.text(0.5, y, text, ha="center", va="center", fontsize=9.0, color=style.INK, bbox=box))
        if step:
            message = f"step {step}" if step.isdigit() else f"steps {step}"
            axes.text(0.0, y, message, ha="left", va="center", fontsize=7.2, color=color, fontweight="bold")
    for first, second in pairwise(drawn):
        _arrow(axes, first, second, "arc3")
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.set_axis_off()
    return drawn


def _arrow(axes: Axes, first: Text, second: Text, way: str) -> None:
    """From the rim of a box to that of another."""
    look = {"arrowstyle": "-|>", "color": style.SOFT, "lw": 1.3, "connectionstyle": way, "shrinkA": 2, "shrinkB": 2}
    patches = {"patchA": first.get_bbox_patch(), "patchB": second.get_bbox_patch()}
    axes.annotate("", second.get_position(), first.get_position(), arrowprops=look | patches)


FIGURE = Figure(
    "Figure 10: how the dynamics are computed, next to the paper's steps 1 to 9",
    ("sps4/far_csj_cb:run",),
    make,
)
