"""Force at the origin of a frame, with a direction fixed in the world or in the frame."""

from __future__ import annotations

from flexclear.dynamics.loads.given import Given, Load, pulling
from flexclear.dynamics.loads.row import Row
from flexclear.scene.loads import PointForce


def apply(given: Given) -> Load:
    """Return the force."""
    return pulling(given, given.vector)


def row(load: PointForce, path: str) -> Row:
    """Return the load's row: three laws [N]."""
    laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
