r"""Shapes of the elastic rod for the second derivation: beam elements written out, mass as points.

Craig-Bampton subspace with both ends held: six displacements and rotations of the upper end, three
bending modes in each plane and one of torsion.  The rod is then 192 mass points, four at each Gauss
point of an element, placed so that they have the section's area and second moments; every inertial
term of the moving rod is a sum over them, without shape integrals.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh

Array = np.ndarray
#: Wang & Wang (2019), Table 2
LENGTH, RADIUS, DENSITY, YOUNGS_MODULUS, POISSON = 0.24, 0.01, 2740.0, 7.17e10, 0.33
ELEMENTS, BENDING, GAUSS = 12, 3, 4
AREA = np.pi * RADIUS**2
SECOND = np.pi * RADIUS**4 / 4.0
SHEAR_MODULUS = YOUNGS_MODULUS / (2.0 * (1.0 + POISSON))
STEP = LENGTH / ELEMENTS


@dataclass(frozen=True)
class Rod:
    """Mass points of a rod along z, its lower end at the origin, and its shapes.

    mass: (points,) [kg]; place: (points, 3) [m]; shape: (points, 3, n) displacement per coordinate;
    tip_shape, tip_turn: displacement and rotation vector of the upper end, (3, n); stiffness: (n, n).
    """

    mass: Array
    place: Array
    shape: Array
    tip_shape: Array
    tip_turn: Array
    stiffness: Array


def hermite(x: Array) -> Array:
    """Bending shapes of an element at x in [0, 1]: rows w, w', w''; last axis (w0, w0', w1, w1')."""
    h = STEP
    w = [1 - 3 * x**2 + 2 * x**3, h * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, h * (x**3 - x**2)]
    d = [(6 * x**2 - 6 * x) / h, 1 - 4 * x + 3 * x**2, (6 * x - 6 * x**2) / h, 3 * x**2 - 2 * x]
    dd = [(12 * x - 6) / h**2, (6 * x - 4) / h, (6 - 12 * x) / h**2, (6 * x - 2) / h]
    return np.stack([np.stack(row, axis=-1) for row in (w, d, dd)])


def gauss() -> tuple[Array, Array]:
    """Points and weights on [0, 1]."""
    x, weight = np.polynomial.legendre.leggauss(GAUSS)
    return 0.5 * (x + 1.0), 0.5 * weight


def bending_basis() -> tuple[Array, Array]:
    """Nodal values (w, w') of the static and fixed bending shapes, (2 nodes, 2 + BENDING), and their stiffness."""
    n = 2 * (ELEMENTS + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    x, weight = gauss()
    w, d, dd = hermite(x)
    k = YOUNGS_MODULUS * SECOND * STEP * np.einsum("g,gi,gj->ij", weight, dd, dd)
    m = DENSITY * STEP * np.einsum("g,gi,gj->ij", weight, w, w) * AREA
    m += DENSITY * STEP * np.einsum("g,gi,gj->ij", weight, d, d) * SECOND
    for e in range(ELEMENTS):
        span = slice(2 * e, 2 * e + 4)
        K[span, span] += k
        M[span, span] += m
    z = np.linspace(0.0, 1.0, ELEMENTS + 1)
    static = np.zeros((n, 2))
    static[0::2, 0], static[1::2, 0] = 3 * z**2 - 2 * z**3, (6 * z - 6 * z**2) / LENGTH
    static[0::2, 1], static[1::2, 1] = LENGTH * (z**3 - z**2), 3 * z**2 - 2 * z
    inner = slice(2, n - 2)
    _, modes = eigh(K[inner, inner], M[inner, inner], subset_by_index=[0, BENDING - 1])
    basis = np.column_stack([static, np.vstack([np.zeros((2, BENDING)), modes, np.zeros((2, BENDING))])])
    return basis, basis.T @ K @ basis


def rod() -> Rod:
    """The paper's rod; coordinates: bending along x (5), along y (5), torsion (2), stretch (1)."""
    bending, bending_stiffness = bending_basis()
    z = np.linspace(0.0, 1.0, ELEMENTS + 1)
    torsion = np.column_stack([z, np.sin(np.pi * z)])
    slope = np.diff(torsion, axis=0) / STEP
    twisting = SHEAR_MODULUS * 2.0 * SECOND * STEP * slope.T @ slope
    stretching = np.array([[YOUNGS_MODULUS * AREA / LENGTH]])
    b, n = bending.shape[1], 2 * bending.shape[1] + 3
    x, weight = gauss()
    w, d, _ = hermite(x)
    masses, places, shapes = [], [], []
    # points at this distance on both section axes have the section's second moments
    away = RADIUS / np.sqrt(2.0)
    for e in range(ELEMENTS):
        nodal = bending[2 * e : 2 * e + 4]
        for g in range(GAUSS):
            deflection, turn = w[g] @ nodal, d[g] @ nodal
            twist = (1.0 - x[g]) * torsion[e] + x[g] * torsion[e + 1]
            height = (e + x[g]) * STEP
            for X, Y in ((away, 0.0), (-away, 0.0), (0.0, away), (0.0, -away)):
                S = np.zeros((3, n))
                S[0, :b], S[2, :b] = deflection, -X * turn
                S[1, b : 2 * b], S[2, b : 2 * b] = deflection, -Y * turn
                S[0, 2 * b : 2 * b + 2], S[1, 2 * b : 2 * b + 2] = -Y * twist, X * twist
                S[2, n - 1] = height / LENGTH
                masses.append(0.25 * DENSITY * AREA * STEP * weight[g])
                places.append([X, Y, height])
                shapes.append(S)
    tip_shape, tip_turn = np.zeros((3, n)), np.zeros((3, n))
    tip_shape[0, :b] = tip_shape[1, b : 2 * b] = bending[-2]
    tip_turn[1, :b], tip_turn[0, b : 2 * b] = bending[-1], -bending[-1]
    tip_turn[2, 2 * b : 2 * b + 2], tip_shape[2, n - 1] = torsion[-1], 1.0
    stiffness = block_diag(bending_stiffness, bending_stiffness, twisting, stretching)
    return Rod(np.array(masses), np.array(places), np.array(shapes), tip_shape, tip_turn, stiffness)
