"""Fit of the force of a finite film to solutions of Reynolds' equation in two dimensions.

The pressure is a series of cosines along the axis, each with an equation around it, which finite volumes solve between
nodes at equal distances of Sommerfeld's angle: these are dense where the film is thin. The ratio to the harmonic mean
of short and long bearing is a polynomial in the logarithm of the least thickness and in the direction of motion.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from scipy.linalg import solveh_banded

from flexclear.dynamics.loads.half_circle import half_circle

#: intervals around the half journal, on the coarser of two grids; cosines along the axis
INTERVALS, COSINES = 120, 16
#: eccentricity that stands for the middle
MIDDLE = 1e-3


@lru_cache(maxsize=64)
def fit_ratios(slenderness: float, least: float, orders: tuple[int, int]) -> list[float]:
    """Return the numbers that `film.ratios` takes.

    slenderness: radius over length.  least: least thickness over clearance.
    """
    x, y = (chebyshev.chebpts1(order) for order in orders)
    size = (1.0 - least ** (0.5 * (x + 1.0)))[:, None]
    q = np.sqrt(1.0 - size * size)
    a = size * q * np.sinh(y * np.arcsinh(1.0 / q))
    b = np.sqrt(np.maximum(size * size - a * a, 0.0))
    middle = _ratio(np.array([[0.6 * MIDDLE]]), np.array([[0.8 * MIDDLE]]), slenderness)[:, 0, 0]
    values = (_ratio(a, b, slenderness) - middle[:, None, None]) / size
    to_x, to_y = (np.linalg.inv(chebyshev.chebvander(at, len(at) - 1)) for at in (x, y))
    return [1.0 / np.log(least), *middle, *(to_x @ values @ to_y.T).ravel()]


def _ratio(a: np.ndarray, b: np.ndarray, slenderness: float) -> np.ndarray:
    """Return the ratios along and across the motion, (2, ...)."""
    whole = np.empty((2, *a.shape))
    for where in np.ndindex(a.shape):
        fine, coarse = (integrals(float(a[where]), float(b[where]), slenderness, n) for n in (2 * INTERVALS, INTERVALS))
        short, long = (np.array([one[0], one[1] * b[where]]) for one in half_circle(a[where], b[where]))
        long = 12.0 * slenderness**2 * long
        whole[(slice(None), *where)] = (4.0 * fine - coarse) / 3.0 * (short + long) / (short * long)
    return whole


def integrals(a: float, b: float, slenderness: float, intervals: int) -> np.ndarray:
    """Return the force along and across the motion in units of that of the short bearing, shape (2,)."""
    size, towards = np.hypot(a, b), np.arctan2(b, a)
    stretch = np.sqrt((1.0 + size) / (1.0 - size))
    edges = np.array([-0.5, 0.5]) * np.pi - towards
    turns = 2.0 * np.pi * np.round(edges / (2.0 * np.pi))
    ends = 2.0 * np.arctan(stretch * np.tan(0.5 * (edges - turns))) + turns
    angle = np.linspace(ends[0], ends[1], 2 * intervals + 1)  # nodes, with the middles between them
    turns = 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    psi = 2.0 * np.arctan(np.tan(0.5 * (angle - turns)) / stretch) + turns + towards
    h = (1.0 - a * np.cos(psi) - b * np.sin(psi)) ** 3
    nodes, middles = psi[::2], psi[1::2]
    conductance, mass = h[1::2] / np.diff(nodes), h[2:-1:2] * np.diff(middles)
    loads = np.stack([np.diff(np.sin(middles)), -np.diff(np.cos(middles))])
    total = np.zeros(2)
    for n in range(1, 2 * COSINES, 2):
        s = (1.0 / (n * np.pi * slenderness)) ** 2
        upper = np.append(0.0, -s * conductance[1:-1])
        pressure = solveh_banded(np.stack([upper, s * (conductance[1:] + conductance[:-1]) + mass]), loads[0])
        total += 96.0 / (np.pi * n) ** 4 * (loads @ pressure)
    return total
