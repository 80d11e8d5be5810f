"""Direction of view of a mechanism: a planar one along its normal, any other from above and in front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

#: direction from a spatial mechanism to the eye, and tilt of the eye from a planar mechanism's normal, to show depth
SPATIAL, TILT = np.array([-0.95, 1.45, 0.68]), 0.32
#: speeds out of the plane that are rounding, as a fraction of those in it
PLANAR = 1e-3
#: angle of vision from the lower to the upper edge of a picture [degrees], and margin around the mechanism
ANGLE, MARGIN = 30.0, 1.08


@dataclass(frozen=True, slots=True)
class View:
    """direction: from the mechanism to the eye, not scaled, shape (3,).  up: upward direction of the picture."""

    direction: np.ndarray
    up: np.ndarray
    planar: bool


def view(
    run: xr.Dataset,
    given: Mapping[str, Any],
    asked: Sequence[float] | None = None,
    upwards: Sequence[float] | None = None,
) -> View:
    """Return the view of a run.

    given: the scene's parameters, for gravity, whose opposite is up. asked, upwards: direction to the eye, and upward
    direction, as the user requests them.
    """
    up = _upward_direction(given) if upwards is None else np.array(upwards, dtype=float) / np.linalg.norm(upwards)
    if asked is not None:
        direction = np.array(asked, dtype=float)
        return View(
            direction / np.linalg.norm(direction) * np.linalg.norm(SPATIAL), _perpendicular(up, direction), False
        )
    normal = plane(run)
    if normal is None:
        return _spatial(up)
    return planar_view(normal, given, upwards)


def planar_view(normal: np.ndarray, given: Mapping[str, Any], upwards: Sequence[float] | None = None) -> View:
    """Return the view of a planar mechanism along its normal; the other arguments as of `view`."""
    up = _upward_direction(given) if upwards is None else np.array(upwards, dtype=float) / np.linalg.norm(upwards)
    above = _perpendicular(up, normal)
    right = np.cross(above, normal)
    if right[np.argmax(np.abs(right))] < 0.0:  # the axis across the picture runs to the right
        normal, right = -normal, -right
    return View(np.linalg.norm(SPATIAL) * (normal + TILT * (0.6 * above - 0.5 * right)), above, True)


def eye(camera: View, cloud: np.ndarray, aspect: float, zoom: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return position and focus of the eye, so that all points of a cloud (n, 3) are in the picture.

    aspect: width of the picture over its height; the angle of vision is ANGLE upright.
    """
    towards_eye = camera.direction / np.linalg.norm(camera.direction)
    up = _perpendicular(camera.up, towards_eye)
    axes = np.array([np.cross(up, towards_eye), up, towards_eye])
    local = cloud @ axes.T
    middle = 0.5 * (local.min(axis=0) + local.max(axis=0))
    slope = np.tan(0.5 * np.radians(ANGLE))
    x, y, z = (local - middle).T
    distance = float(np.max(z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope, initial=0.0))
    focus = middle @ axes
    return focus + MARGIN * distance / zoom * towards_eye, focus


def axes_of(camera: View, position: np.ndarray, focus: np.ndarray) -> np.ndarray:
    """Return right, up and back of an eye (`eye`), columns of shape (3, 3)."""
    back = (position - focus) / np.linalg.norm(position - focus)
    right = np.cross(camera.up, back) / np.linalg.norm(np.cross(camera.up, back))
    return np.column_stack([right, np.cross(back, right), back])


def _spatial(up: np.ndarray) -> View:
    """Return the view from above and in front, for any upward direction."""
    return View(upright(up) @ SPATIAL, up, False)


def upright(up: np.ndarray) -> np.ndarray:
    """Return axes of which the third is `up`, columns of shape (3, 3); those of the world where that is its z."""
    side = np.eye(3)[int(np.argmin(np.abs(up) + np.array([0.0, 1e-9, 2e-9])))]
    x = side - (side @ up) * up
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(up, x), up])


def plane(run: xr.Dataset) -> np.ndarray | None:
    """Return the normal of the plane in which all bodies move, shape (3,); None for spatial motion or rest."""
    turning = run["angular_velocity"].values.reshape(-1, 3)
    moving = run["velocity"].values.reshape(-1, 3)
    spin, speed = (float(np.linalg.norm(values, axis=1).max(initial=0.0)) for values in (turning, moving))
    if spin > 0.0:
        normal = turning[np.argmax(np.linalg.norm(turning, axis=1))] / spin
        if float(np.abs(turning - np.outer(turning @ normal, normal)).max()) > PLANAR * spin:
            return None
    elif speed > 0.0:
        _, size, axes = np.linalg.svd(moving, full_matrices=False)
        if size[2] > PLANAR * size[0] or size[1] < PLANAR * size[0]:
            return None  # along one line, or in space
        normal = axes[2]
    else:
        return None
    return normal if float(np.abs(moving @ normal).max()) <= PLANAR * max(speed, 1e-300) or speed == 0.0 else None


def gravity(given: Mapping[str, Any]) -> np.ndarray:
    """Return the sum of the gravity loads among a scene's parameters [m/s^2], shape (3,)."""
    fields = [load["acceleration"] for load in given.get("load", {}).values() if load["type"] == "gravity"]
    return np.sum(np.array(fields, dtype=float).reshape(-1, 3), axis=0)


def _upward_direction(given: Mapping[str, Any]) -> np.ndarray:
    """Return the direction against gravity; z without gravity."""
    total = gravity(given)
    size = float(np.linalg.norm(total))
    return -total / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def _perpendicular(up: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return `up` made perpendicular to a direction; another axis where they are nearly parallel."""
    unit = direction / np.linalg.norm(direction)
    for candidate in (up, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        rest = candidate - (candidate @ unit) * unit
        if np.linalg.norm(rest) > 0.2:
            return rest / np.linalg.norm(rest)
    return np.array([1.0, 0.0, 0.0])
