"""What the table ``[start]`` says of joints and modes, in SI numbers; what cannot be meant is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.scene.registry import suggestion
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.model.driving import coordinate_of, measured

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import Labelled


@dataclass(frozen=True)
class Given:
    """Start of coordinate `number` of a joint: position and near [m or rad], velocity [m/s or rad/s]; None: not given.

    place: where the scene says so.
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
        """As records call it, shortened where the joint has but one coordinate."""
        return self.place.removeprefix("[start.joint.").removesuffix("]")


def given_coordinates(scene: Scene) -> list[Given]:
    """The joint coordinates that the scene gives a start.

    Raises InputError for joints and coordinates that are not there, and for units that do not fit.
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
    """Modal coordinates [m], or by another key velocities [m/s], of the bodies that the scene gives some; (mode,).

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
            "give one per mode, in the order of the bundle; those left out at the end are zero",
        )
    return np.array([*values, *[0.0] * (modes - len(values))])
