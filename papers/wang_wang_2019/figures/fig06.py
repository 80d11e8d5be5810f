"""Figure 6."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Drawing

from flexclear.papers.wang_wang_2019.figures import Data, Figure
from flexclear.papers.wang_wang_2019.models import CSJ, JOINT
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.single_run.series import parameters


def make(data: Data) -> Drawing:
    """Eqs. (28), (29) with the scene's parameters; dots from the run."""
    run = data[f"{CSJ.scene}:run"]
    friction = parameters(run)["joint"][JOINT]["friction"]
    limits = (friction["v_static"], friction["v_dynamic"], friction["static"], friction["dynamic"])
    v, mu = observed(run.sel(contact=JOINT))
    figure, axes = style.grid(1, 2, (9.6, 3.7), width_ratios=[1.25, 1])
    _curve(axes[0, 0], limits, 1.5 * limits[1])
    axes[0, 0].set_title("(a) the law")
    _label(axes[0, 0], limits)
    _curve(axes[0, 1], limits, 3.0 * limits[0], marks=False)
    for panel in axes.flat:
        panel.scatter(1e3 * v, mu, s=7, color=CSJ.color, lw=0, zorder=3, label=f"run {CSJ.scene}, in contact")
        panel.set_xlabel("tangential velocity (mm/s)")
    axes[0, 0].set_xlim(-1.5e3 * limits[1], 1.5e3 * limits[1])
    axes[0, 1].set_xlim(-3e3 * limits[0], 3e3 * limits[0])
    axes[0, 1].set_title("(b) around zero")
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
    """Signed friction coefficient at the tangential velocity v [m/s]; the force is against the velocity.

    Rises as a cubic step from -v_static to v_static, falls to `dynamic` at v_dynamic.  Source: Wang &
    Wang (2019), eqs. (28), (29), with the arguments of STEP in ascending order.
    """
    speed = np.abs(v)
    rise = _step(v, -v_static, -static, v_static, static)
    fall = np.sign(v) * _step(speed, v_static, static, v_dynamic, dynamic)
    return np.where(speed < v_static, rise, fall)


def observed(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Sliding speed [m/s] and |F_t| / F_n at the outputs in contact, from force and friction power."""
    normal = run.contact_normal_force.values
    total = np.linalg.norm(run.contact_force.values, axis=-1)
    # below a millinewton the difference of two nearly equal squares has no correct digits
    inside = (normal > 1e-3) & (total > normal)
    tangent = np.sqrt(total[inside] ** 2 - normal[inside] ** 2)
    sliding = tangent > 1e-6 * normal[inside]
    speed = -run.contact_friction_power.values[inside][sliding] / tangent[sliding]
    return speed, tangent[sliding] / normal[inside][sliding]


def _step(x: np.ndarray, x0: float, h0: float, x1: float, h1: float) -> np.ndarray:
    s = np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


def _curve(axes: style.Axes, limits: tuple[float, ...], reach: float, *, marks: bool = True) -> None:
    v = np.union1d(np.linspace(-reach, reach, 1201), np.linspace(-2 * limits[0], 2 * limits[0], 401))
    axes.plot(1e3 * v, coefficient(v, *limits), color=style.INK, lw=1.5, zorder=2)
    for value in limits[:2] if marks else limits[:1]:
        for side in (-1, 1):
            axes.axvline(1e3 * side * value, color="#bdbdbd", lw=0.8, ls=":")


def _label(axes: style.Axes, limits: tuple[float, ...]) -> None:
    v_static, v_dynamic, static, dynamic = limits
    text = f"μs = {static:g} at vs = {1e3 * v_static:g} mm/s\nμd = {dynamic:g} from vd = {1e3 * v_dynamic:g} mm/s"
    axes.text(0.97, 0.30, text, transform=axes.transAxes, ha="right", va="center", color=style.SOFT, linespacing=1.6)


FIGURE = Figure(
    "Figure 6: modified Coulomb friction, coefficient over sliding velocity, and what a run did",
    ("sps4/csj:run",),
    make,
)
