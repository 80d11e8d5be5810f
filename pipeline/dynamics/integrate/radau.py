r"""Radau IIA of order 5: implicit, L-stable, for stiff friction, stiff contacts and stiff modes.

The displacements Z of the three stages are found by a simplified Newton iteration. Transformed by the eigenvectors of
the inverse Butcher matrix, its linear systems are parted into a real and a complex one, :math:`(\mu/h) I - J`; the
Jacobian J is made by finite differences and kept while iterations converge fast. The error estimate is filtered by the
real system; dense output is the collocation polynomial.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.5 (table 5.6) and IV.8.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import hermite
from flexclear.pipeline.dynamics.integrate.method import Method, slope
from flexclear.pipeline.dynamics.integrate.newton import (
    PERTURBATION,
    converged,
    lu_factor,
    lu_factor_complex,
    lu_solve,
    lu_solve_complex,
)
from flexclear.pipeline.dynamics.integrate.norms import error_scale, finite, scaled_norm, set_error_scales
from flexclear.pipeline.dynamics.kernels import kernel

# rows of SLOPES: start of the step, three stages, its end, error estimate, search for events
LAST, ESTIMATE, ROWS, ERROR_ORDER = 4, 5, 7, 3
S6 = np.sqrt(6.0)
C = np.array([(4.0 - S6) / 10.0, (4.0 + S6) / 10.0, 1.0])
#: weights of the stages in the error estimate
E = np.array([-13.0 - 7.0 * S6, -13.0 + 7.0 * S6, -1.0]) / 3.0
#: eigenvalues of the inverse Butcher matrix, a real one and MU_REST +- i MU_IMAG, and its eigenvectors
MU_REAL = 3.0 + 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0)
MU_REST = 3.0 + 0.5 * (3.0 ** (1.0 / 3.0) - 3.0 ** (2.0 / 3.0))
MU_IMAG = -0.5 * (3.0 ** (5.0 / 6.0) + 3.0 ** (7.0 / 6.0))
T = np.array(
    [
        [0.09443876248897524, -0.14125529502095421, 0.03002919410514742],
        [0.25021312296533332, 0.20412935229379994, -0.38294211275726192],
        [1.0, 1.0, 0.0],
    ]
)
T_INVERSE = np.array(
    [
        [4.17871859155190428, 0.32768282076106237, 0.52337644549944951],
        [-4.17871859155190428, -0.32768282076106237, 0.47662355450055044],
        [0.50287263494578682, -2.57192694985560522, 0.59603920482822492],
    ]
)
#: coefficients of theta, theta^2, theta^3 in the collocation polynomial, per stage
P = np.array(
    [
        [13.0 / 3.0 + 7.0 * S6 / 3.0, -23.0 / 3.0 - 22.0 * S6 / 3.0, 10.0 / 3.0 + 5.0 * S6],
        [13.0 / 3.0 - 7.0 * S6 / 3.0, -23.0 / 3.0 + 22.0 * S6 / 3.0, 10.0 / 3.0 - 5.0 * S6],
        [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
    ]
)
MOST_ITERATIONS = 7
#: corrections that fall slower than this ask for a new Jacobian at the next step
SLOW = 0.3

# Memory between steps ------------------------------------------------------------------------------------------------
# step of the factors, whether the Jacobian still holds, length of the step before (0: none); then vectors over the
# state, three of a kind and four of the polynomial; then the Jacobian, the factors of both systems, and their pivots
FACTORED_STEP, JACOBIAN_HOLDS, LAST_STEP, VECTORS = range(4)
#: kinds of vectors: Z, Z transformed, Newton's corrections of that, polynomial of the step before
Z, TRANSFORMED, CORRECTION, POLYNOMIAL = range(4)
N_VECTORS = 13
#: the linear systems
REAL, COMPLEX = range(2)


def memory(h: np.ndarray) -> int:
    """Floats kept between steps."""
    ny = int(h[m.NY])
    return VECTORS + N_VECTORS * ny + 4 * ny * ny + 2 * ny


@kernel
def stage_vector(h, kind, i):
    """Where w holds vector i of a kind."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * (3 * kind + i)


@kernel
def jacobian_entry(h, i, k):
    """Where w holds an entry of the Jacobian."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * N_VECTORS + h[m.NY] * i + k


@kernel
def factors(h, system):
    """Where w holds the factors of a system."""
    size = h[m.NY]
    return jacobian_entry(h, h[m.NY], 0) + system * size * size


@kernel
def pivots(h, system):
    """Where w holds the row exchanges of a system's factors, behind one real and one complex matrix."""
    return factors(h, 3) + h[m.NY] * system


# Linear systems ------------------------------------------------------------------------------------------------------
@kernel
def factorise(h, w, step):
    """Factors of both systems for a step; False when one is singular."""
    size, real, rest = h[m.NY], factors(h, REAL), factors(h, COMPLEX)
    for i in range(size):
        for k in range(size):
            entry, o = w[jacobian_entry(h, i, k)], size * i + k
            w[real + o] = w[rest + o] = -entry
            w[rest + size * size + o] = 0.0
        w[real + (size + 1) * i] += MU_REAL / step
        w[rest + (size + 1) * i] += MU_REST / step
        w[rest + size * size + (size + 1) * i] = MU_IMAG / step
    w[h[m.MEMORY] + FACTORED_STEP] = step
    return lu_factor(w, real, pivots(h, REAL), size) and lu_factor_complex(w, rest, pivots(h, COMPLEX), size)


@kernel
def solve_real(h, w, b):
    """Solve the real system in place for the right-hand side from place b."""
    lu_solve(w, factors(h, REAL), pivots(h, REAL), h[m.NY], b)


@kernel
def solve_complex(h, w, b, d):
    """Solve the complex system in place: real part of the right-hand side from place b, imaginary part from d."""
    lu_solve_complex(w, factors(h, COMPLEX), pivots(h, COMPLEX), h[m.NY], b, d)


# Collocation polynomial ----------------------------------------------------------------------------------------------
@kernel
def coefficient(h, w, c, k):
    """Coefficient of theta^(k + 1) for state variable c."""
    return (
        P[0, k] * w[stage_vector(h, Z, 0) + c]
        + P[1, k] * w[stage_vector(h, Z, 1) + c]
        + P[2, k] * w[stage_vector(h, Z, 2) + c]
    )


@kernel
def write_polynomial(h, w, out):
    """The polynomial of the present step into four vectors from place out."""
    for c in range(h[m.NY]):
        w[out + c] = w[h[m.Y] + c]
        for k in range(3):
            w[out + h[m.NY] * (k + 1) + c] = coefficient(h, w, c, k)


@kernel
def extend(h, f, w, n, step):
    """Prepare the dense output: the polynomial, a cubic."""
    write_polynomial(h, w, h[m.DENSE])


@kernel
def keep(h, f, w, n, step):
    """The polynomial of an accepted step predicts the stages of the next."""
    write_polynomial(h, w, stage_vector(h, POLYNOMIAL, 0))
    w[h[m.MEMORY] + LAST_STEP] = step


@kernel
def begin(h, f, w, n):
    """No polynomial is known; the Jacobian holds until the iteration says otherwise, whatever the contacts' modes."""
    w[h[m.MEMORY] + LAST_STEP] = 0.0


# Newton's iteration --------------------------------------------------------------------------------------------------
@kernel
def transform(h, w, matrix, source, target):
    """Three vectors of one kind as combinations of those of another."""
    for c in range(h[m.NY]):
        a = w[stage_vector(h, source, 0) + c]
        b = w[stage_vector(h, source, 1) + c]
        d = w[stage_vector(h, source, 2) + c]
        for i in range(3):
            w[stage_vector(h, target, i) + c] = matrix[i, 0] * a + matrix[i, 1] * b + matrix[i, 2] * d


@kernel
def predict(h, w, step):
    """Stages from the polynomial of the step before; without one, positions move on with their rates at the start.

    Not speeds, whose rates at the start may be far from those of a stiff step. Positions must: at rest where a contact
    begins the first iterate would not touch, and the force, seen by the second one only, would look like divergence.
    """
    length, o, size = w[h[m.MEMORY] + LAST_STEP], stage_vector(h, POLYNOMIAL, 0), h[m.NY]
    for i in range(3):
        x = 1.0 + C[i] * step / length if length > 0.0 else 0.0
        for c in range(size):
            rise = (w[o + 3 * size + c] * x + w[o + 2 * size + c]) * x + w[o + size + c]
            extrapolated = w[o + c] + rise * x - w[h[m.Y] + c]
            along = C[i] * step * w[h[m.SLOPES] + c] if c < h[m.NQ] else 0.0
            w[stage_vector(h, Z, i) + c] = extrapolated if length > 0.0 else along
    transform(h, w, T_INVERSE, Z, TRANSFORMED)


@kernel
def residuals(h, w, step):
    """Right-hand sides of the systems, from the stages' slopes."""
    size, first = h[m.NY], slope(h, 1)
    for c in range(size):
        a, b, d = w[first + c], w[first + size + c], w[first + 2 * size + c]
        one = w[stage_vector(h, TRANSFORMED, 0) + c] / step
        two = w[stage_vector(h, TRANSFORMED, 1) + c] / step
        three = w[stage_vector(h, TRANSFORMED, 2) + c] / step
        for i in range(3):
            total = T_INVERSE[i, 0] * a + T_INVERSE[i, 1] * b + T_INVERSE[i, 2] * d
            if i == 0:
                total -= MU_REAL * one
            elif i == 1:
                total -= MU_REST * two - MU_IMAG * three
            else:
                total -= MU_REST * three + MU_IMAG * two
            w[stage_vector(h, CORRECTION, i) + c] = total


@kernel
def correct(h, w):
    """Add the corrections; their norm in units of the tolerance."""
    total = 0.0
    for c in range(h[m.NY]):
        scale = error_scale(h, w, c)
        for i in range(3):
            change = w[stage_vector(h, CORRECTION, i) + c]
            w[stage_vector(h, TRANSFORMED, i) + c] += change
            total += (change / scale) ** 2
    transform(h, w, T, TRANSFORMED, Z)
    return np.sqrt(total / (3.0 * h[m.NY]))


@kernel
def estimate(h, w, step, start):
    """Norm of the filtered error, left in row ESTIMATE, from a slope at (or near) the start of the step."""
    out = slope(h, ESTIMATE)
    for c in range(h[m.NY]):
        bent = 0.0
        for i in range(3):
            bent += E[i] * w[stage_vector(h, Z, i) + c]
        w[out + c] = w[start + c] + bent / step
    solve_real(h, w, out)
    return scaled_norm(h, w, out)


def make_kernels(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""

    @kernel
    def jacobian(h, f, w, n):
        """Change of all rates with all variables, at the start of the step; works and losses change none."""
        size, near = h[m.NY], slope(h, 1)
        works = h[m.NQ] + h[m.NV]
        states = works + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * h[m.N_CONTACTS]
        for c in range(size):
            w[h[m.Y_STAGE] + c] = w[h[m.Y] + c]
        for k in range(size):
            if works <= k < states:
                for i in range(size):
                    w[jacobian_entry(h, i, k)] = 0.0
                continue
            y = w[h[m.Y] + k]
            w[h[m.Y_STAGE] + k] = y + PERTURBATION * (
                f[m.FLOORS.row(h, m.GROUPS.group(h, k)) + m.FLOORS.natural] + abs(y)
            )
            change = w[h[m.Y_STAGE] + k] - y
            evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y_STAGE], near)
            n[m.EVALUATIONS] += 1
            if n[m.EVALUATION] != m.OK:
                return False
            for i in range(size):
                difference = w[near + i] - w[h[m.SLOPES] + i]
                w[jacobian_entry(h, i, k)] = difference / change
            w[h[m.Y_STAGE] + k] = y
        n[m.JACOBIANS] += 1
        w[h[m.MEMORY] + JACOBIAN_HOLDS], w[h[m.MEMORY] + FACTORED_STEP] = 1.0, 0.0
        return True

    @kernel
    def iterate(h, f, w, n, step):
        """Newton's iterations: rate at which the corrections fell, or -1 when they did not."""
        size, last_norm, rate = h[m.NY], 0.0, 0.0
        for k in range(MOST_ITERATIONS):
            for i in range(3):
                for c in range(size):
                    w[h[m.Y_STAGE] + c] = w[h[m.Y] + c] + w[stage_vector(h, Z, i) + c]
                t = w[h[m.CONTROL] + m.TIME] + C[i] * step
                evaluate(h, f, w, n, t, h[m.Y_STAGE], slope(h, i + 1))
                n[m.EVALUATIONS] += 1
                if n[m.EVALUATION] != m.OK:
                    return -1.0
            residuals(h, w, step)
            solve_real(h, w, stage_vector(h, CORRECTION, 0))
            solve_complex(h, w, stage_vector(h, CORRECTION, 1), stage_vector(h, CORRECTION, 2))
            norm = correct(h, w)
            rate = norm / last_norm if k > 0 else 0.0
            verdict = converged(k, norm, last_norm, w[h[m.CONTROL] + m.RTOL])
            if verdict != 0:
                return rate if verdict > 0 else -1.0
            last_norm = norm
        return -1.0

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when Newton's iteration fails with a fresh Jacobian too."""
        o = h[m.MEMORY]
        set_error_scales(h, f, w, h[m.Y])
        for _ in range(2):
            fresh = w[o + JACOBIAN_HOLDS] == 0.0
            if fresh and not jacobian(h, f, w, n):
                return False
            if w[o + FACTORED_STEP] != step and not factorise(h, w, step):
                return False
            predict(h, w, step)
            rate = iterate(h, f, w, n, step)
            if rate >= 0.0:
                w[o + JACOBIAN_HOLDS] = 1.0 if rate <= SLOW else 0.0
                for c in range(h[m.NY]):
                    w[h[m.Y_NEW] + c] = w[h[m.Y] + c] + w[stage_vector(h, Z, 2) + c]
                return True
            w[o + JACOBIAN_HOLDS] = 0.0
            if fresh:
                return False
        return False

    @kernel
    def error(h, f, w, n, step):
        """Norm of the local error, 1 at the tolerance; what is too large is filtered twice."""
        norm, out, near = estimate(h, w, step, slope(h, 0)), slope(h, ESTIMATE), slope(h, 1)
        if norm > 1.0:
            for c in range(h[m.NY]):
                w[h[m.Y_STAGE] + c] = w[h[m.Y] + c] + w[out + c]
            evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y_STAGE], near)
            n[m.EVALUATIONS] += 1
            if n[m.EVALUATION] == m.OK and finite(h, w, near):
                norm = estimate(h, w, step, near)
            n[m.EVALUATION] = m.OK
        return norm

    return begin, attempt, error, extend, keep


METHOD = Method(
    traits=INTEGRATORS["radau"],
    slopes=ROWS,
    last=LAST,
    dense=hermite.ROWS,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    error_order=ERROR_ORDER,
    steady=1.2,
    memory=memory,
)
