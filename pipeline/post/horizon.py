"""How long a trajectory can be believed point by point, and what an ensemble says beyond."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.core.quantities import PARTED
from pipeline.post.rotations import angle_about_y

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


def spread(velocity: np.ndarray) -> np.ndarray:
    """Largest distance of a member's velocity from the mean [m/s], over members and bodies, shape (time,).

    velocity: shape (member, time, body, axis) [m/s].
    """
    return np.linalg.norm(velocity - velocity.mean(axis=0), axis=-1).max(axis=(0, 2))


def horizon(time: np.ndarray, velocity: np.ndarray, share: float = PARTED) -> float:
    """First time at which `spread` passes `share` of the largest speed; the last time if it never does [s].

    Beyond it two runs that differ by a perturbation far below any tolerance differ visibly, so a
    pointwise value is one draw out of many.
    """
    peak = float(np.linalg.norm(velocity, axis=-1).max())
    beyond = np.flatnonzero(spread(velocity) > share * peak)
    return float(time[beyond[0]] if beyond.size else time[-1])


def ensemble_statistics(ensemble: xr.Dataset) -> Variables:
    """Mean and standard deviation over the members (``ddof = 1``), on the ensemble's own times."""
    position = ensemble.position.values
    members = {
        "rotation_y": (("ensemble_time", "kept"), angle_about_y(ensemble.quaternion.values)),
        "displacement": (("ensemble_time", "kept", "axis"), position - position[:, :1]),
        "velocity": (("ensemble_time", "kept", "axis"), ensemble.velocity.values),
        "acceleration": (("ensemble_time", "kept", "axis"), ensemble.acceleration.values),
        "normal_force": (("ensemble_time", "contact"), ensemble.contact_normal_force.values),
    }
    result: Variables = {"spread": (("ensemble_time",), spread(ensemble.velocity.values))}
    for name, (dims, values) in members.items():
        result[f"{name}_mean"] = (dims, values.mean(axis=0))
        result[f"{name}_std"] = (dims, values.std(axis=0, ddof=1))
    return result
