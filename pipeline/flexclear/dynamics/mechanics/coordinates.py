"""Joint coordinates, measured between the two frames of a joint in the tree or in a loop, and forces along them."""

from __future__ import annotations

from math import pi
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics.trees import Motion, Numbers
from flexclear.dynamics.specialise.symbols import arctan2, nearest
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
    axis = (G if gauge.side else F).R_WB.column(gauge.axis)
    if gauge.turning:
        entries = (gauge.sine_f, gauge.sine_g), (gauge.cosine_f, gauge.cosine_g)
        angle = arctan2(*(dot(F.R_WB.column(f), G.R_WB.column(g)) for f, g in entries))
        for before in turns:
            angle = angle + 2.0 * pi * nearest((before - angle) / (2.0 * pi))
        return Along(angle, dot(axis, G.omega - F.omega), Wrench(axis, ZERO))
    r = G.p_WB - F.p_WB
    return Along(dot(axis, r), dot(axis, G.v - F.v - cross(F.omega, r)), Wrench(ZERO, axis))


def bias(gauge: Any, F: Motion, G: Motion) -> Any:
    """Return the known part of the second rate of the coordinate between frames."""
    side = G if gauge.side else F
    axis = side.R_WB.column(gauge.axis)
    if gauge.turning:
        return dot(axis, G.alpha - F.alpha) + dot(cross(side.omega, axis), G.omega - F.omega)
    r = G.p_WB - F.p_WB
    swing = cross(F.omega, r)
    return dot(axis, G.a - F.a - cross(F.alpha, r) - cross(F.omega, 2.0 * (G.v - F.v) - swing))
