"""Force or torque of a given law along a joint coordinate."""

from __future__ import annotations

from flexclear.pipeline.core.scene.loads import JointForce
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import along_coordinate, law
from flexclear.pipeline.dynamics.loads.row import Row


@kernel
def given(d, k):
    """Return the force of load k."""
    return law(d, k, 0)


apply = along_coordinate(given)


def row(load: JointForce, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: one law [N or N m]."""
    return Row(joint=load.joint, laws=((load.force, coordinate.force, f"{path[:-1]}.force]"),))
