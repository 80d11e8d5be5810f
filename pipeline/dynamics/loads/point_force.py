"""Force at the origin of a frame, fixed in the world or turning with the frame."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import PointForce
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import law
from flexclear.pipeline.dynamics.loads.point_expression import applying
from flexclear.pipeline.dynamics.loads.row import Row


@kernel
def given(d, k):
    """The force of load k, before it turns with its frame."""
    return (law(d, k, 0), law(d, k, 1), law(d, k, 2))


apply = applying(given).apply


def row(load: PointForce, path: str) -> Row:
    """Three laws [N]."""
    laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
