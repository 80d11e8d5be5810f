"""Internal states of parts: where they are in the state, and their values in a run that a scene continues."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads import LOADS
from flexclear.dynamics.model.driving import coordinate_of, joint_type, named_coordinate
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.stops import End
from flexclear.scene.films import actions_of
from flexclear.scene.formulas import formula
from flexclear.scene.schema import Scene

#: first part of the key of a counted angle, before the coordinate's name in records
TURNS = "turns"


def internal_states(model: Model) -> Iterator[tuple[tuple[str, ...], range]]:
    """Yield the state's index range of each part's internal states, after a key that names part and states."""
    arrays, scene = model.arrays, model.scene
    first, gauges = model.ny - arrays.size(m.N_INTERNAL), arrays.table(m.GAUGES)

    def turns(gauge: int, joint: str, coordinate: Coordinate) -> Iterator[tuple[tuple[str, ...], range]]:
        at = int(gauges[gauge]["turns"]) if gauge >= 0 else -1
        if at >= 0:
            single = len(joint_type(scene.joint[joint].type).COORDINATES) == 1
            yield (TURNS, joint if single else f"{joint}.{coordinate.name}"), range(first + at, first + at + 1)

    looks = arrays.table(m.LOOKS)["index"]
    for (name, _), row in zip(model.loads, arrays.table(m.LOADS), strict=True):
        along, measured = _coordinates(scene, name)
        for key, one in (("gauge", along), ("measured", measured)):
            if one is not None:
                yield from turns(int(row[key]), *one)
        written = formula(scene, name)
        for look, (sort, what) in enumerate(written.reads if written else (), int(row["look0"])):
            if sort == "coordinate":
                yield from turns(int(looks[look]), *named_coordinate(scene, what, ""))
        if row["internal0"] >= 0:
            at = first + int(row["internal0"])
            yield ("load", name, scene.load[name].type), range(at, at + _states(scene, name))
    for contact, row in zip(model.contacts, arrays.table(m.CONTACTS), strict=True):
        if isinstance(contact.joint, End):
            for gauge, one in zip((row["surfaces"], row["subtracted"]), contact.joint.parts, strict=False):
                yield from turns(int(gauge), *one)
        elif row["bristle"] >= 0:
            yield ("contact", contact.name), range(int(row["bristle"]), int(row["bristle"]) + 3)
    joints = list(scene.joints_with_friction())
    for row in arrays.table(m.NAMED["bearings"]):
        if row["bristle"] >= 0:
            where = (str(int(row[k])) for k in ("kind", "side", "axis"))
            yield ("joint", joints[int(row["joint"])], *where), range(int(row["bristle"]), int(row["bristle"]) + 3)


def named_states(model: Model) -> dict[str, int]:
    """Return the index in the state of each internal state that is no counted angle, by a name for records."""
    slots = [one for one in internal_states(model) if one[0][0] != TURNS]
    return {f"{'.'.join(key)}.{k}": at for key, where in slots for k, at in enumerate(where)}


def recorded_states(model: Model, y: np.ndarray) -> np.ndarray:
    """Return state y with the internal states of the run that the scene continues."""
    start = model.scene.start
    if start is None or not start.recorded:
        return y
    y, row = y.copy(), start.recorded
    for name, at in named_states(model).items():
        y[at] = row.get(f"state.{name}", (y[at],))[0]
    for key, where in internal_states(model):
        if key[0] == TURNS:
            y[where] = row.get(f"joint.{key[1]}", (y[where.start],))[0]
    return y


def _coordinates(scene: Scene, name: str) -> list[tuple[str, Coordinate] | None]:
    """Return joint and coordinate along which a load acts, and those that it measures."""
    load: Any = actions_of(scene)[name]
    if not hasattr(load, "joint"):
        return [None, None]
    joint, _, coordinate = coordinate_of(scene, load.joint, load.coordinate, "")
    if not hasattr(load, "measured"):
        return [(joint, coordinate), None]
    return [(joint, coordinate), named_coordinate(scene, load.measured, "") if load.measured else (joint, coordinate)]


def _states(scene: Scene, name: str) -> int:
    """Return the number of internal states of a load, without turns."""
    load: Any = actions_of(scene)[name]
    given = [one[1] for one in _coordinates(scene, name) if one is not None]
    return int(LOADS[load.type].row(load, "", *given).states)
