"""Torque on the body of a frame, fixed in the world or turning with the frame."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import PointTorque as Declared
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import ZERO, act, law
from flexclear.pipeline.dynamics.loads.row import Row
from flexclear.pipeline.dynamics.vectors import at, at9, dot, turn


@kernel
def apply(h, f, w, k):
    """Apply load k."""
    o = m.SITE_FRAMES.row(h, m.LOADS.b(h, k))
    torque = (law(h, w, k, 0), law(h, w, k, 1), law(h, w, k, 2))
    if m.LOADS.follows(h, k):
        torque = turn(at9(w, o + m.FRAME.axes), torque)
    act(h, w, k, torque, ZERO, 0.0, 0.0, 0.0, dot(torque, at(w, o + m.FRAME.omega)), 0.0)


class PointTorque:
    """See the module's text."""

    apply = staticmethod(apply)

    @staticmethod
    def row(load: Declared, path: str) -> Row:
        """Three laws [N m]."""
        laws = tuple((c, "torque", f"{path[:-1]}.torque]") for c in load.torque)
        return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
