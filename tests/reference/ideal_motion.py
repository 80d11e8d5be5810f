r"""Pose, velocity and acceleration of the platform from the four leg lengths, by Newton's method.

Unknowns: height z of the platform origin, which the central chain keeps on the z axis, and the
rotation R.  With :math:`d_k = z e_z + R a_k - B_k`, each leg says :math:`d_k\cdot d_k = l_k^2`;
its first and second time derivatives are linear in speeds and accelerations.
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
