"""The classical Runge-Kutta method of order 4, with fixed steps.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.1, table 1.2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import hermite
from flexclear.dynamics.integrate.method import Method, begin_afresh, keep_nothing
from flexclear.dynamics.integrate.runge_kutta import make_stages
from flexclear.scene.integrators import INTEGRATORS

STAGES = 4
A = np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
B = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
C = np.array([0.0, 0.5, 0.5, 1.0])


def make_kernels(evaluate: Callable, lists: object) -> tuple:
    """Build the method's kernels; the method has no error estimate."""
    _, proceed = make_stages(evaluate, A, B, C)
    return begin_afresh, proceed, None, hermite.make_extend(STAGES), keep_nothing


METHOD = Method(
    traits=INTEGRATORS["rk4"],
    room=m.Room(STAGES + 2, hermite.ROWS),
    last=STAGES,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    staged=True,
    stability=2.785,  # where its stability polynomial 1 + z + z^2/2 + z^3/6 + z^4/24 is 1
)
