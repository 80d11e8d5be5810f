"""Force at the origin of a frame, fixed in the world or turning with the frame."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import PointForce as Declared
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, law
from flexclear.pipeline.dynamics.loads.row import Row
from flexclear.pipeline.dynamics.vectors import at, at9, cross, dot, turn


@kernel
def apply(h, f, w, k):
    """Apply load k."""
    o = m.SITE_FRAMES.row(h, m.LOADS.b(h, k))
    force = (law(h, w, k, 0), law(h, w, k, 1), law(h, w, k, 2))
    if m.LOADS.follows(h, k):
        force = turn(at9(w, o + m.FRAME.axes), force)
    power = dot(force, at(w, o + m.FRAME.velocity))
    act(h, w, k, cross(at(w, o + m.FRAME.origin), force), force, 0.0, 0.0, 0.0, power, 0.0)


class PointForce:
    """See the module's text."""

    apply = staticmethod(apply)

    @staticmethod
    def row(load: Declared, path: str) -> Row:
        """Three laws [N]."""
        laws = tuple((c, "force", f"{path[:-1]}.force]") for c in load.force)
        return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
