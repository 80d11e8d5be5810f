"""Ends of joint coordinates, or of combinations of two, as contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import coordinate_of, named_coordinate
from flexclear.dynamics.model.gears import coordinates_and_ratio, ratio_between
from flexclear.scene.clearance import NormalLaw
from flexclear.scene.ends import Gear, Stop
from flexclear.scene.schema import Scene
from flexclear.scene.units import quantity_at
from flexclear.system.errors import InputError, all_or_errors


@dataclass(frozen=True)
class End:
    """One end of a stop, or one flank of a gear, with the attributes of a contact.

    family: of the scene's parts that it belongs to.  parts: joint and coordinate, then those that are subtracted, if
    any, times the ratio.  frames: of their joints.  limit: coordinate where it begins, from `centre` on [m or rad].
    sense: 1 for an upper end, -1 for a lower one.  clearance: distance to the other end, or a default [m or rad].
    floor, initial_approach_speed [m/s or rad/s].  centre: None for that of the start.
    """

    family: str
    type: str
    parts: tuple[tuple[str, Coordinate], ...]
    frames: tuple[str, ...]
    ratio: float
    limit: float
    sense: float
    clearance: float
    normal: NormalLaw
    floor: float | None
    initial_approach_speed: float | None
    centre: float | None = 0.0
    radius: float = 0.0
    arm: float = 0.0
    friction: None = None
    hollow: bool = False

    @property
    def coordinate(self) -> Coordinate:
        """The coordinate along which its force acts on the bodies of `between`."""
        return self.parts[0][1]

    @property
    def between(self) -> tuple[str, str]:
        """Frames of the coordinate's joint."""
        return self.frames[0], self.frames[1]

    def value(self, *frames: Any) -> float:
        """Return the coordinate [m or rad] at placements of `frames`; angles in (-pi, pi]."""
        (_, one), *others = self.parts
        return one.value(*frames[:2]) - sum(self.ratio * other.value(*frames[2:]) for _, other in others)


def ends_an_angle(joint: object) -> bool:
    """Return True for a contact at the end of an angle: its gap is an angle and its force a torque."""
    return isinstance(joint, End) and joint.coordinate.turning


def ends(scene: Scene, lengths: Mapping[str, float]) -> list[tuple[str, End]]:
    """Return the ends of all stops by name, ``stop.lower`` and ``stop.upper``; raise InputError for impossible ones.

    Those of a gear with backlash are its flanks.  lengths: size of the mechanism of each stopped joint [m].
    """
    stops = scene.stops()
    both = scene.stop.keys() & {name for name, part in stops.items() if part.family == "gear"}
    if both:
        raise InputError(
            f"[gear.{min(both)}]", "a stop has the same name, under which its flanks are recorded", "rename one"
        )
    pairs = all_or_errors(partial(_both, scene, name, stop, lengths) for name, stop in stops.items())
    return [(f"{name}.{side}", end) for name, pair in zip(stops, pairs, strict=True) for side, end in pair.items()]


def _combined(scene: Scene, name: str, stop: Stop | Gear) -> tuple[float, list[tuple[str, Coordinate]]]:
    """Return the ratio, and joint and coordinate; then those that are subtracted, if any."""
    if isinstance(stop, Gear):
        ratio, first, second = coordinates_and_ratio(scene, name)
        return ratio, [second, first]
    joint, _, coordinate = coordinate_of(scene, stop.joint, stop.coordinate, f"[stop.{name}]")
    if stop.relative_to is None:
        return 0.0, [(joint, coordinate)]
    where = f"[stop.{name}.relative_to]"
    other = named_coordinate(scene, stop.relative_to, where)
    if other == (joint, coordinate):
        raise InputError(where, f"'{stop.relative_to}' is the coordinate itself", "name another one")
    ratio = ratio_between(f"[stop.{name}.ratio]", 1.0 if stop.ratio is None else stop.ratio, other[1], coordinate)
    return ratio, [(joint, coordinate), other]


def _both(scene: Scene, name: str, stop: Stop | Gear, lengths: Mapping[str, float]) -> dict[str, End]:
    ratio, parts = _combined(scene, name, stop)
    (joint, coordinate), path = parts[0], f"[{stop.family}.{name}"

    def read(keys: Sequence[str], dimension: str) -> dict[str, float]:
        present = [key for key in keys if getattr(stop, key, None) is not None]
        given = [partial(quantity_at, f"{path}.{key}]", getattr(stop, key), dimension) for key in present]
        return dict(zip(present, all_or_errors(given), strict=True))

    limits = read(("lower", "upper", "backlash", "centre"), coordinate.dimension)
    centre = limits.pop("centre", None if isinstance(stop, Gear) else 0.0)
    if "backlash" in limits:
        play = limits.pop("backlash")
        if not play > 0.0:
            raise InputError(
                f"{path}.backlash]",
                f"must be positive, not {play:.6g} {coordinate.unit}",
                "leave out backlash, stiffness and damping for rigid teeth without play",
            )
        limits = {"lower": -0.5 * play, "upper": 0.5 * play}
    if len(limits) == 2 and not limits["lower"] < limits["upper"]:
        raise InputError(
            f"{path}]",
            f"its lower end must lie below its upper one; lower = {limits['lower']:.6g}, upper = {limits['upper']:.6g}",
            "exchange them, or remove one",
        )
    far = limits["upper"] - limits["lower"] if len(limits) == 2 else (1.0 if coordinate.turning else lengths[joint])
    speeds = read(("floor", "initial_approach_speed"), "angular velocity" if coordinate.turning else "velocity")
    for key, value in speeds.items():  # an approach speed of 0 declares that the end bears a resting part
        if value < 0.0 or (value == 0.0 and key == "floor"):
            word = "positive" if key == "floor" else "positive or 0"
            raise InputError(f"{path}.{key}]", f"must be {word}, not {value:.6g}")
    frames = tuple(frame for name, _ in parts for frame in scene.joint[name].between)
    kind, known, sides = "flank" if isinstance(stop, Gear) else "stop", tuple(parts), {"lower": -1.0, "upper": 1.0}
    common = stop.end_law, speeds.get("floor"), speeds.get("initial_approach_speed"), centre
    return {
        end: End(stop.family, kind, known, frames, ratio, limit, sides[end], far, *common)
        for end, limit in limits.items()
    }
