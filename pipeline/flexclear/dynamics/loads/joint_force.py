"""Force or torque of a given law along a joint coordinate."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.given import Given, Load, pushing
from flexclear.dynamics.loads.row import Row
from flexclear.scene.loads import JointForce


def apply(given: Given) -> Load:
    """Return the force."""
    return pushing(given, given.laws[0].value)


def row(load: JointForce, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: one law [N or N m]."""
    return Row(joint=load.joint, laws=((load.force, coordinate.force, f"{path[:-1]}.force]"),))
