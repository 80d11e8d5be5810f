"""The contact of a ball in a socket, for the second derivations.

Wang & Wang (2019), eqs. (21)-(29): both forces act at one point on the line of centres, on the
ball's surface; friction acts against the sliding of the material points there.
"""

from dataclasses import dataclass

import numpy as np

from tests.reference import sps4
from tests.reference.contact_solutions import modified_coulomb
from tests.reference.ideal_motion import cross

Array = np.ndarray


@dataclass(frozen=True)
class Touch:
    """The contact now: gap [m], rate of penetration [m/s], normal force [N], force on the ball.

    reach: from the ball's centre to the point where the forces act [m].
    """

    gap: float
    rate: float
    normal: float
    force: Array
    reach: Array


def press(
    c: sps4.Contact, offset: Array, velocity: Array, ball_omega: Array, socket_omega: Array, latched: float | None
) -> Touch:
    """Geometry and forces of the contact; without a latched impact rate [m/s] there is no force.

    offset, velocity: of the ball's centre relative to the socket's, world axes [m, m/s].
    """
    distance = np.sqrt(offset @ offset)
    if latched is None or distance == 0.0:
        rate = offset @ velocity / distance if distance > 0.0 else 0.0
        return Touch(c.clearance - distance, float(rate), 0.0, np.zeros(3), np.zeros(3))
    n = offset / distance
    rate = n @ velocity
    depth = max(0.0, distance - c.clearance)
    normal = max(0.0, c.stiffness * depth**1.5 * (1.0 + c.hysteresis * rate / latched))
    reach = c.ball_radius * n
    slip = velocity + cross(ball_omega, reach) - cross(socket_omega, offset + reach)
    slip = slip - (n @ slip) * n
    speed = np.sqrt(slip @ slip)
    force = -normal * n
    if speed > 0.0:
        mu = modified_coulomb(speed, c.mu_static, c.mu_dynamic, c.v_static, c.v_dynamic)
        force = force - normal * mu * slip / speed
    return Touch(c.clearance - distance, float(rate), float(normal), force, reach)
