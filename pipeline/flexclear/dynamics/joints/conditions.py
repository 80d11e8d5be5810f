"""What joints ask of two frames: conditions that close a loop, and coordinates; each is a number and a wrench.

The wrench acts on the second frame, about its origin. Its power is the rate of the number: so wrenches are rows of the
Jacobian, too. Numbers may be symbols, or series.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics.specialise.symbols import arctan2, nearest
from flexclear.dynamics.vectors import ZERO, Matrix, Motion, Twist, Vector, Wrench, cross, dot


class Pose(NamedTuple):
    """Axes and origin of a frame."""

    R_WB: Matrix
    p_WB: Vector


class Gauge(NamedTuple):
    """How to measure a coordinate between frames F and G: an angle or a distance, about or along an axis of F (side 0)
    or G (1). sine, cosine: columns of F and of G whose product they are."""

    turning: int
    side: int
    axis: int
    sine_f: int
    sine_g: int
    cosine_f: int
    cosine_g: int


class Along(NamedTuple):
    """A coordinate [rad or m] and its rate; unit: wrench of a unit force along it, on the second body at its frame."""

    value: Any
    rate: Any
    unit: Wrench


def rows(joint: Any) -> list[tuple[int, int, int]]:
    """Return kind and axes of each condition of a joint type, as `condition` takes them."""
    return [*((0, axis, 0) for axis in joint.TRANSLATIONS), *((1, *axes) for axes in joint.ROTATIONS)]


def condition(F: Pose | Motion, G: Pose | Motion, kind: int, i: int, j: int) -> tuple[Any, Wrench]:
    """Return what is zero between fitting frames, and its wrench.

    kind: 0 forbids displacement along axis i of F, 1 keeps axis i of F perpendicular to axis j of G.
    Source: Wang & Wang (2019), eqs. (30), (31).
    """
    along = F.R_WB.column(i)
    if kind == 0:
        return dot(along, G.p_WB - F.p_WB), Wrench(ZERO, along)
    against = G.R_WB.column(j)
    return dot(along, against), Wrench(cross(against, along), ZERO)


def measure(gauge: Any, F: Pose | Motion, G: Pose | Motion) -> tuple[Any, Wrench]:
    """Return a coordinate [rad in (-pi, pi], or m] between frames, and the wrench of a unit force along it."""
    axis = (G if gauge.side else F).R_WB.column(gauge.axis)
    if gauge.turning:
        entries = (gauge.sine_f, gauge.sine_g), (gauge.cosine_f, gauge.cosine_g)
        return arctan2(*(dot(F.R_WB.column(f), G.R_WB.column(g)) for f, g in entries)), Wrench(axis, ZERO)
    return dot(axis, G.p_WB - F.p_WB), Wrench(ZERO, axis)


def along(gauge: Any, turns: Sequence[Any], F: Motion, G: Motion) -> Along:
    """Return the coordinate between frames; turns: an earlier value, from which an angle's full turns are counted."""
    value, unit = measure(gauge, F, G)
    for before in turns:
        value = value + 2.0 * pi * nearest((before - value) / (2.0 * pi))
    return Along(value, unit.on(twist_between(F, G)), unit)


def second_rate(gauge: Any, F: Motion, G: Motion) -> Any:
    """Return the second rate of the coordinate between frames, as far as their accelerations are known."""
    side, (_, unit) = G if gauge.side else F, measure(gauge, F, G)
    swing = cross(side.omega, unit.moment) if gauge.turning else ZERO
    return unit.on(growth_between(F, G)) + dot(swing, twist_between(F, G).angular)


def frame_motion(frame: Any) -> Motion:
    """Return the motion of a frame by its named fields (`memory.FRAME`), each a number or a series of them."""
    axes = frame["axes"].reshape(*frame["axes"].shape[:-2], 9)
    vectors = (frame[name] for name in ("origin", "omega", "velocity", "alpha", "acceleration"))
    return Motion(Matrix(np.moveaxis(axes, -1, 0)), *(Vector(np.moveaxis(one, -1, 0)) for one in vectors))


def twist_between(F: Motion, G: Motion) -> Twist:
    """Return the motion of frame G relative to the body of frame F, at the origin of G."""
    return Twist(G.omega - F.omega, G.v - F.v - cross(F.omega, G.p_WB - F.p_WB))


def growth_between(F: Motion, G: Motion) -> Twist:
    """Return the rate of `twist_between` as the body of F sees it, without the part from unknown rates of speeds."""
    r, slide = G.p_WB - F.p_WB, twist_between(F, G).linear
    a = G.a - F.a - cross(F.alpha, r) - cross(F.omega, cross(F.omega, r) + 2.0 * slide)
    return Twist(G.alpha - F.alpha, a)
