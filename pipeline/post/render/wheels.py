"""Wheels of gears: which bodies are some, and how large their pitch circles are, so that drawn wheels mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

#: origin [m] and axes of a frame, in the world, at the start
Placed = Callable[[str], tuple[np.ndarray, np.ndarray]]
#: joint types that a wheel turns on
TURNING = ("revolute", "cylindrical")
#: axes are parallel to this, and a distance is none below this fraction of the longest
SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel on a joint's second frame; radius of its pitch circle [m]; inner: whether its teeth point inwards."""

    frame: str
    radius: float
    inner: bool = False


def wheels(given: Mapping[str, Any], placed: Placed) -> dict[str, list[Wheel]]:
    """Wheels by body, of gears between parallel axes and between a wheel and a rack.

    given: parameters of the run.  The pitch circles of `first` and `second` touch: they are as the ratio of the speeds
    says, and their centres as far apart as the axes.
    """
    found: dict[str, list[Wheel]] = {}
    for gear in given.get("gear", {}).values():
        for wheel in _pair(given["joint"], gear, placed):
            mine = found.setdefault(wheel.frame.partition(".")[0], [])
            if all(abs(wheel.radius - other.radius) > SAME * wheel.radius for other in mine):
                mine.append(wheel)
    return found


def _pair(joints: Mapping[str, Any], gear: Mapping[str, Any], placed: Placed) -> list[Wheel]:
    sides = [joints.get(gear[side].partition(".")[0]) for side in ("first", "second")]
    if None in sides or not isinstance(gear["ratio"], float | int):
        return []
    frames = [str(joint["between"][1]) for joint in sides if joint]
    turns = [bool(joint and joint["type"] in TURNING and not gear[side].endswith(".translation"))
             for joint, side in zip(sides, ("first", "second"), strict=True)]  # fmt: skip
    ratio = float(gear["ratio"])
    if turns == [True, False]:
        return [Wheel(frames[0], abs(ratio))]
    if turns == [False, True]:
        return [Wheel(frames[1], 1.0 / abs(ratio))] if ratio else []
    (p, P), (q, Q) = (placed(frame) for frame in frames)
    along = float(P[:, 2] @ Q[:, 2])
    away = q - p
    distance = float(np.linalg.norm(away - (away @ P[:, 2]) * P[:, 2]))
    if turns != [True, True] or abs(abs(along) - 1.0) > SAME or distance == 0.0 or not ratio:
        return []
    ratio *= np.sign(along)
    if ratio < 0.0:
        second = distance / (1.0 - ratio)
        return [Wheel(frames[0], -ratio * second), Wheel(frames[1], second)]
    if abs(ratio - 1.0) < SAME:
        return []  # a belt's pulleys: of any size
    second = distance / abs(ratio - 1.0)
    return [Wheel(frames[0], ratio * second, inner=ratio > 1.0), Wheel(frames[1], second, inner=ratio < 1.0)]
