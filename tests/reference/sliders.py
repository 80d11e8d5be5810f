"""A free rigid body whose points meet fixed planes through linear springs, integrated with SciPy."""

from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

#: a point of the body, a point of the plane, the plane's normal towards the body's point
Spring = tuple[np.ndarray, np.ndarray, np.ndarray]


def skew(a: np.ndarray) -> np.ndarray:
    """Matrix of a cross product."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def final_state(
    springs: Sequence[Spring],
    stiffness: float,
    radius: float,
    mass: float,
    inertia: Sequence[float],
    velocity: Sequence[float],
    omega: Sequence[float],
    seconds: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity, rotation matrix and angular velocity of the body, which starts at the origin, unturned.

    radius: of spheres about its points.  All about the centre of mass, in axes of the world.
    """
    points, faces, normals = (np.array(column) for column in zip(*springs, strict=True))
    J = np.diag(inertia)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        p, v, R, w = y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:]
        arms = points @ R.T
        depth = radius - np.sum(normals * (p + arms - faces), axis=1)
        forces = stiffness * np.maximum(depth, 0.0)[:, None] * normals
        moment = np.cross(arms, forces).sum(axis=0)
        J_world = R @ J @ R.T
        turning = np.linalg.solve(J_world, moment - np.cross(w, J_world @ w))
        return np.concatenate([v, forces.sum(axis=0) / mass, (skew(w) @ R).ravel(), turning])

    start = np.concatenate([np.zeros(3), velocity, np.eye(3).ravel(), omega])
    # a step is far shorter than a contact, which lasts pi sqrt(mass/stiffness) or longer
    longest = 0.05 * np.sqrt(mass / stiffness)
    y = solve_ivp(rates, (0.0, seconds), start, method="DOP853", rtol=1e-12, atol=1e-13, max_step=longest).y[:, -1]
    return y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:]
