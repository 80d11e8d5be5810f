"""Start values of joints and modes from the table ``[start]``, in SI and validated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import coordinate_of, measured
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled


@dataclass(frozen=True)
class Given:
    """Start of coordinate `number` of a joint: position and near [m or rad], velocity [m/s or rad/s]; None: not given.

    place: key path in the scene.
    """

    joint: str
    number: int
    coordinate: Coordinate
    place: str
    position: float | None
    near: float | None
    velocity: float | None

    @property
    def name(self) -> str:
        """Name of the coordinate in records, which is the joint's where the joint has only one."""
        return self.place.removeprefix("[start.joint.").removesuffix("]")


def given_coordinates(scene: Scene) -> list[Given]:
    """Return the joint coordinates to which the scene gives a start.

    Raises InputError for unknown joints and coordinates, and for units that do not fit.
    """
    rows = []
    for joint, coordinates in (scene.start.joint if scene.start is not None else {}).items():
        for name, start in coordinates.items():
            path = f"[start.joint.{joint}.{name}]" if name else f"[start.joint.{joint}]"
            _, number, coordinate = coordinate_of(scene, joint, name or None, path)
            rate = "angular velocity" if coordinate.turning else "velocity"
            values = [
                None if getattr(start, key) is None else measured(getattr(start, key), dimension, f"{path[:-1]}.{key}]")
                for key, dimension in (
                    ("position", coordinate.dimension),
                    ("near", coordinate.dimension),
                    ("velocity", rate),
                )
            ]
            rows.append(Given(joint, number, coordinate, path, *values))
    return rows


def given_modes(scene: Scene, bundles: Mapping[str, Labelled], key: str = "coordinate") -> dict[str, np.ndarray]:
    """Return modal coordinates [m], or with key "velocity" modal velocities [m/s], by body; (mode,) each.

    Raises InputError for bodies that are not flexible, and for more numbers than modes.
    """
    given = scene.start.modal if scene.start is not None else {}
    values = {name: getattr(start, key) for name, start in given.items()}
    return {name: _padded(scene, bundles, name, key, one) for name, one in values.items() if one is not None}


def _padded(
    scene: Scene, bundles: Mapping[str, Labelled], name: str, key: str, values: tuple[float, ...]
) -> np.ndarray:
    if name not in scene.flexible():
        known = suggestion(name, scene.flexible()) if scene.flexible() else "the scene has no flexible body"
        raise InputError(f"[start.modal.{name}]", f"there is no flexible body '{name}'", known)
    modes = bundles[name].sizes["mode"]
    if len(values) > modes:
        raise InputError(
            f"[start.modal.{name}.{key}]",
            f"{len(values)} numbers are given for the {modes} modes of '{name}'",
            "give one per mode, in the order of the bundle; missing ones at the end are zero",
        )
    return np.array([*values, *[0.0] * (modes - len(values))])
