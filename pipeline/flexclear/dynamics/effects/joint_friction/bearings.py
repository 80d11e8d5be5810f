"""Bearings of each type of ideal joint, where friction acts."""

from __future__ import annotations

#: kinds of bearings: a pin rotates, a slider slides, a sleeve does both, a ball rotates about every axis
PIN, SLIDER, SLEEVE, BALL = range(4)
#: by type of joint, for each bearing: kind, side (0: first frame, 1: second), axis of that frame along the bearing
BEARINGS: dict[str, tuple[tuple[int, int, int], ...]] = {
    "revolute": ((PIN, 0, 2),),
    "prismatic": ((SLIDER, 0, 2),),
    "cylindrical": ((SLEEVE, 0, 2),),
    "universal": ((PIN, 0, 0), (PIN, 1, 1)),
    "spherical": ((BALL, 0, 2),),
}
