"""Exact solutions of uniform rods, written down independently of the package's own closed forms."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Rod:
    """A uniform round rod, SI; `rotary` scales the rotary inertia (0 for Euler-Bernoulli)."""

    length: float
    radius: float
    youngs_modulus: float
    density: float
    poisson: float
    rotary: float = 1.0

    @property
    def area(self) -> float:
        """A [m^2]."""
        return float(np.pi * self.radius**2)

    @property
    def second_moment(self) -> float:
        """I [m^4]."""
        return float(np.pi * self.radius**4 / 4.0)

    @property
    def shear_modulus(self) -> float:
        """G [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))


#: Wang & Wang (2019), Table 2
PAPER_ROD = Rod(length=0.24, radius=0.01, youngs_modulus=7.17e10, density=2740.0, poisson=0.33)


def rayleigh_frequencies(rod: Rod, ends: str, count: int) -> np.ndarray:
    """The lowest bending frequencies [Hz] from the full 4x4 boundary determinant.

    ends: two letters, one per end: C clamped, F free, P pinned.  Solution: v = a cos + b sin + c cosh + d sinh
    with E I v'''' + rho I w^2 v'' - rho A w^2 v = 0, shear force E I v''' + rho I w^2 v'.
    """
    return scan(lambda omega: _determinant(rod, ends, omega), _start(rod), count) / (2.0 * np.pi)


def _start(rod: Rod) -> float:
    speed = np.sqrt(rod.youngs_modulus * rod.second_moment / (rod.density * rod.area))
    # below the first root of every pair of ends here: beta L = 1.875 for clamped-free
    return float((1.2 / rod.length) ** 2 * speed)


def scan(function: Callable[[float], float], start: float, count: int) -> np.ndarray:
    """Roots by sign changes, 1 % apart, from `start` on; shape (count,)."""
    roots: list[float] = []
    low = start
    while len(roots) < count:
        high = low * 1.01
        if function(low) * function(high) < 0.0:
            roots.append(float(brentq(function, low, high, rtol=1e-14)))
        low = high
    return np.array(roots)


def _determinant(rod: Rod, ends: str, omega: float) -> float:
    ei, mass = rod.youngs_modulus * rod.second_moment, rod.density * rod.area
    spin = rod.rotary * rod.density * rod.second_moment * omega**2
    root = np.sqrt((spin / (2.0 * ei)) ** 2 + mass * omega**2 / ei)
    beta, alpha = np.sqrt(root + spin / (2.0 * ei)), np.sqrt(root - spin / (2.0 * ei))
    rows = []
    for end, x in zip(ends, (0.0, rod.length), strict=True):
        v = _derivatives(alpha, beta, x)
        conditions = {"C": (v[0], v[1]), "P": (v[0], v[2]), "F": (v[2], ei * v[3] + spin * v[1])}
        rows += [row / np.abs(row).max() for row in conditions[end]]
    return float(np.linalg.det(np.array(rows)))


def _derivatives(alpha: float, beta: float, x: float) -> list[np.ndarray]:
    c, s, ch, sh = np.cos(beta * x), np.sin(beta * x), np.cosh(alpha * x), np.sinh(alpha * x)
    return [
        np.array([c, s, ch, sh]),
        np.array([-beta * s, beta * c, alpha * sh, alpha * ch]),
        np.array([-(beta**2) * c, -(beta**2) * s, alpha**2 * ch, alpha**2 * sh]),
        np.array([beta**3 * s, -(beta**3) * c, alpha**3 * sh, alpha**3 * ch]),
    ]


def cantilever_compliance(rod: Rod) -> np.ndarray:
    """Displacement and rotation of the free end per force and moment there, ux uy uz rx ry rz, clamped at x = 0.

    Shape (6, 6), SI; rz = dv/dx, ry = -dw/dx.
    """
    length, bending = rod.length, rod.youngs_modulus * rod.second_moment
    result = np.diag(
        [
            length / (rod.youngs_modulus * rod.area),
            length**3 / (3.0 * bending),
            length**3 / (3.0 * bending),
            length / (rod.shear_modulus * 2.0 * rod.second_moment),
            length / bending,
            length / bending,
        ]
    )
    result[1, 5] = result[5, 1] = length**2 / (2.0 * bending)
    result[2, 4] = result[4, 2] = -(length**2) / (2.0 * bending)
    return result


def element_stiffness(rod: Rod, h: float) -> np.ndarray:
    """Przemieniecki (1968), eq. (5.116) without shear: 12x12, both nodes ux uy uz rx ry rz, SI."""
    ea, gj = rod.youngs_modulus * rod.area, rod.shear_modulus * 2.0 * rod.second_moment
    ei = rod.youngs_modulus * rod.second_moment
    result = np.zeros((12, 12))
    for dof, stiffness in ((0, ea / h), (3, gj / h)):
        result[np.ix_([dof, dof + 6], [dof, dof + 6])] = stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    plane = (
        ei
        / h**3
        * np.array(
            [
                [12.0, 6.0 * h, -12.0, 6.0 * h],
                [6.0 * h, 4.0 * h**2, -6.0 * h, 2.0 * h**2],
                [-12.0, -6.0 * h, 12.0, -6.0 * h],
                [6.0 * h, 2.0 * h**2, -6.0 * h, 4.0 * h**2],
            ]
        )
    )
    result[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])] = plane
    turn = np.array([1.0, -1.0, 1.0, -1.0])  # ry = -dw/dx
    result[np.ix_([2, 4, 8, 10], [2, 4, 8, 10])] = plane * np.outer(turn, turn)
    return result
