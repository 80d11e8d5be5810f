"""Force at the origin of a frame, with a direction fixed in the world or in the frame."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import PointForce
from flexclear.pipeline.dynamics.loads.fields import at_origin, laws
from flexclear.pipeline.dynamics.loads.row import Row

apply = at_origin(laws)


def row(load: PointForce, path: str) -> Row:
    """Return the load's row: three laws [N]."""
    laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
