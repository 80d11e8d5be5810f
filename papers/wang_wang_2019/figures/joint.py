"""Figures 5, 6 and 17: the joint with clearance, its friction, and the path of the ball in it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from flexclear.publishing import style
from papers.comparison import Data, drawn
from papers.wang_wang_2019.figures.phase import at_times
from papers.wang_wang_2019.models import CSJ, FAR_CSJ, IDEAL, JOINT, Model, comparable_until, parameters, references

#: drawn radii of socket and ball, and the direction of the ball's eccentricity
SOCKET, DRAWN_BALL, ANGLE = 1.0, 0.74, np.radians(-38.0)
TURN = np.linspace(0.0, 2.0 * np.pi, 361)
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN)])


@drawn(
    "Figure 5: kinematics of the spherical joint with clearance, as named here and in the paper",
    *references([CSJ], "run", "post"),
)
def kinematics(data: Data) -> Drawing:
    """Draw the joint before and during contact, with the clearance larger than it is."""
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
        f"clearance drawn {exaggerated:.0f} times larger; S: centre of the socket (paper: A1), B: of the ball (b1), "
        f"p_SB: eccentricity (d); largest force of the {CSJ.label} run {peak:.0f} N",
    )
    return figure


def _joint(axes: Axes, eccentricity: float, *, touching: bool = False) -> None:
    """Draw a section through socket and ball along the line of centres."""
    n = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    t = np.array([-n[1], n[0]])
    ball, q = eccentricity * n, eccentricity * n + DRAWN_BALL * n
    axes.fill(*(1.2 * CIRCLE).T, color="#dfe5ec", zorder=0)
    axes.fill(*(SOCKET * CIRCLE).T, color="white", ec=IDEAL.color, lw=1.2, zorder=1)
    axes.fill(*(ball + DRAWN_BALL * CIRCLE).T, color=CSJ.color, alpha=0.55, ec=CSJ.color, lw=1.2, zorder=2)
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
    axes.set(aspect="equal", xlim=(-1.3, 1.55), ylim=(-1.3, 1.25))
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


@drawn("Figure 6: modified Coulomb friction, coefficient over sliding velocity, and what a run did", "sps4/csj:run")
def friction_law(data: Data) -> Drawing:
    """Draw eqs. (28), (29) with the scene's parameters, and dots from the run."""
    run = data[f"{CSJ.scene}:run"]
    friction = parameters(run)["joint"][JOINT]["friction"]
    limits = (friction["v_static"], friction["v_dynamic"], friction["static"], friction["dynamic"])
    v, mu = observed(run.sel(contact=JOINT))
    figure, axes = style.grid(1, 2, (9.6, 3.7), width_ratios=[1.25, 1])
    _law(axes[0, 0], limits, 1.5 * limits[1])
    axes[0, 0].set_title("(a) the law")
    text = f"μs = {limits[2]:g} at vs = {1e3 * limits[0]:g} mm/s\nμd = {limits[3]:g} from vd = {1e3 * limits[1]:g} mm/s"
    look = {"ha": "right", "va": "center", "color": style.SOFT, "linespacing": 1.6}
    axes[0, 0].text(0.97, 0.30, text, transform=axes[0, 0].transAxes, **look)
    _law(axes[0, 1], limits, 3.0 * limits[0], marks=False)
    for panel in axes.flat:
        panel.scatter(1e3 * v, mu, s=7, color=CSJ.color, lw=0, zorder=3, label=f"run {CSJ.scene}, in contact")
        panel.set_xlabel("tangential velocity (mm/s)")
    axes[0, 0].set_xlim(-1.5e3 * limits[1], 1.5e3 * limits[1])
    axes[0, 1].set(xlim=(-3e3 * limits[0], 3e3 * limits[0]), title="(b) around zero")
    axes[0, 0].set_ylabel("friction coefficient")
    axes[0, 0].legend(loc="upper left", fontsize=8)
    style.heading(
        figure,
        f"Figure 6: friction rises to {limits[2]:g} at {1e3 * limits[0]:g} mm/s and falls to {limits[3]:g} at "
        f"{1e3 * limits[1]:g} mm/s",
        "modified Coulomb law, force against the sliding velocity; negative velocities mirror the law",
    )
    return figure


def coefficient(v: np.ndarray, v_static: float, v_dynamic: float, static: float, dynamic: float) -> np.ndarray:
    """Return the signed friction coefficient of eqs. (28), (29) at velocities v [m/s]; the force opposes v."""
    rise = np.clip(v / v_static, -1.0, 1.0)
    fall = np.clip((np.abs(v) - v_static) / (v_dynamic - v_static), 0.0, 1.0)
    return 0.5 * static * rise * (3.0 - rise**2) + np.sign(v) * (dynamic - static) * fall**2 * (3.0 - 2.0 * fall)


def observed(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return sliding speed [m/s] and |F_t| / F_n at the outputs in contact, from force and friction power."""
    normal = run.contact_normal_force.values
    total = np.linalg.norm(run.contact_force.values, axis=-1)
    # below a millinewton the difference of two nearly equal squares has no correct digits
    inside = (normal > 1e-3) & (total > normal)
    tangent = np.sqrt(total[inside] ** 2 - normal[inside] ** 2)
    sliding = tangent > 1e-6 * normal[inside]
    speed = -run.contact_friction_power.values[inside][sliding] / tangent[sliding]
    return speed, tangent[sliding] / normal[inside][sliding]


def _law(axes: style.Axes, limits: tuple[float, ...], reach: float, *, marks: bool = True) -> None:
    v = np.union1d(np.linspace(-reach, reach, 1201), np.linspace(-2 * limits[0], 2 * limits[0], 401))
    axes.plot(1e3 * v, coefficient(v, *limits), color=style.INK, lw=1.5, zorder=2)
    for value in limits[:2] if marks else limits[:1]:
        for side in (-1, 1):
            axes.axvline(1e3 * side * value, color="#bdbdbd", lw=0.8, ls=":")


PLANES = (("x", "y"), ("x", "z"))


@drawn(
    "Figure 17: trajectory of the ball's centre in the socket, CSJ and FAR-CSJ models",
    *references((CSJ, *FAR_CSJ), "run", "post"),
)
def trajectory(data: Data) -> Drawing:
    """Draw two projections per model, socket axes, with the clearance circle."""
    models = (CSJ, *FAR_CSJ)
    figure, axes = style.grid(len(PLANES), len(models), (11.6, 6.5), sharex=True, sharey=True)
    for column, model in enumerate(models):
        axes[0, column].set_title(model.label.replace(" modes", ""), fontsize=8.6)
        for row, plane in enumerate(PLANES):
            _projection(axes[row, column], plane, model, data)
    for row, plane in enumerate(PLANES):
        axes[row, 0].set_ylabel(f"{plane[1]} in the socket (mm)")
    for column in range(len(models)):
        axes[-1, column].set_xlabel("x in the socket (mm)")
    style.heading(
        figure,
        "Figure 17: the ball flies from wall to wall; with a flexible rod its ways part from run to run",
        "centre of the ball in the socket; grey: clearance sphere; pale: beyond the horizon; dots: where impacts "
        "begin before it",
    )
    return figure


def _projection(axes: style.Axes, plane: tuple[str, str], model: Model, data: dict[str, xr.Dataset]) -> None:
    run, post = data[f"{model.scene}:run"], data[f"{model.scene}:post"]
    offset = 1e3 * run.contact_offset.sel(contact=JOINT)
    x, y = (offset.sel(axis=name).values for name in plane)
    time, horizon = run.time.values, comparable_until(post)
    circle = 1e3 * float(post.clearance.sel(contact=JOINT)) * CIRCLE
    axes.fill(*circle.T, color="#f3f3f3", zorder=0)
    axes.plot(*circle.T, color="#a8a8a8", lw=1.0, zorder=1)
    inside = time <= horizon
    axes.plot(x, y, color=model.color, lw=0.5, alpha=0.35)
    axes.plot(x[inside], y[inside], color=model.color, lw=0.8)
    if "impact_time" in post:
        when, x, y = at_times(time, post.impact_time.values, time, x, y)
        axes.plot(x[when <= horizon], y[when <= horizon], "o", ms=2.6, color=style.INK)
    axes.set_aspect("equal")
