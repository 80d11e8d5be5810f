"""Start values of joints and modes from the table ``[start]``, in SI and validated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import coordinate_of
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.units import quantity_at
from flexclear.system.errors import InputError, all_or_errors

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
    joints = scene.start.joint if scene.start is not None else {}
    return all_or_errors(partial(_given_start, scene, joint, name) for joint, named in joints.items() for name in named)


def _given_start(scene: Scene, joint: str, name: str) -> Given:
    assert scene.start is not None
    start = scene.start.joint[joint][name]
    path = f"[start.joint.{joint}.{name}]" if name else f"[start.joint.{joint}]"
    _, number, coordinate = coordinate_of(scene, joint, name or None, path)
    rate = "angular velocity" if coordinate.turning else "velocity"
    values = all_or_errors(
        partial(_value, f"{path[:-1]}.{key}]", getattr(start, key), dimension)
        for key, dimension in (("position", coordinate.dimension), ("near", coordinate.dimension), ("velocity", rate))
    )
    return Given(joint, number, coordinate, path, *values)


def _value(path: str, value: object, dimension: str) -> float | None:
    return None if value is None else quantity_at(path, value, dimension)


def given_modes(scene: Scene, bundles: Mapping[str, Labelled], key: str = "coordinate") -> dict[str, np.ndarray]:
    """Return modal coordinates [m], or with key "velocity" modal velocities [m/s], by body; (mode,) each.

    Bodies whose modes are not known have none.  Raises InputError for bodies that are not flexible, and for more
    numbers than modes.
    """
    given = scene.start.modal if scene.start is not None else {}
    for name in given.keys() - scene.flexible().keys():
        known = suggestion(name, scene.flexible()) if scene.flexible() else "the scene has no flexible body"
        raise InputError(f"[start.modal.{name}]", f"there is no flexible body '{name}'", known)
    values = {name: getattr(start, key) for name, start in given.items() if "mode" in bundles[name].sizes}
    return {name: _pad_to_modes(bundles[name], name, key, one) for name, one in values.items() if one is not None}


def _pad_to_modes(bundle: Labelled, name: str, key: str, values: tuple[float, ...]) -> np.ndarray:
    modes = bundle.sizes["mode"]
    if len(values) > modes:
        raise InputError(
            f"[start.modal.{name}.{key}]",
            f"{len(values)} numbers are given for the {modes} modes of '{name}'",
            "give one per mode, in the order of the bundle; missing ones at the end are zero",
        )
    return np.array([*values, *[0.0] * (modes - len(values))])
