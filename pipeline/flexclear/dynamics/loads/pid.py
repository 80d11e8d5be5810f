r"""PID controller: a force along a joint coordinate from the error of a measured one, with limits and anti-windup.

.. math:: u = K_p e + z + K_d\dot e, \quad F = \min(\max(u, F_-), F_+), \quad \dot z = K_i e + (F - u)/T_t

The integral part z is an internal state. While the force is at a limit z follows it with the tracking time T_t
(back-calculation), so that the right-hand side stays continuous.
Source: Astrom & Hagglund (1995), PID Controllers: Theory, Design, and Tuning, 2nd ed., sec. 3.5.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row, numbers
from flexclear.dynamics.specialise.symbols import larger, smaller
from flexclear.scene.loads import Pid
from flexclear.scene.units import quantity_at

#: number of its internal states
STATES = 1
#: represents a missing limit
UNLIMITED = 1e300
#: dimensions of proportional, integral and derivative gain, by (True when the force is a torque, True when the measured
#: coordinate is an angle)
GAINS = {
    (False, False): ("stiffness", "stiffness per time", "damping"),
    (True, True): ("torsional stiffness", "torsional stiffness per time", "torsional damping"),
    (False, True): ("force per angle", "force per angle and time", "force per angular velocity"),
    (True, False): ("force", "force per time", "impulse"),
}


def apply(given: Given) -> Load:
    """Return the force, within its limits."""
    proportional, integral, derivative, least, most, tracking = given.numbers
    (_, speed, unit), (value, rate, _), law = *given.coordinates, given.laws[0]
    error = law.value - value
    asked = proportional * error + given.states[0] + derivative * (law.rate - rate)
    size = smaller(larger(asked, least), most)
    return Load(unit * size, size * speed, states=[integral * error + tracking * (size - asked)])


def settings(load: Any, path: str, coordinate: Coordinate, measured: Coordinate) -> tuple[float, ...]:
    """Return three gains, least and largest force, 1/tracking time [SI]; raise ValueError, in words, for bad values."""
    dimensions = zip(
        ("proportional", "integral", "derivative"), GAINS[coordinate.turning, measured.turning], strict=True
    )
    gains = numbers(load, path, **dict(dimensions))
    if not any(gains):
        raise ValueError("a controller needs a gain: give proportional, integral or derivative; all are 0")
    low, high = (-UNLIMITED, UNLIMITED)
    if load.limits is not None:
        low, high = (quantity_at(f"{path[:-1]}.limits]", limit, coordinate.force) for limit in load.limits)
        if not low < high:
            raise ValueError(f"limits are the smallest and the largest force; {low:.6g} is not below {high:.6g}")
    tracking = load.tracking_time
    if tracking is None and load.limits is not None and gains[1]:
        if not gains[0] / gains[1] > 0.0:
            raise ValueError("proportional/integral is not a positive time: give a tracking_time of the integral")
        tracking = gains[0] / gains[1]
    return (*gains, low, high, 0.0 if tracking is None else 1.0 / tracking)


def row(load: Pid, path: str, coordinate: Coordinate, measured: Coordinate) -> Row:
    """Return the load's row: six numbers (`settings`), the reference, and the integral part as state."""
    reference = (load.reference, measured.dimension, f"{path[:-1]}.reference]")
    return Row(joint=load.joint, laws=(reference,), numbers=settings(load, path, coordinate, measured), states=STATES)
