"""A scene file as plain numbers, read with nothing of the program: TOML, units, poses."""

import math
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.ideal_motion import exponential

Array = np.ndarray
UNITS = {
    "": 1.0, "m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "kg": 1.0, "g": 1e-3, "s": 1.0, "ms": 1e-3, "us": 1e-6,
    "rad": 1.0, "deg": math.pi / 180.0, "rad/s": 1.0, "rpm": math.pi / 30.0, "m/s": 1.0, "mm/s": 1e-3,
    "m/s^2": 1.0, "mm/s^2": 1e-3, "Pa": 1.0, "GPa": 1e9, "kg mm^2": 1e-6, "kg m^2": 1.0,
}  # fmt: skip


@dataclass(frozen=True)
class Frame:
    """On body number `body` (-1: the ground): origin from the centre of mass (from the world's), axes as columns."""

    body: int
    place: Array
    axes: Array


@dataclass(frozen=True)
class Body:
    """Mass [kg], inertia about the centre of mass in its own axes, and its start."""

    mass: float
    inertia: Array
    centre: Array
    axes: Array
    velocity: Array
    omega: Array


def si(value: Any) -> Any:
    """A number, or an array of them, in SI units."""
    if isinstance(value, (list, tuple)):
        return np.array([si(v) for v in value])
    if isinstance(value, str):
        number, unit = re.fullmatch(r"([-+0-9.eE]+)\s*(.*)", value.strip()).groups()  # type: ignore[union-attr]
        return float(number) * UNITS[unit]
    return float(value)


def pose(table: dict[str, Any]) -> tuple[Array, Array]:
    """Origin and axes (columns) of a frame."""
    axes = exponential(si(table.get("rotation_vector", [0.0, 0.0, 0.0])))
    if "axes" in table:
        x, z = (si(table["axes"][k]) / np.linalg.norm(si(table["axes"][k])) for k in "xz")
        axes = np.column_stack([x, np.cross(z, x), z])
    return si(table.get("position", [0.0, 0.0, 0.0])), axes


def read(path: Path) -> dict[str, Any]:
    """The tables of a scene without `extends`."""
    return tomllib.loads(path.read_text())


def bodies(scene: dict[str, Any]) -> tuple[list[Body], dict[str, Frame]]:
    """Moving bodies in their order, and all frames by name."""
    found: list[Body] = []
    frames: dict[str, Frame] = {}
    for name, table in scene["body"].items():
        fixed = table["type"] == "ground"
        centre = si(table.get("com", [0.0, 0.0, 0.0]))
        for frame, place in table.get("frames", {}).items():
            origin, axes = pose(place)
            frames[f"{name}.{frame}"] = Frame(-1 if fixed else len(found), origin - centre, axes)
        if not fixed:
            origin, axes = pose(table["pose"])
            inertia = si(table["inertia"])
            rest = [0.0, 0.0, 0.0]
            motion = [si(table.get(key, rest)) for key in ("velocity", "angular_velocity")]
            matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
            found.append(Body(si(table["mass"]), matrix, origin + axes @ centre, axes, *motion))
    return found, frames
