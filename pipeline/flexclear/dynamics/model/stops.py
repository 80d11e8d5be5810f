"""Ends of joint coordinates as contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import coordinate_of
from flexclear.scene.clearance import NormalLaw
from flexclear.scene.parts import Stop
from flexclear.scene.schema import Scene
from flexclear.scene.units import quantity_at
from flexclear.system.errors import InputError, all_or_errors


@dataclass(frozen=True)
class End:
    """One end of a stop, with the attributes of a contact.

    limit: coordinate where it begins [m or rad].  sense: 1 for an upper end, -1 for a lower one.
    clearance: distance to the other end, or a default [m or rad].  floor, initial_approach_speed [m/s or rad/s].
    """

    stop: str
    between: tuple[str, str]
    coordinate: Coordinate
    limit: float
    sense: float
    clearance: float
    normal: NormalLaw
    floor: float | None
    initial_approach_speed: float | None
    radius: float = 0.0
    arm: float = 0.0
    friction: None = None
    type: str = "stop"
    hollow: bool = False


def ends_an_angle(joint: object) -> bool:
    """Return True for a contact at the end of an angle: its gap is an angle and its force a torque."""
    return isinstance(joint, End) and joint.coordinate.turning


def ends(scene: Scene, lengths: Mapping[str, float]) -> list[tuple[str, End]]:
    """Return the ends of all stops by name, ``stop.lower`` and ``stop.upper``; raise InputError for impossible ones.

    lengths: size of the mechanism that each stopped joint belongs to [m].
    """
    pairs = all_or_errors(partial(_both, scene, name, stop, lengths) for name, stop in scene.stop.items())
    return [(f"{end.stop}.{side}", end) for pair in pairs for side, end in pair.items()]


def _both(scene: Scene, name: str, stop: Stop, lengths: Mapping[str, float]) -> dict[str, End]:
    path = f"[stop.{name}]"
    joint, _, coordinate = coordinate_of(scene, stop.joint, stop.coordinate, path)

    def read(keys: Sequence[str], dimension: str) -> dict[str, float]:
        given = [partial(quantity_at, f"[stop.{name}.{key}]", getattr(stop, key), dimension) for key in keys]
        return dict(zip(keys, all_or_errors(given), strict=True))

    limits = read(stop.ends, coordinate.dimension)
    if len(limits) == 2 and not limits["lower"] < limits["upper"]:
        raise InputError(
            path,
            f"its lower end must lie below its upper one; lower = {limits['lower']:.6g}, upper = {limits['upper']:.6g}",
            "exchange them, or remove one",
        )
    far = limits["upper"] - limits["lower"] if len(limits) == 2 else (1.0 if coordinate.turning else lengths[joint])
    speed = "angular velocity" if coordinate.turning else "velocity"
    speeds = read([key for key in ("floor", "initial_approach_speed") if getattr(stop, key) is not None], speed)
    for key, value in speeds.items():  # an approach speed of 0 declares that the end bears a resting part
        if value < 0.0 or (value == 0.0 and key == "floor"):
            word = "positive" if key == "floor" else "positive or 0"
            raise InputError(f"[stop.{name}.{key}]", f"must be {word}, not {value:.6g}")
    between, sides = scene.joint[joint].between, {"lower": -1.0, "upper": 1.0}
    approach = speeds.get("initial_approach_speed")
    return {
        end: End(name, between, coordinate, limit, sides[end], far, stop.normal, speeds.get("floor"), approach)
        for end, limit in limits.items()
    }
