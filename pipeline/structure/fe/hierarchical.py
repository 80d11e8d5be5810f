"""Continuous line element of degree one to three for scikit-fem: nodal values and bubbles that vanish at the nodes.

With bubbles, a field that is linear along the rod, as in every rigid motion, is given by its nodal values alone.
scikit-fem's own hierarchical element keeps the values of its last call; this one keeps nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from skfem.element.element_h1 import ElementH1
from skfem.refdom import RefLine

#: ascending power coefficients on [0, 1]: both nodal functions, then the bubbles 4 s (1-s) and 8 s (1-s) (2s-1)
COEFFICIENTS = (
    np.array([1.0, -1.0]),
    np.array([0.0, 1.0]),
    np.array([0.0, 4.0, -4.0]),
    np.array([0.0, -8.0, 24.0, -16.0]),
)


class Hierarchical(ElementH1):
    """Value at both ends and, inside, `degree` - 1 bubble amplitudes."""

    nodal_dofs = 1
    refdom = RefLine

    def __init__(self, degree: int) -> None:
        self.interior_dofs = degree - 1
        self.maxdeg = degree
        self.dofnames = ["u"] + ["bubble"] * (degree - 1)
        self.doflocs = np.array([[0.0], [1.0]] + [[np.nan]] * (degree - 1))

    def lbasis(self, X: np.ndarray, i: int) -> tuple[Any, Any]:
        """Function i and its derivative at local points X, shape (1, points)."""
        slope = np.polynomial.polynomial.polyder(COEFFICIENTS[i])
        return (
            np.polynomial.polynomial.polyval(X[0], COEFFICIENTS[i]),
            np.polynomial.polynomial.polyval(X[0], slope)[None],
        )
