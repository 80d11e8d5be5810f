"""Simeon's slider-crank, derived apart from the engine: a planar floating frame between the pins of the rod.

Unknowns: the rod's angle, amplitudes of sines across it and of quarter waves along it.  The virtual power of the rod's
mass points and of the slider, with the crank's rotation given and the slider's height as the one constraint,
reduced by projection on the motions that the constraint leaves free.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

CRANK, LENGTH, SIDE = 0.15, 0.30, 0.008
DENSITY, YOUNG, SLIDER, SPEED = 7870.0, 2e11, 0.075552, 150.0
AREA, SECOND = SIDE**2, SIDE**4 / 12.0
POINTS = 40


@dataclass(frozen=True)
class Shapes:
    """Displacements at the Gauss points, in axes of the rod: (points, 2, modes); at its far end; stiffness (modes,)."""

    x: np.ndarray
    mass: np.ndarray
    inside: np.ndarray
    end: np.ndarray
    stiffness: np.ndarray


def shapes(bending: int, axial: int) -> Shapes:
    """The lowest sines and quarter waves."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    x, w = 0.5 * LENGTH * (nodes + 1.0), 0.5 * LENGTH * weights
    n = bending + axial
    inside, end, stiffness = np.zeros((POINTS, 2, n)), np.zeros((2, n)), np.zeros(n)
    for k in range(bending):
        number = (k + 1) * np.pi / LENGTH
        inside[:, 1, k] = np.sin(number * x)
        stiffness[k] = YOUNG * SECOND * number**4 * LENGTH / 2.0
    for k in range(axial):
        number = (k + 0.5) * np.pi / LENGTH
        inside[:, 0, bending + k], end[0, bending + k] = np.sin(number * x), np.sin(number * LENGTH)
        stiffness[bending + k] = YOUNG * AREA * number**2 * LENGTH / 2.0
    return Shapes(x, DENSITY * AREA * w, inside, end, stiffness)


def _point(angle: float, rate: float, local: np.ndarray, shape: np.ndarray, speeds: np.ndarray):
    """Jacobian (..., 2, 1 + modes) and acceleration without that of the unknowns, of points of the rod from its pin."""
    c, s = np.cos(angle), np.sin(angle)
    A, turned = np.array([[c, -s], [s, c]]), np.array([[-s, -c], [c, -s]])
    J = np.concatenate([(local @ turned.T)[..., None], A @ shape], axis=-1)
    bias = -(rate**2) * local @ A.T + 2.0 * rate * (shape @ speeds) @ turned.T
    return J, bias


def _equations(shape: Shapes, t: float, y: np.ndarray):
    """Mass matrix, forces, the constraint's row and right-hand side; unknowns: angle, then amplitudes."""
    n = len(shape.stiffness) + 1
    q, v = y[:n], y[n:]
    pin = -(SPEED**2) * CRANK * np.array([np.cos(SPEED * t), np.sin(SPEED * t)])
    local = shape.inside @ q[1:] + np.stack([shape.x, 0.0 * shape.x], axis=1)
    J, bias = _point(q[0], v[0], local, shape.inside, v[1:])
    M = np.einsum("p,pai,paj->ij", shape.mass, J, J)
    f = -np.einsum("p,pai,pa->i", shape.mass, J, bias + pin)
    f[1:] -= shape.stiffness * q[1:]
    far, far_bias = _point(q[0], v[0], np.array([LENGTH, 0.0]) + shape.end @ q[1:], shape.end, v[1:])
    far_bias = far_bias + pin
    M += SLIDER * np.outer(far[0], far[0])
    f -= SLIDER * far[0] * far_bias[0]
    return M, f, far[1], -far_bias[1]


def _rates(shape: Shapes, t: float, y: np.ndarray) -> np.ndarray:
    n = len(y) // 2
    M, f, row, right = _equations(shape, t, y)
    inverse = np.linalg.solve(M, np.stack([f, row], axis=1))
    push = (right - row @ inverse[:, 0]) / (row @ inverse[:, 1])
    return np.concatenate([y[n:], inverse[:, 0] + push * inverse[:, 1]])


def solve(times: np.ndarray, bending: int, axial: int, rtol: float = 1e-11) -> dict[str, np.ndarray]:
    """Slider's place and speed [m, m/s] and the middle's deflection across the rod [m] at times that begin at 0."""
    shape = shapes(bending, axial)
    n = 1 + bending + axial
    start = np.zeros(2 * n)
    start[n] = -SPEED * CRANK / LENGTH
    found = solve_ivp(
        lambda t, y: _rates(shape, t, y), (0.0, float(times[-1])), start, "DOP853", times, rtol=rtol, atol=1e-3 * rtol
    )
    q, v = found.y[:n].T, found.y[n:].T
    middle = np.array([np.sin((k + 1) * np.pi / 2.0) for k in range(bending)])
    along, stretch = LENGTH + q[:, 1:] @ shape.end[0], v[:, 1:] @ shape.end[0]
    angle, rate = q[:, 0], v[:, 0]
    return {
        "slider": CRANK * np.cos(SPEED * times) + along * np.cos(angle),
        "speed": -SPEED * CRANK * np.sin(SPEED * times) + stretch * np.cos(angle) - along * rate * np.sin(angle),
        "deflection": q[:, 1 : 1 + bending] @ middle,
        "height": CRANK * np.sin(SPEED * times) + along * np.sin(angle),
    }
