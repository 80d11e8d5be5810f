"""Prescribed coordinates of a scene, and validation of the names by which scenes refer to coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from flexclear.dynamics.joints import JOINTS
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.scene.drives import PathDrive
from flexclear.scene.loose_joints import CONTACTS
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, all_or_errors


@dataclass(frozen=True)
class Prescribed:
    """A prescribed coordinate: its name in records, its law, the dimension of the law's values, and its key path."""

    name: str
    law: Any
    dimension: str
    place: str


@cache
def joint_type(kind: str) -> Any:
    """Return the declaration of a joint type; cached: building a mechanism needs it some hundred times per link."""
    return JOINTS[kind]


def label(joint: str, kind: str, k: int) -> str:
    """Return the name, in records and in ``[start.joint]``, of coordinate k of a joint of some type."""
    declared: tuple[Coordinate, ...] = joint_type(kind).COORDINATES
    return joint if len(declared) == 1 else f"{joint}.{declared[k].name}"


def prescribed_coordinates(scene: Scene) -> list[Prescribed]:
    """Return all prescribed coordinates, in the order of the scene; raise InputError for those that do not exist."""
    return [
        one
        for drive in all_or_errors(partial(_coordinates_of_drive, scene, name) for name in scene.drive)
        for one in drive
    ]


def _coordinates_of_drive(scene: Scene, name: str) -> list[Prescribed]:
    drive = scene.drive[name]
    if not isinstance(drive, PathDrive):
        coordinate = coordinate_of(scene, drive.joint, drive.coordinate, f"[drive.{name}]")[2]
        return [Prescribed(name, drive.law, coordinate.dimension, f"[drive.{name}.law]")]
    dimensions = {part: "length" if part.startswith("position") else "angle" for part, _ in drive.components()}
    return [Prescribed(f"{name}.{p}", law, dimensions[p], f"[drive.{name}.{p}]") for p, law in drive.components()]


def coordinate_of(scene: Scene, joint: str, name: str | None, path: str) -> tuple[str, int, Coordinate]:
    """Return joint name, and number and declaration of the named coordinate; raise InputError for unknown names."""
    if joint not in scene.joint:
        raise InputError(f"{path[:-1]}.joint]", f"there is no joint '{joint}'", suggestion(joint, scene.joint))
    kind = scene.joint[joint].type
    if isinstance(scene.joint[joint], CONTACTS) or kind == "fixed":
        raise InputError(
            f"{path[:-1]}.joint]", f"the {kind} joint '{joint}' has no coordinate", "name a joint with a free motion"
        )
    known = joint_type(kind).COORDINATES
    names = [c.name for c in known]
    if not names:
        raise InputError(
            f"{path[:-1]}.joint]",
            f"the {kind} joint '{joint}' has no single coordinate",
            "prescribe a frame's pose instead, or build the joint from a universal and a revolute one",
        )
    if name is None:
        if len(known) > 1:
            raise InputError(
                f"{path[:-1]}.coordinate]",
                f"the {kind} joint '{joint}' has {len(known)} coordinates, and none is named",
                f"name one: {', '.join(names)}",
            )
        return joint, 0, known[0]
    if name not in names:
        raise InputError(
            f"{path[:-1]}.coordinate]", f"the {kind} joint '{joint}' has no '{name}'", suggestion(name, names)
        )
    return joint, names.index(name), known[names.index(name)]


def named_coordinate(scene: Scene, text: str, path: str) -> tuple[str, Coordinate]:
    """Return the joint and coordinate that ``A`` or ``A.rotation`` names; raise InputError when neither exists."""
    joint, _, coordinate = text.partition(".")
    try:
        return joint, coordinate_of(scene, joint, coordinate or None, path)[2]
    except InputError as error:  # one text names joint and coordinate
        raise InputError(path, error.problem, error.remedy) from None


def joint_drives(scene: Scene) -> dict[str, tuple[str | None, ...]]:
    """Return, for each driven joint, the drive of each of its coordinates, or None; raise InputError for two of one."""
    driven: dict[str, tuple[str | None, ...]] = {}
    for name, drive in scene.drive.items():
        if isinstance(drive, PathDrive):
            continue
        joint, k, coordinate = coordinate_of(scene, drive.joint, drive.coordinate, f"[drive.{name}]")
        drives = driven.get(joint) or (None,) * len(joint_type(scene.joint[joint].type).COORDINATES)
        if drives[k] is not None:
            raise InputError(
                f"[drive.{name}.joint]",
                f"the {coordinate.name} of joint '{joint}' is driven already by '{drives[k]}'",
                "remove one drive",
            )
        driven[joint] = (*drives[:k], name, *drives[k + 1 :])
    return driven
