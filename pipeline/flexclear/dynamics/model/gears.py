"""Gears and racks as couplings of two joint coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import named_coordinate
from flexclear.dynamics.model.merge import Placement
from flexclear.scene.units import quantity_at
from flexclear.system.errors import InputError, all_or_errors

if TYPE_CHECKING:
    from flexclear.dynamics.model.filling import Filling
    from flexclear.dynamics.model.mechanism import Mechanism, Site
    from flexclear.scene.schema import Scene


@dataclass(frozen=True)
class Side:
    """One of the two coordinates of a coupling: its joint, and the sites of the joint's first and second frame."""

    joint: str
    coordinate: Coordinate
    a: Site
    b: Site

    def value(self, poses: Sequence[Placement]) -> float:
        """Return the coordinate [rad in (-pi, pi], or m] at poses of the links."""
        return self.coordinate.value(*(poses[site.link].of(site.placement) for site in (self.a, self.b)))


@dataclass(frozen=True)
class Coupling:
    """A gear of the scene: second = ratio * first + offset; the offset is that of the start pose."""

    gear: str
    ratio: float
    second: Side
    first: Side

    @property
    def name(self) -> str:
        """Name of the coupling among the joints that close loops."""
        return f"gear {self.gear}"

    @property
    def ends(self) -> list[tuple[Site, Site]]:
        """Pairs of sites on which the coupling acts: those of its second joint, then of its first one."""
        return [(side.a, side.b) for side, _ in self.parts]

    @property
    def rows(self) -> list[tuple[int, int, int]]:
        """Row of the coupling in table CLOSURE_ROWS; only its kind counts."""
        return [(int(self.second.coordinate.turning), 0, 0)]

    @property
    def parts(self) -> tuple[tuple[Side, float], tuple[Side, float]]:
        """Both sides with their factors in the constraint: second - ratio * first."""
        return (self.second, 1.0), (self.first, -self.ratio)

    def offset(self, poses: Sequence[Placement]) -> float:
        """Return the offset of the constraint at poses of the links."""
        return sum(factor * side.value(poses) for side, factor in self.parts)


def couplings(mechanism: Mechanism) -> list[Coupling]:
    """Return the couplings of all gears of a scene; raise InputError for impossible ones."""
    return all_or_errors(partial(_coupling, mechanism, name) for name in mechanism.scene.rigid_gears())


def _coupling(mechanism: Mechanism, name: str) -> Coupling:
    ratio, *named = coordinates_and_ratio(mechanism.scene, name)
    keys = ("first", "second")
    first, second = all_or_errors(
        partial(_side, mechanism, *n, f"[gear.{name}.{k}]") for k, n in zip(keys, named, strict=True)
    )
    return Coupling(name, ratio, second, first)


def coordinates_and_ratio(scene: Scene, name: str) -> tuple[float, tuple[str, Coordinate], tuple[str, Coordinate]]:
    """Return a gear's ratio in SI, and joint and coordinate of both its sides; raise InputError for impossible ones."""
    gear = scene.gear[name]
    first, second = all_or_errors(
        partial(named_coordinate, scene, getattr(gear, side), f"[gear.{name}.{side}]") for side in ("first", "second")
    )
    return ratio_between(f"[gear.{name}.ratio]", gear.ratio, first[1], second[1]), first, second


def ratio_between(path: str, ratio: Any, first: Coordinate, second: Coordinate) -> float:
    """Return the ratio of a second coordinate to a first one in SI; raise InputError for an impossible one."""
    dimensions = {(True, True): "number", (False, False): "number", (True, False): "length per angle"}
    result = quantity_at(path, ratio, dimensions.get((first.turning, second.turning), "angle per length"))
    if result == 0.0:
        raise InputError(path, "its ratio is 0, which would hold the second coordinate", "give a ratio, or drive it")
    return result


def _side(mechanism: Mechanism, joint: str, coordinate: Coordinate, path: str) -> Side:
    frames = mechanism.scene.joint[joint].between
    sites = [mechanism.site(frame) for frame in frames]
    if sites[0].link == sites[1].link:
        raise InputError(path, f"the bodies of joint '{joint}' move as one", "name another joint")
    return Side(joint, coordinate, *sites)


def fill(filling: Filling) -> dict[str, Any]:
    """Tabulate the couplings; their offsets are those of the start pose."""
    numbering, mechanism = filling.numbering, filling.numbering.mechanism
    coupled, poses = couplings(mechanism), [link.start for link in mechanism.links]

    def gauge(side: Side) -> int:
        return filling.gauges.add(numbering.site(side.a), numbering.site(side.b), side.coordinate, counts=True)

    return {
        "couplings": [(gauge(one.first), gauge(one.second)) for one in coupled],
        "coupling_numbers": [(one.ratio, one.offset(poses)) for one in coupled],
    }
