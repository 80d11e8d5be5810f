"""Figures 1, 3, 4 and 10: the mechanism, the mode shapes of its rod, and the algorithm of its dynamics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as Drawing
from matplotlib.text import Text

from flexclear.publishing import View, rod_surface, scale_to, shell, style, triad, tube, view
from papers.comparison import Data, Figure, drawn
from papers.wang_wang_2019.models import CSJ, FAR_CB, FAR_CSJ_CB, IDEAL, JOINT, parameters
from papers.wang_wang_2019.published import TABLE4_NORMAL_MODE, TABLE5_NORMAL_MODE

LEGS = (1, 2, 3, 4)
TOWARDS, UP = np.array([0.75, -1.35, 0.55]), np.array([0.0, 0.0, 1.0])
#: radii of the parts that follow from Table 1 [m]
CYLINDER, ROD, BALL = 0.02, 0.01, 0.02
#: offsets of the legs' names from the middle of their cylinders on the paper [m]
LABELS = {1: (0.07, 0.0), 2: (-0.065, 0.0), 3: (-0.055, 0.04), 4: (-0.07, 0.0)}
STEEL, ALUMINIUM, PLATE, BASE = "#5b7fa6", "#b9c2cc", "#c9a66b", "#dfe5ec"


@drawn(
    "Figure 1: structure of the 4-SPS/PS mechanism, with the names of its parts and the joint coordinates in use",
    "sps4/ideal:run",
)
def mechanism(data: Data) -> Drawing:
    """Draw the mechanism at its start, to scale, and its joints seen from above."""
    run = data[f"{IDEAL.scene}:run"]
    points = {str(name): run.frame_position.values[0, k] for k, name in enumerate(run.frame.values)}
    figure, axes = style.grid(1, 2, (12.4, 7.4), width_ratios=[1.25, 1])
    _mechanism(axes[0, 0], view(TOWARDS, UP), points, plate(run))
    axes[0, 0].set_title("(a) parts and joints at the start, to scale")
    _from_above(axes[0, 1], points, plate(run))
    axes[0, 1].set_title("(b) joint centres from above (mm)")
    style.heading(
        figure,
        "Figure 1: four SPS legs and a central PS chain carry the platform; rod 1 is flexible, joint A1 has clearance",
        "the paper prints neither the joint coordinates nor the start height: those shown are fitted to Table 8, "
        "or assumed",
    )
    return figure


def plate(run: xr.Dataset) -> np.ndarray:
    """Return the corners of the square plate with the platform's inertia, at the start, world axes [m], shape (5, 3).

    Table 1's moments are those of a square plate 200 x 200 x 1 mm about its centre: m a^2/6 about the normal.
    """
    platform = parameters(run)["body"]["platform"]
    inertia = np.array(platform["inertia"])
    half = 0.5 * np.sqrt(6.0 * inertia.max() / platform["mass"])
    around = half * np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    return around + run.position.sel(body="platform").values[0]


def _mechanism(axes: Axes, camera: View, at: dict[str, np.ndarray], corners: np.ndarray) -> None:
    feet = [at[f"ground.B{k}"] for k in (1, 2, 4, 3)]
    axes.fill(*camera.project(np.array(feet)).T, color=BASE, zorder=0)
    nearest_last = sorted(LEGS, key=lambda k: float(camera.depth(at[f"ground.B{k}"])))
    for order, k in enumerate(nearest_last):
        _leg(axes, camera, at, k, 2.0 + order)
    # the plate lies above all legs' upper ends
    _centre(axes, camera, at, 3.4)
    axes.fill(*camera.project(corners).T, facecolor=PLATE, edgecolor="#7a6236", alpha=0.82, lw=1.0, zorder=7)
    for k in LEGS:
        clear = f"A{k}" == JOINT
        _ball(axes, camera, at[f"platform.A{k}"], CSJ.color if clear else "#3b4754", 8.0)
        _name(axes, camera, at[f"platform.A{k}"], f"A{k}" + (" (clearance)" if clear else ""), (0.012, 0.024))
        # B3 is behind leg 2, so that its name is at that leg's side
        _name(axes, camera, at[f"ground.B{k}"], f"B{k}", (0.052, 0.0) if k == 3 else (0.018, -0.036))
    _ball(axes, camera, at["platform.C"], "#3b4754", 8.0)
    _name(axes, camera, at["platform.C"], "C", (0.012, 0.022))
    axes.plot(*camera.project(at["ground.Z"]), "s", color=style.INK, ms=4, zorder=9)
    _name(axes, camera, at["ground.Z"], "Z", (0.02, 0.0))
    triad(axes, camera, np.zeros(3), 0.075, ("x0", "y0", "z0"))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.set_axis_off()


def _leg(axes: Axes, camera: View, at: dict[str, np.ndarray], k: int, zorder: float) -> None:
    foot, top = at[f"ground.B{k}"], at[f"platform.A{k}"]
    axis = (top - foot) / np.linalg.norm(top - foot)
    rod = at[f"rod{k}.bottom"], at[f"rod{k}.top"]
    for a, b, radius, color in (
        (rod[1], top, ROD, "#3b4754"),
        (*rod, ROD, FAR_CB.color if k == 1 else ALUMINIUM),
        (at[f"cylinder{k}.bottom"], at[f"cylinder{k}.bottom"] + 0.212 * axis, CYLINDER, STEEL),
        (foot, at[f"cylinder{k}.bottom"], ROD, "#3b4754"),
    ):
        shell(axes, camera, tube(a, b, radius), None, color, zorder=zorder)
    _ball(axes, camera, foot, "#3b4754", zorder + 0.5)
    middle = at[f"cylinder{k}.bottom"] + 0.106 * axis
    _name(axes, camera, middle, f"leg {k}\n" + ("driven" if k < 3 else "held"), LABELS[k])
    if k == 1:
        _name(axes, camera, rod[1] - 0.035 * axis, "rod 1\n(flexible)", (0.07, 0.0))


def _centre(axes: Axes, camera: View, at: dict[str, np.ndarray], zorder: float) -> None:
    """Draw rod, stem and base cylinder of the central chain."""
    cylinder = tube(at["ground.Z"] - [0, 0, 0.07], at["ground.Z"] + [0, 0, 0.13], 0.02)
    shell(axes, camera, cylinder, None, STEEL, zorder=zorder)
    shell(axes, camera, tube(at["central_rod.Z"], at["platform.C"], ROD), None, ALUMINIUM, zorder=zorder - 0.1)


def _ball(axes: Axes, camera: View, centre: np.ndarray, color: str, zorder: float) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    point = camera.project(centre)
    axes.fill(point[0] + BALL * np.cos(turn), point[1] + BALL * np.sin(turn), color=color, lw=0, zorder=zorder)


def _name(axes: Axes, camera: View, point: np.ndarray, text: str, shift: tuple[float, float]) -> None:
    x, y = camera.project(point) + shift
    axes.annotate(
        text, (x, y), ha="center", va="center", fontsize=8.6, color=style.INK, zorder=10,
        bbox={"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.78},
    )  # fmt: skip


def _from_above(axes: Axes, at: dict[str, np.ndarray], corners: np.ndarray) -> None:
    axes.fill(*1e3 * corners[:, :2].T, facecolor=PLATE, edgecolor="#7a6236", alpha=0.35, lw=1.0)
    for k in LEGS:
        top, foot = 1e3 * at[f"platform.A{k}"], 1e3 * at[f"ground.B{k}"]
        axes.plot([foot[0], top[0]], [foot[1], top[1]], color=FAR_CB.color if k == 1 else STEEL, lw=2.2)
        axes.plot(*foot[:2], "s", color="#3b4754", ms=7)
        axes.plot(*top[:2], "o", color=CSJ.color if f"A{k}" == JOINT else "#3b4754", ms=8)
        up = 1.0 if foot[1] > 0.0 else -1.0
        for point, name, side in ((foot, f"B{k}", up), (top, f"A{k}", -up)):
            text = f"{name}\n({point[0]:.1f}, {point[1]:.1f})"
            axes.annotate(
                text, (point[0], point[1]), (0.0, 8.0 * side), textcoords="offset points", ha="center",
                va="bottom" if side > 0.0 else "top", fontsize=8.2,
            )  # fmt: skip
    axes.plot(0.0, 0.0, "o", color="#3b4754", ms=8)
    axes.annotate("C, Z", (0.0, 0.0), (8.0, 0.0), textcoords="offset points", va="center", fontsize=8.2)
    length = np.linalg.norm(at["platform.A1"] - at["ground.B1"])
    height = at["platform.A1"][2]
    text = f"height of A1..A4 at the start {1e3 * height:.1f} mm; legs between ball centres {1e3 * length:.1f} mm"
    axes.set(xlabel=f"x0 (mm)\n{text}", ylabel="y0 (mm)")
    reach = 1e3 * np.abs([at[f"ground.B{k}"][:2] for k in LEGS]).max(axis=0)
    axes.set(xlim=(-1.25 * reach[0] - 40.0, 1.25 * reach[0] + 40.0), ylim=(-1.2 * reach[1], 1.2 * reach[1]))
    axes.set_aspect("equal")


#: boxes of the three columns: text, and the step of the paper that it corresponds to
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
#: positions of the boxes of the three parts, as fractions of the height; (b) is below (a)
ROWS = ((0.92, 0.72, 0.52), (0.28, 0.08), (0.92, 0.71, 0.49, 0.27, 0.08))


@drawn("Figure 10: how the dynamics are computed, next to the paper's steps 1 to 9", "sps4/far_csj_cb:run")
def steps(data: Data) -> Drawing:
    """Draw the boxes of the algorithm, with the counts of a run of the paper's full model."""
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
    """Draw boxes below each other, joined by arrows, and return them."""
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


def _arrow(axes: Axes, first: Text, second: Text, form: str) -> None:
    """Draw an arrow from the rim of a box to that of another."""
    look = {"arrowstyle": "-|>", "color": style.SOFT, "lw": 1.3, "connectionstyle": form, "shrinkA": 2, "shrinkB": 2}
    patches = {"patchA": first.get_bbox_patch(), "patchB": second.get_bbox_patch()}
    axes.annotate("", second.get_position(), first.get_position(), arrowprops=look | patches)


#: drawn size of the largest displacement, as a fraction of the body's length
FRACTION = 0.16
#: margin of the pictures [m]
MARGIN = 0.008
#: the rod lies across the picture, seen from above and in front, so that both planes of bending are visible
ACROSS = np.array([-0.35, -1.0, 0.9])


def _sheet(heading: str, bundle: xr.Dataset, printed: tuple[float, ...]) -> Drawing:
    """Draw the first four mode shapes; printed: the paper's frequencies [Hz]."""
    camera = view(ACROSS, UP)
    figure, axes = style.grid(2, 2, (10.6, 6.3))
    corners = []
    for mode, panel in enumerate(axes.flat):
        factor, reach = _shape(panel, camera, bundle, mode)
        corners.append(reach)
        frequency = float(bundle.frequency[mode])
        panel.set_title(
            f"({'abcd'[mode]}) mode {mode + 1}: {frequency:.1f} Hz (paper {printed[mode]:.1f} Hz), "
            f"drawn × {factor:.2g} √kg m",
            fontsize=8.0,
        )
    low, high = np.min(corners, axis=(0, 1)) - MARGIN, np.max(corners, axis=(0, 1)) + MARGIN
    for panel in axes.flat:  # one scale for all panels
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, 1.0), "viridis"), ax=axes, shrink=0.7, pad=0.01, aspect=30)
    bar.set_label("displacement, largest = 1")
    below = (
        "mass-normalised shapes of the round section (in kg$^{-1/2}$) times the factor next to each; grey: undeformed"
    )
    style.heading(figure, heading, below)
    return figure


def _shape(axes: Axes, camera: View, bundle: xr.Dataset, mode: int) -> tuple[float, np.ndarray]:
    """Draw one mode shape over its undeformed ghost.

    Returns the factor of the drawn displacements [kg^0.5 m], and lower left and upper right corner of the picture [m].
    """
    q = np.zeros(bundle.sizes["mode"])
    ghost, _ = rod_surface(bundle, q)
    q[mode] = 1.0
    factor = scale_to(bundle, q, FRACTION)
    rings, size = rod_surface(bundle, q, factor)
    shell(axes, camera, ghost, None, alpha=0.22, antialiased=False, zorder=1)
    shell(axes, camera, rings, size / max(float(size.max()), 1e-300), zorder=2)
    corner = ghost.reshape(-1, 3).min(axis=0) + np.array([0.0, 0.0, -0.055])
    triad(axes, camera, corner, 0.03, ("x", "y", "z"))
    paper = camera.project(np.concatenate([ghost.reshape(-1, 3), rings.reshape(-1, 3), corner[None] - 0.008]))
    axes.set_aspect("equal")
    axes.set_axis_off()
    return factor, np.array([paper.min(axis=0), paper.max(axis=0)])


def _figure(title: str, heading: str, condition: str, printed: tuple[float, ...]) -> Figure:
    """Build the figure of a reference condition of the rod with a round section."""
    needed = f"sps4/frequencies/{condition}_circle:bundle/rod"
    return Figure(title, (needed,), lambda data: _sheet(heading, data[needed], printed))


FIG03 = _figure(
    "Figure 3: first four mode shapes of the rod under fixed-fixed reference conditions",
    "Figure 3: fixed-fixed modes leave both ends of the rod at rest",
    "fixed",
    TABLE4_NORMAL_MODE,
)
FIG04 = _figure(
    "Figure 4: first four elastic mode shapes of the rod under free-free reference conditions",
    "Figure 4: free-free modes leave the rod's ends free, which move most",
    "free",
    TABLE5_NORMAL_MODE,
)
