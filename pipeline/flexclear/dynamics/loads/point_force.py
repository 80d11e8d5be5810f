"""Force at the origin of a frame, with a direction fixed in the world or in the frame."""

from __future__ import annotations

from flexclear.dynamics.loads.fields import at_origin, laws
from flexclear.dynamics.loads.row import Row
from flexclear.scene.loads import PointForce

apply = at_origin(laws)


def row(load: PointForce, path: str) -> Row:
    """Return the load's row: three laws [N]."""
    laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
