"""Torque on the body of a frame, with a direction fixed in the world or in the frame."""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import act, laws
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import ZERO, dot, turn
from flexclear.scene.loads import PointTorque


@kernel
def apply(d, k):
    """Apply the torque of load k."""
    frame = d.site_frames[d.loads[k].b]
    torque = laws(d, k)
    if d.loads[k].follows:
        torque = turn(frame.axes, torque)
    act(d, k, torque, ZERO, 0.0, 0.0, 0.0, dot(torque, frame.omega), 0.0)


def row(load: PointTorque, path: str) -> Row:
    """Return the load's row: three laws [N m]."""
    laws = tuple((c, "torque", f"{path[:-1]}.torque]") for c in load.torque)
    return Row(frames=(load.frame,), laws=laws, follows=load.axes == "frame")
