"""Cubic Hermite line element for scikit-fem, evaluated in the cell's own coordinate.

scikit-fem's `ElementLineHermite` inverts a Vandermonde matrix in global coordinates: the stiffness is
wrong by 3e-11 (12 cells), 5e-9 (64) and 5e-7 (256) relative on a rod that starts at the origin, and a
second mesh silently reuses the first one's inverse. This one is exact to rounding and keeps nothing.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from skfem.element.discrete_field import DiscreteField
from skfem.element.element import Element
from skfem.refdom import RefLine

#: ascending power coefficients on [0, 1] of: value at 0, slope at 0, value at 1, slope at 1
COEFFICIENTS = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])


class LocalHermite(Element):
    """Deflection and slope at both ends; nodal unknowns u and du/dx."""

    nodal_dofs = 2
    maxdeg = 3
    dofnames: ClassVar[list[str]] = ["u", "u_x"]
    doflocs = np.array([[0.0], [0.0], [1.0], [1.0]])
    refdom = RefLine

    def gbasis(self, mapping: Any, X: np.ndarray, i: int, tind: np.ndarray | None = None) -> tuple[DiscreteField]:
        """Basis function i with first and second derivative at local points X, shape (1, points)."""
        h = mapping.detDF(X, tind)  # (cells, points): the length of each cell, signed
        scale = np.ones_like(h) if i % 2 == 0 else h
        s = np.broadcast_to(X[0], h.shape)
        value, slope, curvature = (_derivative(COEFFICIENTS[i], order, s) for order in range(3))
        return (
            DiscreteField(
                value=scale * value,
                grad=(scale * slope / h)[None],
                hess=(scale * curvature / h**2)[None, None],
            ),
        )


def _derivative(coefficients: np.ndarray, order: int, s: np.ndarray) -> np.ndarray:
    return np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(coefficients, order))
