"""Force or torque of a given law along a joint coordinate."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import along_coordinate, law
from flexclear.dynamics.loads.row import Row
from flexclear.scene.loads import JointForce


@kernel
def given(d, k):
    """Return the force of load k."""
    return law(d, k, 0)


apply = along_coordinate(given)


def row(load: JointForce, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: one law [N or N m]."""
    return Row(joint=load.joint, laws=((load.force, coordinate.force, f"{path[:-1]}.force]"),))
