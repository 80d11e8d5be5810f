"""The Gauss points of a beam cell, where sections are evaluated and energies summed."""

from __future__ import annotations

import numpy as np

#: exact to degree nine: cubic times cubic deflections on an area that tapers linearly in both directions
#: have degree eight, as have second moments (degree four) times quadratic slopes twice
_GAUSS = np.polynomial.legendre.leggauss(5)
#: points on [0, 1] and weights, shape (points,)
POINTS = 0.5 * (1.0 + _GAUSS[0])
WEIGHTS = 0.5 * _GAUSS[1]
