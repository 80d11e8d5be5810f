r"""The platform on legs 2, 3 and 4, with leg 1 replaced by a contact force at the socket A1.

The distance :math:`\lambda` from B1 to the socket's centre and the driven lengths of the other legs
fix the platform.  Its six balances are linear in :math:`\ddot\lambda`, three axial leg forces and
two horizontal forces at C.
"""

from dataclasses import dataclass

import numpy as np

from tests.reference import sps4
from tests.reference.ideal_motion import UP, Motion, cross, ideal, motion, motion_at
from tests.reference.inverse_dynamics import WEIGHTLESS, leg_loads, platform_demand

Array = np.ndarray
GRID = 1e-4


@dataclass(frozen=True)
class Setting:
    """What one run needs: contact data, platform, gravity, and ideal poses as guesses for Newton's method."""

    contact: sps4.Contact
    plate: sps4.Plate
    gravity: Array
    guesses: list[Motion]


def setting() -> Setting:
    """The paper's mechanism in the first layout, without weight."""
    times = np.arange(0.0, 0.18 + GRID / 2, GRID)
    guesses = ideal(sps4.FIRST, times, np.where(times < 0.18, 1, -1))
    return Setting(sps4.Contact(), sps4.platform(sps4.FIRST), WEIGHTLESS, guesses)


def platform_motion(s: Setting, t: float, side: int, distance: float, rate: float) -> Motion:
    """The platform's motion while the socket's distance from B1 has no second derivative."""
    guess = s.guesses[min(max(round(t / GRID), 0), len(s.guesses) - 1)]
    return motion(*_lengths(t, side, distance, rate, 0.0), guess)


def _lengths(t: float, side: int, distance: float, rate: float, second: float) -> tuple[Array, Array, Array]:
    lengths, rates, accelerations = sps4.leg_lengths(sps4.FIRST, t, side)
    lengths[0], rates[0], accelerations[0] = distance, rate, second
    return lengths, rates, accelerations


def demand(s: Setting, m: Motion) -> tuple[Array, Array, Array]:
    """Six balances of platform, legs 2..4 and central chain in the motion m; axes of and arms to legs 2..4."""
    legs = leg_loads(*(part[1:] for part in m.legs), s.gravity)
    arms = m.layout.A[1:] @ m.rotation.T
    force, moment = platform_demand(m, s.plate, s.gravity)
    force = force + legs.across_at_A.sum(axis=0) + sps4.CENTRAL_MASS * (m.acceleration - s.gravity[2]) * UP
    moment = moment + cross(arms, legs.across_at_A).sum(axis=0)
    return np.concatenate([force, moment]), legs.axis, arms


def socket_acceleration(
    s: Setting, t: float, side: int, distance: float, rate: float, m: Motion, point: Array, force: Array
) -> float:
    """Second derivative of the socket's distance from B1 [m/s^2].

    m: the motion with zero for it. force: on leg 1's ball by the socket, acting at `point`, world axes.
    """
    base, axes, arms = demand(s, m)
    # the demand is linear in the unknown: one more evaluation, at 1 m/s^2, gives its column
    faster = motion_at(m.layout, m.height, m.rotation, *_lengths(t, side, distance, rate, 1.0))
    matrix = np.zeros((6, 6))
    matrix[:, 0] = demand(s, faster)[0] - base
    matrix[:3, 1:4], matrix[3:, 1:4] = axes.T, cross(arms, axes).T
    matrix[0, 4] = matrix[1, 5] = 1.0
    applied = -np.concatenate([force, cross(point - m.height * UP, force)])
    return float(np.linalg.solve(matrix, applied - base)[0])
