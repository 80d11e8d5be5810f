"""Exact solutions of uniform rods, written down independently of the package's own closed forms."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Rod:
    """A uniform round rod, SI."""

    length: float
    radius: float
    youngs_modulus: float
    density: float
    poisson: float

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
