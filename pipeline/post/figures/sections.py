"""Stroboscopic sections (added): the state once per stroke when the stroke is repeated, CSJ and FAR-CSJ models."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.collections import PathCollection

from flexclear.pipeline.post import poincare
from flexclear.pipeline.post.models import JOINT, PLATFORM
from flexclear.pipeline.post.plotting import style

NEEDS = (
    "sps4/repeated/csj:run",
    "sps4/repeated/csj:post",
    "sps4/repeated/far_csj_cb:run",
    "sps4/repeated/far_csj_cb:post",
)

MODELS = {"sps4/repeated/csj": "CSJ", "sps4/repeated/far_csj_cb": "FAR-CSJ, Craig-Bampton, 1 % damping"}
PERIOD = 0.18  #: duration of a stroke [s], eq. (35)
TOP = 0.09  #: when it is at its top [s]


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """sections.png and sections.svg: one row per model, one point per stroke, its colour the stroke's number."""
    with style.style():
        figure, axes = style.grid(len(MODELS), 4, (12.6, 6.4))
        for row, (scene, label) in zip(axes, MODELS.items(), strict=True):
            points = _row(row, strobed(data[f"{scene}:run"], data[f"{scene}:post"]))
            clearance = 1e3 * float(data[f"{scene}:post"].clearance.sel(contact=JOINT))
            turn = np.linspace(0.0, 2.0 * np.pi, 361)
            row[2].plot(clearance * np.cos(turn), clearance * np.sin(turn), color="#a8a8a8", lw=1.0, zorder=1)
            row[2].set_aspect("equal")
            row[0].set_title(label, loc="left", fontsize=8.6)
            figure.colorbar(points, ax=row[3], label="stroke", pad=0.02)
        axes[1, 3].sharey(axes[0, 3])
        style.heading(
            figure,
            "Stroboscopic sections of the repeated stroke (added)",
            "one point per stroke, at its top; last column: how far the ball's centre is from where it was one stroke "
            "before. A row of points that closes in on one is a motion of period one",
        )
        return style.files("sections", figure)


def strobed(run: xr.Dataset, post: xr.Dataset) -> dict[str, np.ndarray]:
    """States at the tops of the strokes: angle [mrad], height [mm], velocity [mm/s], ball in the socket [mm]."""
    time = run.time.values
    tops = poincare.strobe_times(time[0], time[-1], PERIOD, transient=0, phase=TOP)
    platform, offset = run.sel(body=PLATFORM), 1e3 * run.contact_offset.sel(contact=JOINT)
    series = {
        "angle": 1e3 * post.rotation_y.sel(body=PLATFORM).values,
        "height": 1e3 * post.displacement.sel(body=PLATFORM, axis="z").values,
        "velocity": 1e3 * platform.velocity.sel(axis="z").values,
        "x": offset.sel(axis="x").values,
        "y": offset.sel(axis="y").values,
        "z": offset.sel(axis="z").values,
    }
    return dict(zip(series, poincare.at_times(time, tops, *series.values()), strict=True))


def _row(axes: np.ndarray, state: dict[str, np.ndarray]) -> PathCollection:
    stroke = np.arange(1, state["angle"].size + 1)
    planes = (
        ("angle", "velocity", "angle about y0 (mrad)", "z velocity (mm/s)"),
        ("height", "velocity", "z displacement (mm)", "z velocity (mm/s)"),
        ("x", "z", "x in the socket (mm)", "z in the socket (mm)"),
    )
    for panel, (x, y, x_label, y_label) in zip(axes, planes, strict=False):
        panel.scatter(state[x], state[y], c=stroke, s=14, lw=0, zorder=3)
        panel.set_xlabel(x_label)
        panel.set_ylabel(y_label)
        panel.locator_params(nbins=5)
        panel.ticklabel_format(useOffset=False)
    ball = np.column_stack([state[name] for name in "xyz"])
    step = np.linalg.norm(np.diff(ball, axis=0), axis=1)
    points = axes[3].scatter(stroke[1:], step, c=stroke[1:], s=14, lw=0, zorder=3, vmin=1, vmax=stroke[-1])
    axes[3].set_yscale("log")
    axes[3].set_xlabel("stroke")
    axes[3].set_ylabel("change since the last stroke (mm)")
    return points
