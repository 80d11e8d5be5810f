"""Figure 10: how the dynamics are computed, next to the paper's steps 1 to 9."""

from __future__ import annotations

import xarray as xr
from matplotlib.axes import Axes

from flexclear.pipeline.post.models import FAR_CSJ_CB
from flexclear.pipeline.post.plotting import style

NEEDS = ("sps4/far_csj_cb:run",)

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


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig10.png and fig10.svg, with the counts of the paper's full model."""
    attributes = data[f"{FAR_CSJ_CB.scene}:run"].attrs
    with style.style():
        figure, axes = style.grid(1, 3, (12.0, 4.9))
        for panel, boxes, color, title in zip(
            axes.flat,
            (STRUCTURE, START, LOOP),
            (BLUE, GREEN, ORANGE),
            ("(a) once per flexible body", "(b) once per run", "(c) step after step"),
            strict=True,
        ):
            _column(panel, boxes, color)
            panel.set_title(title)
        _back(axes[0, 2])
        style.heading(
            figure,
            "Figure 10: contacts end steps where they begin and end; "
            "the paper looks at them at the ends of steps of 10 µs",
            f"next to the boxes: steps of the paper's section 6.1. {FAR_CSJ_CB.label}: {attributes['steps']} steps, "
            f"{attributes['evaluations']} evaluations, {attributes['projections']} projections",
        )
        return style.files("fig10", figure)


def _column(axes: Axes, boxes: tuple[tuple[str, str], ...], color: str) -> None:
    """Boxes below each other, joined by arrows."""
    height = 1.0 / len(boxes)
    for k, (text, step) in enumerate(boxes):
        y = 1.0 - (k + 0.5) * height
        axes.text(
            0.47, y, text, ha="center", va="center", fontsize=9.0, color=style.INK,
            bbox={"boxstyle": "round,pad=0.55", "fc": "white", "ec": color, "lw": 1.5},
        )  # fmt: skip
        if step:
            message = f"step {step}" if step.isdigit() else f"steps {step}"
            axes.text(0.0, y, message, ha="left", va="center", fontsize=7.2, color=color, fontweight="bold")
        if k + 1 < len(boxes):
            axes.annotate(
                "", (0.47, y - height + 0.062), (0.47, y - 0.062),
                arrowprops={"arrowstyle": "-|>", "color": style.SOFT, "lw": 1.3},
            )  # fmt: skip
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.set_axis_off()


def _back(axes: Axes) -> None:
    """From the last box to the first, along the side."""
    height = 1.0 / len(LOOP)
    axes.annotate(
        "", (0.86, 1.0 - 0.5 * height), (0.86, 0.5 * height),
        arrowprops={"arrowstyle": "-|>", "color": style.SOFT, "lw": 1.3, "connectionstyle": "bar,fraction=0.13"},
    )  # fmt: skip
