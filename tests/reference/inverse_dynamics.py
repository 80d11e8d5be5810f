r"""Joint reactions and drive forces of the ideal mechanism, by Newton-Euler on free bodies.

A leg's ball joints carry no moment about its axis and its bodies are round, so its spin keeps the
value 0 it starts with: with u along the leg, :math:`\Omega = u\times\dot u` and
:math:`\dot\Omega = u\times\ddot u`.  The leg's moment balance about B gives the part across the
leg of the force at A; the platform's six balances then give the four axial forces and the two
horizontal forces at C, the vertical one there being fixed by the sliding central chain.
"""

from dataclasses import dataclass

import numpy as np

from tests.reference import sps4
from tests.reference.ideal_motion import UP, Motion, cross

Array = np.ndarray
WEIGHTLESS = np.zeros(3)


@dataclass(frozen=True)
class Reactions:
    """Forces at one instant, world axes [N].

    at_A: on the legs' upper balls by the platform, (4, 3). at_B: on the legs by the ground, (4, 3).
    at_C: on the central chain's ball by the platform, (3,). at_Z: on the central rod by the ground, (3,).
    drive: what the prismatic drives supply along the legs, (4,).
    across: on the rods by the cylinders, across the leg, (4, 3).
    """

    at_A: Array
    at_B: Array
    at_C: Array
    at_Z: Array
    drive: Array
    across: Array


@dataclass(frozen=True)
class LegLoads:
    """What the motion of legs demands, shape (legs, 3): axes; force across each leg at A; m a of the halves [N]."""

    axis: Array
    across_at_A: Array
    lower: Array
    upper: Array


def dot(a: Array, b: Array) -> Array:
    """Row-wise scalar product, shape (n, 1)."""
    return np.sum(a * b, axis=1, keepdims=True)


def leg_inertia(length: Array | float) -> tuple[Array | float, Array | float, Array | float]:
    """Transverse moment of inertia of a leg about B [kg m^2], its derivative by the length, first moment [kg m]."""
    _, first_low, second_low, _ = sps4.LOWER
    m_up, first_up, second_up, _ = sps4.UPPER
    about_B = second_low + second_up - 2.0 * length * first_up + m_up * length**2
    return about_B, 2.0 * (m_up * length - first_up), first_low + m_up * length - first_up


def leg_loads(d: Array, rate: Array, second: Array, gravity: Array) -> LegLoads:
    """Demands of legs whose vectors B -> A are d, with two time derivatives; all (legs, 3)."""
    length = np.sqrt(dot(d, d))
    u = d / length
    stretch = dot(u, rate)
    u_rate = (rate - stretch * u) / length
    # d = l u, twice differentiated
    stretch_rate = dot(u, second) + length * dot(u_rate, u_rate)
    u_second = (second - stretch_rate * u - 2.0 * stretch * u_rate) / length
    about_B, slope, weight_arm = leg_inertia(length)
    moment = about_B * cross(u, u_second) + slope * stretch * cross(u, u_rate) - weight_arm * cross(u, gravity)
    m_low, first_low, _, _ = sps4.LOWER
    m_up, first_up, _, _ = sps4.UPPER
    return LegLoads(
        axis=u,
        across_at_A=-cross(u, moment) / length,
        lower=first_low * u_second - m_low * gravity,
        upper=m_up * (second - gravity) - first_up * u_second,
    )


def platform_demand(m: Motion, plate: sps4.Plate, gravity: Array) -> tuple[Array, Array]:
    """Force and moment about the platform origin that the platform's motion demands, (3,) each."""
    centre = m.rotation @ plate.centre
    inertia = m.rotation @ plate.inertia @ m.rotation.T
    origin = m.acceleration * UP
    force = plate.mass * (origin + cross(m.alpha, centre) + cross(m.omega, cross(m.omega, centre)) - gravity)
    moment = inertia @ m.alpha + cross(m.omega, inertia @ m.omega) + plate.mass * cross(centre, origin - gravity)
    return force, moment


def reactions(m: Motion, gravity: Array = WEIGHTLESS, plate: sps4.Plate | None = None) -> Reactions:
    """All reactions of the ideal mechanism in the motion m."""
    plate = sps4.platform(m.layout) if plate is None else plate
    legs = leg_loads(*m.legs, gravity)
    u, across, arms = legs.axis, legs.across_at_A, m.layout.A @ m.rotation.T
    force, moment = platform_demand(m, plate, gravity)
    vertical = sps4.CENTRAL_MASS * (m.acceleration - gravity[2])
    # on the platform: -(T_k u_k + across_k) at A_k, -at_C at the origin
    force = force + across.sum(axis=0) + vertical * UP
    moment = moment + cross(arms, across).sum(axis=0)
    matrix = np.zeros((6, 6))
    matrix[:3, :4], matrix[3:, :4] = -u.T, -cross(arms, u).T
    matrix[0, 4] = matrix[1, 5] = -1.0
    unknown = np.linalg.solve(matrix, np.concatenate([force, moment]))
    at_A = across + unknown[:4, None] * u
    at_C = np.array([unknown[4], unknown[5], vertical])
    on_rod = legs.upper - at_A
    drive = dot(on_rod, u)
    return Reactions(
        at_A=at_A,
        at_B=legs.upper + legs.lower - at_A,
        at_C=at_C,
        at_Z=-(at_C + sps4.CENTRAL_MASS * gravity) * (1.0 - UP),
        drive=drive[:, 0],
        across=on_rod - drive * u,
    )
