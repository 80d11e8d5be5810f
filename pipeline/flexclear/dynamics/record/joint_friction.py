"""Recorded bearing loads, sliding and friction wrenches of ideal joints with friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.model.model import Model

if TYPE_CHECKING:
    from flexclear.dynamics.run.run import Run


def friction_series(model: Model, seen: Observed) -> Series:
    """Return load [N], largest sliding speed [m/s] and power [W] of each joint's bearings, and its friction wrench.

    The wrench is part of the joint's own; on its second body, about the second frame's origin.
    """
    bearings, joints = seen.bearings, model.arrays.table(m.NAMED["rubbing"])
    size = bearings["load"]
    wrench = {half: size[..., None] * bearings[f"unit_{half}"] for half in ("moment", "force")}
    middle = seen.sites[:, joints["site_b"]]["origin"]
    force, moment = _sum_bearings(joints, wrench["force"]), _sum_bearings(joints, wrench["moment"])
    slip = np.stack([bearings["slip"][:, _bearings_of(row)].max(axis=1) for row in joints], axis=1)
    dims = ("time", "rubbing")
    return {
        "joint_bearing_load": (dims, _sum_bearings(joints, size)),
        "joint_sliding_speed": (dims, slip),
        "joint_friction_power": (dims, _sum_bearings(joints, -size * bearings["loss"])),
        "joint_friction_force": ((*dims, "axis"), force),
        "joint_friction_moment": ((*dims, "axis"), moment - np.cross(middle, force)),
    }, {"rubbing": list(model.scene.joints_with_friction())}


def _bearings_of(row: np.ndarray) -> slice:
    return slice(int(row["bearing0"]), int(row["bearing0"] + row["n_bearings"]))


def _sum_bearings(joints: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return sums over the bearings of each joint, (time, bearing, ...) to (time, joint, ...)."""
    return np.stack([values[:, _bearings_of(row)].sum(axis=1) for row in joints], axis=1)


def warnings(run: Run) -> list[str]:
    """Return warnings about friction that depends on reactions which rigid bodies leave undetermined."""
    doubted = [name for name in run.scene.joints_with_friction() if name in run.engine.mobility.redundant_joints]
    if not doubted:
        return []
    return [
        f"friction of {', '.join(doubted)} depends on reactions that rigid bodies do not determine, such as those out "
        "of the plane of a planar loop: the result is one of many solutions; a spherical or cylindrical "
        "joint in the loop makes it unique"
    ]
