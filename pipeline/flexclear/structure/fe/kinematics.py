r"""Kinematics of cross sections: the fields of a cell, their strains, and the motion of the section.

Bernoulli (Euler-Bernoulli and Rayleigh beams): sections stay normal to the axis; deflections are Hermite cubics.
Timoshenko: sections turn by :math:`\psi` on their own, shear strain :math:`\gamma = v' - \psi`. Deflections are
cubic and rotations quadratic, so that :math:`v'` and :math:`\psi` span the same polynomials: slender cells do not lock
(as :math:`\gamma\to 0` the Hermite cubics remain), and frequencies converge with the fourth power of the cell
length.
Without the unknowns inside, condensed statically as in the elements with interdependent interpolation, the shear strain
of a cell is constant, and frequencies converge with the second power only.

Both have the same unknowns at a node: u, twist, v, slope of v, w, slope of w. Unknowns inside a cell are extra.
Source: Reddy (1997), Comput. Methods Appl. Mech. Eng. 149, 113-132 (interdependent interpolation, consistency of
degrees); Przemieniecki (1968), ch. 5 and 11.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from skfem.element.discrete_field import DiscreteField
from skfem.element.element import Element
from skfem.element.element_h1 import ElementH1
from skfem.refdom import RefLine

#: unknowns of a node in scikit-fem's order, as indices of ux uy uz rx ry rz, with sign: ry = -slope of w
NODE_COMPONENT = (0, 3, 1, 5, 2, 4)
NODE_SIGN = (1.0, 1.0, 1.0, 1.0, 1.0, -1.0)


#: ascending power coefficients on [0, 1] of: value at 0, slope at 0, value at 1, slope at 1
HERMITE = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])


class LocalHermite(Element):
    """Cubic Hermite element with nodal unknowns u and du/dx, evaluated in the cell's own coordinate.

    scikit-fem's `ElementLineHermite` inverts a Vandermonde matrix in global coordinates: the stiffness is wrong by
    3e-11 (12 cells), 5e-9 (64) and 5e-7 (256) relative on a rod that starts at the origin, and a second mesh silently
    reuses the first one's inverse. This element is exact to rounding and stores nothing between calls.
    """

    nodal_dofs = 2
    maxdeg = 3
    dofnames: ClassVar[list[str]] = ["u", "u_x"]
    doflocs = np.array([[0.0], [0.0], [1.0], [1.0]])
    refdom = RefLine

    def gbasis(self, mapping: Any, X: np.ndarray, i: int, tind: np.ndarray | None = None) -> tuple[DiscreteField]:
        """Return basis function i with its first and second derivative at local points X, shape (1, points)."""
        h = mapping.detDF(X, tind)  # (cells, points): the signed length of each cell
        scale = np.ones_like(h) if i % 2 == 0 else h
        s = np.broadcast_to(X[0], h.shape)
        value, slope, curvature = (_polynomial_at(HERMITE[i], s, order) for order in range(3))
        return (
            DiscreteField(
                value=scale * value,
                grad=(scale * slope / h)[None],
                hess=(scale * curvature / h**2)[None, None],
            ),
        )


#: ascending power coefficients on [0, 1]: the two nodal functions, then the bubbles 4 s (1-s) and 8 s (1-s) (2s-1)
BUBBLES = (
    np.array([1.0, -1.0]),
    np.array([0.0, 1.0]),
    np.array([0.0, 4.0, -4.0]),
    np.array([0.0, -8.0, 24.0, -16.0]),
)


class Hierarchical(ElementH1):
    """Continuous element of degree one to three: nodal values, and `degree` - 1 bubbles that vanish at both ends.

    A field that is linear along the rod, as in every rigid motion, then depends on its nodal values alone.
    scikit-fem's own hierarchical element stores the values of its last call; this one stores nothing.
    """

    nodal_dofs = 1
    refdom = RefLine

    def __init__(self, degree: int) -> None:
        self.interior_dofs = degree - 1
        self.maxdeg = degree
        self.dofnames = ["u"] + ["bubble"] * (degree - 1)
        self.doflocs = np.array([[0.0], [1.0]] + [[np.nan]] * (degree - 1))

    def lbasis(self, X: np.ndarray, i: int) -> tuple[Any, Any]:
        """Return function i and its derivative at local points X, shape (1, points)."""
        return _polynomial_at(BUBBLES[i], X[0]), _polynomial_at(BUBBLES[i], X[0], 1)[None]


def _polynomial_at(coefficients: np.ndarray, s: np.ndarray, order: int = 0) -> np.ndarray:
    return np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(coefficients, order))


@dataclass(frozen=True)
class Kinematics:
    """Kinematics of one beam theory.

    elements: elements of the fields, from the degrees of extension and twist.
    component: index of each field among ux uy uz rx ry rz.
    strains: strains by name, from the fields.  section: (u, v, w) and (twist, slope of v, slope of w), from the fields.
    """

    elements: Callable[[int, int], list[Element]]
    component: tuple[int, ...]
    strains: Callable[..., dict[str, Any]]
    section: Callable[..., tuple[tuple[Any, ...], tuple[Any, ...]]]


BERNOULLI = Kinematics(
    elements=lambda extension, twist: [Hierarchical(extension), Hierarchical(twist), LocalHermite(), LocalHermite()],
    component=(0, 3, 1, 2),
    strains=lambda u, t, v, w: _strains(u, t, v.hess[0][0], w.hess[0][0]),
    section=lambda u, t, v, w: ((u, v, w), (t, v.grad[0], w.grad[0])),
)
TIMOSHENKO = Kinematics(
    elements=lambda extension, twist: [Hierarchical(degree) for degree in (extension, twist, 3, 2, 3, 2)],
    component=(0, 3, 1, 5, 2, 4),
    strains=lambda u, t, v, a, w, b: (
        _strains(u, t, a.grad[0], b.grad[0]) | {"shear_v": v.grad[0] - a, "shear_w": w.grad[0] - b}
    ),
    section=lambda u, t, v, a, w, b: ((u, v, w), (t, a, b)),
)


def _strains(u: Any, t: Any, bend_v: Any, bend_w: Any) -> dict[str, Any]:
    return {"stretch": u.grad[0], "twist": t.grad[0], "bend_v": bend_v, "bend_w": bend_w}


#: kinematics by the recipe's name of the theory; Euler-Bernoulli and Rayleigh differ in the mass alone
THEORIES = {"euler-bernoulli": BERNOULLI, "rayleigh": BERNOULLI, "timoshenko": TIMOSHENKO}
