"""Spring and damper along a joint coordinate; full turns of an angle count."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import act, measure, number
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import scale
from flexclear.scene.loads import JointSpring
from flexclear.scene.units import quantity


@kernel
def apply(d, k):
    """Apply the force of load k."""
    value, rate, moment, force = measure(d, k)
    stretch, damped = value - number(d, k, 2), number(d, k, 1) * rate
    size = -(number(d, k, 0) * stretch + damped)
    stored = 0.5 * number(d, k, 0) * stretch * stretch
    act(d, k, scale(size, moment), scale(size, force), value, rate, stored, 0.0, damped * rate)


def row(load: JointSpring, path: str, coordinate: Coordinate) -> Row:
    """Return the load's row: stiffness [N/m or N m/rad], damping [N s/m or N m s/rad], rest value [m or rad]."""
    kind = "torsional " if coordinate.turning else ""
    stiffness, damping = quantity(load.stiffness, f"{kind}stiffness"), quantity(load.damping, f"{kind}damping")
    if stiffness < 0.0 or damping < 0.0 or stiffness == damping == 0.0:
        raise ValueError(
            "stiffness and damping must not be negative, and not both be zero; "
            f"stiffness = {stiffness:.6g}, damping = {damping:.6g}"
        )
    numbers = (stiffness, damping, quantity(load.rest, coordinate.dimension))
    return Row(joint=load.joint, numbers=numbers, counts_turns=coordinate.turning)
