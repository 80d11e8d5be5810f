"""Force at the origin of a frame, fixed in the world or turning with the frame."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import PointForce
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, law
from flexclear.pipeline.dynamics.loads.row import Row
from flexclear.pipeline.dynamics.vectors import cross, dot, turn


@kernel
def apply(d, k):
    """Apply load k."""
    frame = d.site_frames[d.loads[k].b]
    force = (law(d, k, 0), law(d, k, 1), law(d, k, 2))
    if d.loads[k].follows:
        force = turn(frame.axes, force)
    power = dot(force, frame.velocity)
    act(d, k, cross(frame.origin, force), force, 0.0, 0.0, 0.0, power, 0.0)


def row(load: PointForce, path: str) -> Row:
    """Three laws [N]."""
    laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
