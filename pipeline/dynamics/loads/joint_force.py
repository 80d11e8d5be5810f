"""Force or torque of a given law along a joint coordinate."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import JointForce
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, law, measure
from flexclear.pipeline.dynamics.loads.row import Row
from flexclear.pipeline.dynamics.vectors import scale


@kernel
def apply(d, k):
    """Apply load k."""
    value, rate, moment, force = measure(d, k)
    size = law(d, k, 0)
    act(d, k, scale(size, moment), scale(size, force), value, rate, 0.0, size * rate, 0.0)


def row(load: JointForce, path: str, coordinate: Coordinate) -> Row:
    """One law [N or N m]."""
    return Row(joint=load.joint, laws=((load.force, coordinate.force, f"{path[:-1]}.force]"),))
