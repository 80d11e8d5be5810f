"""Torque on the body of a frame, with a direction fixed in the world or in the frame."""

from __future__ import annotations

from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import ZERO, Wrench, dot
from flexclear.scene.loads import PointTorque


def apply(given: Given) -> Load:
    """Return the torque."""
    return Load(Wrench(given.vector, ZERO), dot(given.vector, given.G.omega))


def row(load: PointTorque, path: str) -> Row:
    """Return the load's row: three laws [N m]."""
    laws = tuple((c, "torque", f"{path[:-1]}.torque]") for c in load.torque)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
