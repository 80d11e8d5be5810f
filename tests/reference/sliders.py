"""Free rigid bodies that linear springs hold in fixed guides and journals, integrated with SciPy."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

#: a point of the body, a point of the plane, the plane's normal towards the body's point
Spring = tuple[np.ndarray, np.ndarray, np.ndarray]
#: forces on the body at a position and rotation, and the points where they act, (n, 3) each
Push = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def skew(a: np.ndarray) -> np.ndarray:
    """Matrix of a cross product."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def corners(springs: Sequence[Spring], stiffness: float, radius: float = 0.0) -> Push:
    """Forces of planes on points of the body; radius: of spheres about these."""
    points, faces, normals = (np.array(column) for column in zip(*springs, strict=True))

    def push(p: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = p + points @ R.T
        depth = radius - np.sum(normals * (at - faces), axis=1)
        return stiffness * np.maximum(depth, 0.0)[:, None] * normals, at - radius * normals

    return push


def rims(length: float, radius: float, clearance: float, stiffness: float) -> Push:
    """Forces of a fixed journal's two ends on a pin about z of the body, at the ends' rims; radius: of the pin."""

    def push(p: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        centres = np.array([[0.0, 0.0, 0.5 * length], [0.0, 0.0, -0.5 * length]])
        away = centres - p - np.outer((centres - p) @ R[:, 2], R[:, 2])
        distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-30)
        normals = away / distance
        depth = np.maximum(distance - clearance, 0.0)
        return stiffness * depth * normals, centres - (radius + clearance) * normals

    return push


def final_state(
    push: Push,
    longest: float,
    mass: float,
    inertia: Sequence[float],
    velocity: Sequence[float],
    omega: Sequence[float],
    seconds: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity, rotation matrix and angular velocity of the body, which starts at the origin, unturned.

    longest: step [s], far shorter than a contact.  All about the centre of mass, in axes of the world.
    """
    J = np.diag(inertia)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        p, v, R, w = y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:]
        forces, points = push(p, R)
        moment = np.cross(points - p, forces).sum(axis=0)
        J_world = R @ J @ R.T
        turning = np.linalg.solve(J_world, moment - np.cross(w, J_world @ w))
        return np.concatenate([v, forces.sum(axis=0) / mass, (skew(w) @ R).ravel(), turning])

    start = np.concatenate([np.zeros(3), velocity, np.eye(3).ravel(), omega])
    y = solve_ivp(rates, (0.0, seconds), start, method="DOP853", rtol=1e-12, atol=1e-13, max_step=longest).y[:, -1]
    return y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:]
