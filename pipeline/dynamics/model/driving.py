"""Which coordinates are prescribed, by which laws; all that can be wrong about drives before anything is built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from pipeline.core.errors import InputError
from pipeline.core.registry import lookup, suggestion
from pipeline.core.scene.drives import PathDrive
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.drives.pieces import Pieces, covers, jump, pieces_of
from pipeline.dynamics.joints.coordinate import Coordinate

JOINTS = "pipeline.dynamics.joints"


@dataclass(frozen=True)
class Prescribed:
    """A prescribed coordinate: its name in records, its law, what the law's values measure, where it stands."""

    name: str
    law: Any
    dimension: str
    place: str


@cache
def joint_class(kind: str) -> Any:
    """The class that declares a joint type; asked for some hundred times per link while a mechanism is built."""
    return lookup(JOINTS, kind, where="joint")


def prescribed(scene: Scene) -> list[Prescribed]:
    """All prescribed coordinates, in the order of the scene."""
    found = []
    for name, drive in scene.drive.items():
        if isinstance(drive, PathDrive):
            for part, law in drive.components():
                dimension = "length" if part.startswith("position") else "angle"
                found.append(Prescribed(f"{name}.{part}", law, dimension, f"[drive.{name}.{part}]"))
        else:
            _, _, coordinate = coordinate_of(scene, drive.joint, drive.coordinate, f"[drive.{name}]")
            found.append(Prescribed(name, drive.law, coordinate.dimension, f"[drive.{name}.law]"))
    return found


def coordinate_of(scene: Scene, joint: str, name: str | None, place: str) -> tuple[str, int, Coordinate]:
    """The joint's name, and number and declaration of the coordinate that something names."""
    if joint not in scene.joint:
        raise InputError(f"{place[:-1]}.joint]", f"there is no joint '{joint}'", suggestion(joint, scene.joint))
    kind = scene.joint[joint].type
    if joint in scene.contacts() or kind == "fixed":
        raise InputError(
            f"{place[:-1]}.joint]", f"the {kind} joint '{joint}' has no coordinate", "name a joint with a free motion"
        )
    known = joint_class(kind).COORDINATES
    names = [c.name for c in known]
    if not names:
        raise InputError(
            f"{place[:-1]}.joint]",
            f"the {kind} joint '{joint}' has no single coordinate",
            "prescribe a frame's pose instead, or build the joint from a universal and a revolute one",
        )
    if name is None:
        if len(known) > 1:
            raise InputError(
                f"{place[:-1]}.coordinate]",
                f"the {kind} joint '{joint}' has {len(known)} coordinates, and none is named",
                f"name one: {', '.join(names)}",
            )
        return joint, 0, known[0]
    if name not in names:
        raise InputError(
            f"{place[:-1]}.coordinate]", f"the {kind} joint '{joint}' has no '{name}'", suggestion(name, names)
        )
    return joint, names.index(name), known[names.index(name)]


def joint_drives(scene: Scene) -> dict[str, tuple[str | None, ...]]:
    """Driven joint -> the drive of each of its coordinates, or None."""
    found: dict[str, tuple[str | None, ...]] = {}
    for name, drive in scene.drive.items():
        if isinstance(drive, PathDrive):
            continue
        joint, k, coordinate = coordinate_of(scene, drive.joint, drive.coordinate, f"[drive.{name}]")
        drives = found.get(joint) or (None,) * len(joint_class(scene.joint[joint].type).COORDINATES)
        if drives[k] is not None:
            raise InputError(
                f"[drive.{name}.joint]",
                f"the {coordinate.name} of joint '{joint}' is driven already by '{drives[k]}'",
                "remove one drive",
            )
        found[joint] = (*drives[:k], name, *drives[k + 1 :])
    return found


def drive_laws(scene: Scene, given: Mapping[str, Pieces]) -> list[Pieces]:
    """The law of every prescribed coordinate; `given` ones are taken as they are.

    Raises InputError where a value has the wrong dimension, a law does not cover the run, or value
    or rate jump: no finite force could follow.
    """
    laws = []
    for one in prescribed(scene):
        law = given[one.name] if one.name in given else checked_law(scene, one.law, one.dimension, one.place)
        broken = None if one.name in given else jump(law, scene.time.start, scene.time.end)
        if broken is not None:
            raise InputError(
                one.place,
                f"the {broken[1]} of the prescribed motion jumps at {broken[0]:.6g} s",
                "let value and rate go on without a jump; the second derivative may have one",
            )
        laws.append(law)
    return laws


def checked_law(scene: Scene, law: Any, dimension: str, place: str) -> Pieces:
    """The pieces of a law; InputError for the wrong dimension, or when it does not cover the run."""
    try:
        made = pieces_of(law, dimension)
    except ValueError as error:
        raise InputError(place, str(error)) from None
    start, end = scene.time.start, scene.time.end
    if not covers(made, start, end):
        low, high = made.span
        raise InputError(
            place,
            f"its points reach from {low:.6g} s to {high:.6g} s, the run from {start:.6g} s to {end:.6g} s",
            "add points, or shorten the run",
        )
    return made
