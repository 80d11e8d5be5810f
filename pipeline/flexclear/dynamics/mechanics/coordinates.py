"""Joint coordinates, measured between the two frames of a joint in the tree or in a loop, and forces along them."""

from __future__ import annotations

from math import pi
from typing import Any, NamedTuple

from flexclear.dynamics.joints.conditions import growth_between, measure, twist_between
from flexclear.dynamics.mechanics.trees import Motion, Numbers
from flexclear.dynamics.specialise.symbols import nearest
from flexclear.dynamics.vectors import ZERO, Wrench, cross, dot


class Along(NamedTuple):
    """A coordinate [rad or m] and its rate; unit: wrench of a unit force along it, on the second body at its frame."""

    value: Any
    rate: Any
    unit: Wrench


def along(gauge: Any, turns: Numbers, F: Motion, G: Motion) -> Along:
    """Return the coordinate between frames.

    gauge: how to measure it (`memory.GAUGES`).  turns: an earlier value, from which an angle's full turns are counted.
    """
    value, unit = measure(gauge, F, G)
    for before in turns:
        value = value + 2.0 * pi * nearest((before - value) / (2.0 * pi))
    return Along(value, unit.on(twist_between(F, G)), unit)


def bias(gauge: Any, F: Motion, G: Motion) -> Any:
    """Return the known part of the second rate of the coordinate between frames."""
    side, (_, unit) = G if gauge.side else F, measure(gauge, F, G)
    swing = cross(side.omega, unit.moment) if gauge.turning else ZERO
    return unit.on(growth_between(F, G)) + dot(swing, twist_between(F, G).angular)
