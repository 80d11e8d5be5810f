"""Explicit Runge-Kutta method of order 5 by Dormand and Prince, dense output of order 4; for loose tolerances.

Source: Dormand & Prince (1980), *J. Comput. Appl. Math.* 6, 19-26; dense output: Hairer, Norsett & Wanner,
*Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.5 and II.6 (Shampine's formula in dopri5.f).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.method import Method, begin_afresh, keep_nothing, slope
from flexclear.dynamics.integrate.norms import error_scale
from flexclear.dynamics.integrate.runge_kutta import make_dense, make_stages
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

STAGES, ERROR_ORDER = 6, 4
A = np.zeros((STAGES, STAGES))
A[1, :1] = [1 / 5]
A[2, :2] = [3 / 40, 9 / 40]
A[3, :3] = [44 / 45, -56 / 15, 32 / 9]
A[4, :4] = [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]
A[5, :5] = [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]
B = np.array([35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])
C = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0])
#: weights of the slopes, that at the end included, in the error estimate and in the dense output
E = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
D = np.array(
    [
        [
            -12715105075 / 11282082432,
            0.0,
            87487479700 / 32700410799,
            -10690763975 / 1880347072,
            701980252875 / 199316789632,
            -1453857185 / 822651844,
            69997945 / 29380423,
        ]
    ]
)


@kernel
def error(d, step):
    """Return the norm of the local error, 1 at the tolerance."""
    total = 0.0
    for c in range(d.ny):
        weighted = 0.0
        for j in range(STAGES + 1):
            weighted += E[j] * d.w[slope(d, j) + c]
        total += (step * weighted / error_scale(d, c)) ** 2
    return np.sqrt(total / d.ny)


extend, interpolate = make_dense(STAGES, D)


def make_kernels(evaluate: Callable, lists: object) -> tuple:
    """Build the method's kernels."""
    _, proceed = make_stages(evaluate, A, B, C, ends=True)  # the error estimate needs the slope there
    return begin_afresh, proceed, error, extend, keep_nothing


METHOD = Method(
    traits=INTEGRATORS["dopri5"],
    room=m.Room(STAGES + 2, 5),
    last=STAGES,
    make_kernels=make_kernels,
    interpolate=interpolate,
    error_order=ERROR_ORDER,
    staged=True,
    ends=True,
    stability=3.25,  # Hairer & Wanner, Solving Ordinary Differential Equations II, sec. IV.2, and their code
)
