"""Figure 5."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from flexclear.papers.wang_wang_2019.figures import Data, Figure
from flexclear.papers.wang_wang_2019.models import CSJ, IDEAL, JOINT, references
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.single_run.series import parameters

#: drawn radii of socket and ball, and the angle at which the ball lies off the centre
SOCKET, DRAWN_BALL, ANGLE = 1.0, 0.74, np.radians(-38.0)


def make(data: Data) -> Drawing:
    """Before and during contact; the clearance is drawn larger than it is."""
    post = data[f"{CSJ.scene}:post"]
    joint = parameters(data[f"{CSJ.scene}:run"])["joint"][JOINT]
    clearance, ball = 1e3 * joint["clearance"], 1e3 * joint["ball_radius"]
    deepest = 1e6 * float(data[f"{CSJ.scene}:run"].contact_penetration.max())
    peak = float(post.peak_force.sel(contact=JOINT))
    exaggerated = (SOCKET - DRAWN_BALL) / SOCKET * (ball + clearance) / clearance
    figure, axes = style.grid(1, 2, (10.4, 5.1))
    _joint(axes[0, 0], 0.6 * (SOCKET - DRAWN_BALL))
    axes[0, 0].set_title("(a) free: gap = c − |p_SB| > 0")
    _joint(axes[0, 1], 1.28 * (SOCKET - DRAWN_BALL), touching=True)
    axes[0, 1].set_title("(b) contact: penetration δ = |p_SB| − c > 0")
    style.heading(
        figure,
        f"Figure 5: a ball of {ball:g} mm moves by {clearance:g} mm in its socket and enters the wall by "
        f"{deepest:.1f} µm at most",
        f"clearance drawn {exaggerated:.0f} times larger; S: centre of the socket (paper: A1), "
        "B: of the ball (b1), "
        f"p_SB: eccentricity (d); largest force of the {CSJ.label} run {peak:.0f} N",
    )
    return figure


def _joint(axes: Axes, eccentricity: float, *, touching: bool = False) -> None:
    """Section through socket and ball along the line of centres."""
    n = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    t = np.array([-n[1], n[0]])
    ball, q = eccentricity * n, eccentricity * n + DRAWN_BALL * n
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    axes.fill(*(1.2 * circle).T, color="#dfe5ec", zorder=0)
    axes.fill(*(SOCKET * circle).T, color="white", ec=IDEAL.color, lw=1.2, zorder=1)
    axes.fill(*(ball + DRAWN_BALL * circle).T, color=CSJ.color, alpha=0.55, ec=CSJ.color, lw=1.2, zorder=2)
    axes.plot(*np.array([np.zeros(2), q]).T, color=style.SOFT, lw=0.8, ls=":", zorder=3)
    for point, name, shift in ((np.zeros(2), "S", (-0.09, 0.06)), (ball, "B", (-0.11, -0.1)), (q, "Q", (-0.1, -0.05))):
        axes.plot(*point, "o", color=style.INK, ms=4, zorder=5)
        axes.annotate(name, (point[0] + shift[0], point[1] + shift[1]), fontsize=10, zorder=6)
    _arrow(axes, np.zeros(2), ball, "p_SB", (0.06, 0.1))
    _arrow(axes, q, q + 0.34 * n, "n", (0.05, -0.06))
    _arrow(axes, q, q + 0.34 * t, "t", (0.06, 0.03))
    _arrow(axes, np.zeros(2), SOCKET * np.array([-0.8, 0.6]), "R socket", (0.16, 0.12))
    _arrow(axes, ball, ball + DRAWN_BALL * np.array([-0.6, -0.8]), "R ball", (0.24, -0.06))
    if touching:
        _arrow(axes, q + 0.02 * t, q - 0.42 * n + 0.02 * t, "F on the ball", (0.1, 0.24), color="#B2182B")
    axes.set_aspect("equal")
    axes.set(xlim=(-1.3, 1.55), ylim=(-1.3, 1.25))
    axes.set_axis_off()


def _arrow(
    axes: Axes, start: np.ndarray, end: np.ndarray, name: str, shift: tuple[float, float], color: str = style.INK
) -> None:
    axes.annotate(
        "",
        (end[0], end[1]),
        (start[0], start[1]),
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=6,
    )
    axes.annotate(name, 0.5 * (start + end) + shift, ha="center", va="center", fontsize=9.5, color=color, zorder=6)


FIGURE = Figure(
    "Figure 5: kinematics of the spherical joint with clearance, as named here and in the paper",
    references([CSJ], "run", "post"),
    make,
)
