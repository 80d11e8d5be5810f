"""Spring and damper along a joint coordinate; full turns of an angle count."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row, numbers
from flexclear.scene.loads import JointSpring


def apply(given: Given) -> Load:
    """Return the force."""
    (stiffness, damping, rest), (value, rate, unit) = given.numbers, given.coordinates[0]
    stretch, damped = value - rest, damping * rate
    stored = 0.5 * stiffness * stretch * stretch
    return Load(unit * -(stiffness * stretch + damped), lost=damped * rate, stored=stored)


def row(load: JointSpring, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: stiffness [N/m or N m/rad], damping [N s/m or N m s/rad], rest value [m or rad]."""
    kind = "torsional " if coordinate.turning else ""
    dimensions = {"stiffness": f"{kind}stiffness", "damping": f"{kind}damping", "rest": coordinate.dimension}
    stiffness, damping, rest = numbers(load, path, **dimensions)
    if stiffness < 0.0 or damping < 0.0 or stiffness == damping == 0.0:
        raise ValueError(
            "stiffness and damping must not be negative, and not both be zero; "
            f"stiffness = {stiffness:.6g}, damping = {damping:.6g}"
        )
    return Row(joint=load.joint, numbers=(stiffness, damping, rest), counts_turns=coordinate.turning)
