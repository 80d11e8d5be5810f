r"""The ideal mechanism: motion from leg lengths, and reactions.

Pose, velocity and acceleration of the platform from the four leg lengths, by Newton's method.

Unknowns: height z of the platform origin, which the central chain keeps on the z axis, and the
rotation R.  With :math:`d_k = z e_z + R a_k - B_k`, each leg says :math:`d_k\cdot d_k = l_k^2`;
its first and second time derivatives are linear in speeds and accelerations.

Joint reactions and drive forces of the ideal mechanism, by Newton-Euler on free bodies.

A leg's ball joints carry no moment about its axis and its bodies are round, so its spin keeps the
value 0 it starts with: with u along the leg, :math:`\Omega = u\times\dot u` and
:math:`\dot\Omega = u\times\ddot u`.  The leg's moment balance about B gives the part across the
leg of the force at A; the platform's six balances then give the four axial forces and the two
horizontal forces at C, the vertical one there being fixed by the sliding central chain.
"""

from dataclasses import dataclass

import numpy as np

from tests.reference import sps4

Array = np.ndarray
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Motion:
    """Platform motion: heights [m], R platform -> world, angular quantities in world axes.

    legs: vectors B_k -> A_k and their derivatives, shape (4, 3) each [m, m/s, m/s^2].
    jacobian: rows d l_k / d (z', omega), shape (4, 4).
    """

    layout: sps4.Layout
    height: float
    rotation: Array
    speed: float
    omega: Array
    acceleration: float
    alpha: Array
    legs: tuple[Array, Array, Array]
    jacobian: Array

    @property
    def tilt(self) -> float:
        """Rotation about y0 as the paper's tables mean it [rad]."""
        return float(np.arcsin(self.rotation[0, 2]))


def skew(v: Array) -> Array:
    """Matrix of the cross product."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def exponential(v: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = np.sqrt(v @ v)
    K = skew(v)
    if angle < 1e-4:
        return np.eye(3) + K * (1.0 - angle**2 / 6.0) + K @ K * (0.5 - angle**2 / 24.0)
    return np.eye(3) + K * (np.sin(angle) / angle) + K @ K * ((1.0 - np.cos(angle)) / angle**2)


def cross(a: Array, b: Array) -> Array:
    """Row-wise cross product; np.cross costs several times as much on so few rows."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az = a.T
    bx, by, bz = b.T
    out.T[0], out.T[1], out.T[2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def pose(layout: sps4.Layout, lengths: Array, height: float, rotation: Array) -> tuple[float, Array]:
    """Height and rotation that fit the leg lengths, from a guess on the same branch.

    Raises ArithmeticError when Newton's method does not converge.
    """
    for _ in range(30):
        arms = layout.A @ rotation.T
        d = height * UP + arms - layout.B
        defect = np.sum(d * d, axis=1) - lengths**2
        step = np.linalg.solve(np.column_stack([2.0 * d[:, 2], 2.0 * cross(arms, d)]), -defect)
        height += step[0]
        rotation = exponential(step[1:]) @ rotation
        # quadratic convergence: the step after one of 1e-9 is below rounding
        if np.abs(step).max() < 1e-9:
            return height, rotation
    raise ArithmeticError(f"no platform pose for the leg lengths {lengths.tolist()} m")


def motion_at(
    layout: sps4.Layout, height: float, rotation: Array, lengths: Array, rates: Array, accelerations: Array
) -> Motion:
    """Platform motion in a pose that fits the leg lengths, for their derivatives; each shape (4,)."""
    arms = layout.A @ rotation.T
    d = height * UP + arms - layout.B
    jacobian = np.column_stack([d[:, 2], cross(arms, d)])
    twist = np.linalg.solve(jacobian, lengths * rates)
    omega = twist[1:]
    rate = twist[0] * UP + cross(omega, arms)
    centripetal = cross(omega, cross(omega, arms))
    known = rates**2 + lengths * accelerations - np.sum(rate * rate, axis=1) - np.sum(d * centripetal, axis=1)
    twist_rate = np.linalg.solve(jacobian, known)
    second = twist_rate[0] * UP + cross(twist_rate[1:], arms) + centripetal
    return Motion(
        layout=layout,
        height=float(height),
        rotation=rotation,
        speed=float(twist[0]),
        omega=omega,
        acceleration=float(twist_rate[0]),
        alpha=twist_rate[1:],
        legs=(d, rate, second),
        jacobian=jacobian / lengths[:, None],
    )


def motion(lengths: Array, rates: Array, accelerations: Array, guess: Motion) -> Motion:
    """Platform motion for leg lengths and their derivatives, each shape (4,), on the branch of the guess."""
    found = pose(guess.layout, lengths, guess.height, guess.rotation)
    return motion_at(guess.layout, *found, lengths, rates, accelerations)


def ideal(layout: sps4.Layout, times: Array, side: Array | int = 1) -> list[Motion]:
    """The ideal mechanism's motion at ascending times [s]; side: which limit at a drive break."""
    sides = np.broadcast_to(side, np.shape(times))
    height, rotation, found, before = layout.height, np.eye(3), [], 0.0
    for t, s in zip(np.asarray(times, dtype=float), sides, strict=True):
        # short walks keep Newton's method on the branch on which the mechanism was assembled
        for between in np.linspace(before, t, 2 + int((t - before) / 2e-3))[1:-1]:
            height, rotation = pose(layout, sps4.leg_lengths(layout, between)[0], height, rotation)
        lengths, rates, accelerations = sps4.leg_lengths(layout, t, int(s))
        here = pose(layout, lengths, height, rotation)
        found.append(motion_at(layout, *here, lengths, rates, accelerations))
        height, rotation, before = found[-1].height, found[-1].rotation, t
    return found


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
