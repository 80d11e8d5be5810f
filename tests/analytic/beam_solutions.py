"""Exact solutions of rods, written down independently of the package's own closed forms."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg
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


# Stepped rods with masses --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Piece:
    """A uniform piece along x, SI.  shear: kappa G A along y and z, infinite without shear deformation.

    rotary: rho times the second moments (polar, about y, about z).
    """

    length: float
    axial: float
    twist: float
    bend: tuple[float, float]
    line_mass: float
    rotary: tuple[float, float, float]
    shear: tuple[float, float] = (math.inf, math.inf)


@dataclass(frozen=True)
class Lump:
    """Mass, centre seen from the node, and inertia about it, at the end of piece `after` (-1: the start)."""

    after: int
    mass: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)


def exact_frequencies(
    pieces: list[Piece], lumps: list[Lump], held: tuple[str, str], count: int, *, parts: int = 3
) -> np.ndarray:
    """The lowest elastic frequencies [Hz].  held: dofs at the start and at the end, digits of ux uy uz rx ry rz."""
    size = 6 * (len(pieces) * parts + 1)
    fixed = [int(d) for d in held[0]] + [size - 6 + int(d) for d in held[1]]
    free = np.setdiff1d(np.arange(size), fixed)

    @cache  # roots next to each other are bracketed by the same steps
    def below(omega: float) -> int:
        D = _assembled(pieces, lumps, omega, parts)[np.ix_(free, free)]
        # unit diagonal: extension is a million times stiffer than bending
        scale = 1.0 / np.sqrt(np.abs(D.diagonal()))
        return int(np.count_nonzero(np.linalg.eigvalsh(D * np.outer(scale, scale)) < 0.0))

    low = 2.0 * math.pi * 0.1
    rigid = below(low)
    return np.array([_root(below, rigid + k, low) for k in range(count)]) / (2.0 * math.pi)


def _root(below: object, index: int, low: float) -> float:
    high = 2.0 * low
    while below(high) <= index:  # type: ignore[operator]
        low, high = high, 2.0 * high
    while high - low > 1e-10 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if below(middle) > index else (middle, high)  # type: ignore[operator]
    return 0.5 * (low + high)


def _assembled(pieces: list[Piece], lumps: list[Lump], omega: float, parts: int) -> np.ndarray:
    D = np.zeros((6 * (len(pieces) * parts + 1),) * 2)
    for k, piece in enumerate(pieces):
        member = _member(piece, piece.length / parts, omega)
        for j in range(k * parts, (k + 1) * parts):
            D[6 * j : 6 * j + 12, 6 * j : 6 * j + 12] += member
    for lump in lumps:
        start = 6 * (lump.after + 1) * parts
        x, y, z = lump.offset
        arm = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # theta x r = arm theta
        motion = np.hstack([np.eye(3), arm])
        M = lump.mass * motion.T @ motion
        M[3:, 3:] += np.diag(lump.inertia)
        D[start : start + 6, start : start + 6] -= omega**2 * M
    return D


def _member(piece: Piece, h: float, omega: float) -> np.ndarray:
    D = np.zeros((12, 12))
    polar, about_y, about_z = piece.rotary
    D[np.ix_([0, 6], [0, 6])] = _wave(piece.axial, piece.line_mass, h, omega)
    D[np.ix_([3, 9], [3, 9])] = _wave(piece.twist, polar, h, omega)
    in_y, in_z = [1, 5, 7, 11], [2, 4, 8, 10]
    sign = np.array([1.0, -1.0, 1.0, -1.0])  # ry = -dw/dx
    # piece.bend is about y, about z; deflection in y bends about z
    D[np.ix_(in_y, in_y)] = _bending(piece.bend[1], piece.line_mass, about_z, piece.shear[0], h, omega)
    D[np.ix_(in_z, in_z)] = np.outer(sign, sign) * _bending(
        piece.bend[0], piece.line_mass, about_y, piece.shear[1], h, omega
    )
    return D


def _wave(stiffness: float, inertia: float, h: float, omega: float) -> np.ndarray:
    """Solve u' = N / stiffness, N' = -inertia omega^2 u."""
    return _from_transfer(scipy.linalg.expm(h * np.array([[0.0, 1.0 / stiffness], [-inertia * omega**2, 0.0]])), 1)


def _bending(ei: float, line: float, rotary: float, shear: float, h: float, omega: float) -> np.ndarray:
    """Solve v' = psi + Q / shear, psi' = M / EI, Q' = -rho A omega^2 v, M' = -Q - rho I omega^2 psi."""
    A = np.zeros((4, 4))  # order v, psi, Q, M
    A[0, 1], A[0, 2], A[1, 3] = 1.0, 1.0 / shear, 1.0 / ei
    A[2, 0], A[3, 1], A[3, 2] = -line * omega**2, -rotary * omega**2, -1.0
    # lengths in h and forces in EI / h^2, so that the exponential has entries of one size
    S = np.array([h, 1.0, ei / h**2, ei / h])
    T = scipy.linalg.expm(h * A * S[None, :] / S[:, None])
    scale = np.array([h, 1.0, h, 1.0])
    force = np.array([ei / h**2, ei / h] * 2)
    return force[:, None] * _from_transfer(T, 2) / scale[None, :]


def _from_transfer(T: np.ndarray, n: int) -> np.ndarray:
    """Dynamic stiffness, forces (-f at the start, f at the end) per displacement, of a transfer matrix."""
    a, b, c, d = T[:n, :n], T[:n, n:], T[n:, :n], T[n:, n:]
    inverse = np.linalg.inv(b)
    D = np.block([[inverse @ a, -inverse], [c - d @ inverse @ a, d @ inverse]])
    return np.asarray(0.5 * (D + D.T)) if n == 1 else D
