r"""Radau IIA of order 5: implicit, L-stable, for stiff friction, stiff contacts and stiff modes.

A simplified Newton iteration computes the displacements Z of the three stages. Transformed by the eigenvectors of the
inverse Butcher matrix, its linear systems split into a real and a complex one, :math:`(\mu/h) I - J`. Finite
differences give the Jacobian J, which serves as long as iterations converge fast. The error estimate is filtered by the
real system; dense output is the collocation polynomial.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.5 (table 5.6) and IV.8.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import hermite, newton
from flexclear.dynamics.integrate.method import Method, matrix, slope, vector
from flexclear.dynamics.integrate.norms import error_scale, finite, scaled_norm, set_error_scales
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

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

# Memory between steps ------------------------------------------------------------------------------------------------
#: vectors: three each of Z, of the transformed Z and of its Newton corrections (`correction`), four of the previous
#: step's polynomial; row exchanges of the factors of a real and of a complex system
Z, TRANSFORMED, CORRECTION, POLYNOMIAL = range(0, 12, 3)
REAL_PIVOTS, COMPLEX_PIVOTS, VECTORS = range(POLYNOMIAL + 4, POLYNOMIAL + 7)
#: matrices: after the Jacobian the factors of both systems
REAL, COMPLEX, MATRICES = 1, 2, 4


# Linear systems ------------------------------------------------------------------------------------------------------
@kernel
def factorise(d, step):
    """Factorise both systems for a step; return False when one is singular."""
    size, jacobian, real, rest = d.ny, matrix(d, newton.JACOBIAN), matrix(d, REAL), matrix(d, COMPLEX)
    for o in range(size * size):
        d.w[real + o] = d.w[rest + 2 * o] = -d.w[jacobian + o]
        d.w[rest + 2 * o + 1] = 0.0
    for o in range(0, size * size, size + 1):
        d.w[real + o] += MU_REAL / step
        d.w[rest + 2 * o] += MU_REST / step
        d.w[rest + 2 * o + 1] = MU_IMAG / step
    d.memory[newton.FACTORED_STEP] = step
    real_pivots, complex_pivots = vector(d, REAL_PIVOTS), vector(d, COMPLEX_PIVOTS)
    return newton.lu_factor(d.w, real, real_pivots, size) and newton.lu_factor_complex(d.w, rest, complex_pivots, size)


@kernel
def solve_real(d, b):
    """Solve the real system in place for the right-hand side at index b."""
    newton.lu_solve(d.w, matrix(d, REAL), vector(d, REAL_PIVOTS), d.ny, b)


@kernel
def correction(d, i, c):
    """Return the index in w of the correction of transformed stage i and variable c; the last two form one number."""
    return vector(d, CORRECTION) + c if i == 0 else vector(d, CORRECTION + 1) + 2 * c + i - 1


# Collocation polynomial ----------------------------------------------------------------------------------------------
@kernel
def coefficient(d, c, k):
    """Return the coefficient of theta^(k + 1) for state variable c."""
    z, size = vector(d, Z), d.ny
    return P[0, k] * d.w[z + c] + P[1, k] * d.w[z + size + c] + P[2, k] * d.w[z + 2 * size + c]


@kernel
def write_polynomial(d, out):
    """Store the polynomial of the present step in four vectors from index out."""
    for c in range(d.ny):
        d.w[out + c] = d.y[c]
        for k in range(3):
            d.w[out + d.ny * (k + 1) + c] = coefficient(d, c, k)


@kernel
def extend(d, step):
    """Prepare the dense output: the collocation polynomial, a cubic."""
    write_polynomial(d, d.at_dense)


@kernel
def keep(d, step):
    """Store the polynomial of an accepted step, which predicts the stages of the next."""
    write_polynomial(d, vector(d, POLYNOMIAL))
    d.memory[newton.LAST_STEP] = step


@kernel
def begin(d):
    """Discard the polynomial; the Jacobian serves until iterations converge slowly, whatever the contacts' modes."""
    d.memory[newton.LAST_STEP] = 0.0


# Newton's iteration --------------------------------------------------------------------------------------------------
@kernel
def transform(d, T, source, target):
    """Store three vectors at target as combinations T of three vectors at source."""
    for c in range(d.ny):
        a = d.w[vector(d, source) + c]
        b = d.w[vector(d, source + 1) + c]
        e = d.w[vector(d, source + 2) + c]
        for i in range(3):
            d.w[vector(d, target + i) + c] = T[i, 0] * a + T[i, 1] * b + T[i, 2] * e


@kernel
def predict(d, step):
    """Predict the stages by the polynomial of the previous step; without one, positions advance at their start's rates.

    Speeds do not: their rates at the start may be far from those of a stiff step. Positions must: without this the
    first iterate at a contact's begin would have no penetration, and the force in the second would look like
    divergence.
    """
    length, o, size = d.memory[newton.LAST_STEP], vector(d, POLYNOMIAL), d.ny
    for i in range(3):
        x = 1.0 + C[i] * step / length if length > 0.0 else 0.0
        for c in range(size):
            rise = (d.w[o + 3 * size + c] * x + d.w[o + 2 * size + c]) * x + d.w[o + size + c]
            extrapolated = d.w[o + c] + rise * x - d.y[c]
            along = C[i] * step * d.slopes[c] if c < d.nq else 0.0
            d.w[vector(d, Z + i) + c] = extrapolated if length > 0.0 else along
    transform(d, T_INVERSE, Z, TRANSFORMED)


@kernel
def residuals(d, step):
    """Compute the right-hand sides of the systems from the stages' slopes."""
    size, first = d.ny, slope(d, 1)
    for c in range(size):
        a, b, e = d.w[first + c], d.w[first + size + c], d.w[first + 2 * size + c]
        one = d.w[vector(d, TRANSFORMED) + c] / step
        two = d.w[vector(d, TRANSFORMED + 1) + c] / step
        three = d.w[vector(d, TRANSFORMED + 2) + c] / step
        for i in range(3):
            total = T_INVERSE[i, 0] * a + T_INVERSE[i, 1] * b + T_INVERSE[i, 2] * e
            if i == 0:
                total -= MU_REAL * one
            elif i == 1:
                total -= MU_REST * two - MU_IMAG * three
            else:
                total -= MU_REST * three + MU_IMAG * two
            d.w[correction(d, i, c)] = total


@kernel
def correct(d):
    """Add the corrections; return their norm in units of the tolerance."""
    total = 0.0
    for c in range(d.ny):
        scale = error_scale(d, c)
        for i in range(3):
            change = d.w[correction(d, i, c)]
            d.w[vector(d, TRANSFORMED + i) + c] += change
            total += (change / scale) ** 2
    transform(d, T, TRANSFORMED, Z)
    return np.sqrt(total / (3.0 * d.ny))


@kernel
def estimate(d, step, start):
    """Return the norm of the filtered error (stored in row ESTIMATE), from a slope at or near the start of the step."""
    out = slope(d, ESTIMATE)
    for c in range(d.ny):
        bent = 0.0
        for i in range(3):
            bent += E[i] * d.w[vector(d, Z + i) + c]
        d.w[out + c] = d.w[start + c] + bent / step
    solve_real(d, out)
    return scaled_norm(d, out)


def make_kernels(evaluate: Callable, lists: object) -> tuple:
    """Build the method's kernels."""

    @kernel
    def iterate(d, step):
        """Iterate; return the rate at which the corrections fell, or -1 when they did not."""
        size, last_norm, rate = d.ny, 0.0, 0.0
        for k in range(MOST_ITERATIONS):
            for i in range(3):
                for c in range(size):
                    d.y_stage[c] = d.y[c] + d.w[vector(d, Z + i) + c]
                t = d.time + C[i] * step
                evaluate(d, t, d.at_y_stage, slope(d, i + 1))
                d.evaluations += 1
                if d.evaluation != m.OK:
                    return -1.0
            residuals(d, step)
            solve_real(d, vector(d, CORRECTION))
            pivots, rest = vector(d, COMPLEX_PIVOTS), vector(d, CORRECTION + 1)
            newton.lu_solve_complex(d.w, matrix(d, COMPLEX), pivots, size, rest)
            norm = correct(d)
            rate = norm / last_norm if k > 0 else 0.0
            verdict = newton.convergence(k, norm, last_norm, d.rtol)
            if verdict != 0:
                return rate if verdict > 0 else -1.0
            last_norm = norm
        return -1.0

    solve_step = newton.make_solve(newton.make_jacobian(evaluate), factorise, predict, iterate)

    @kernel
    def attempt(d, step):
        """Step from Y to Y_NEW; return False when Newton's iteration fails with a new Jacobian, too."""
        set_error_scales(d, d.at_y)
        if not solve_step(d, step):
            return False
        for c in range(d.ny):
            d.y_new[c] = d.y[c] + d.w[vector(d, Z + 2) + c]
        return True

    @kernel
    def error(d, step):
        """Return the norm of the local error, 1 at the tolerance; an error that is too large is filtered twice."""
        norm, out, near = estimate(d, step, slope(d, 0)), slope(d, ESTIMATE), slope(d, 1)
        if norm > 1.0:
            for c in range(d.ny):
                d.y_stage[c] = d.y[c] + d.w[out + c]
            evaluate(d, d.time, d.at_y_stage, near)
            d.evaluations += 1
            if d.evaluation == m.OK and finite(d, near):
                norm = estimate(d, step, near)
            d.evaluation = m.OK
        return norm

    return begin, attempt, error, extend, keep


METHOD = Method(
    traits=INTEGRATORS["radau"],
    room=m.Room(ROWS, hermite.ROWS, newton.FLOATS, VECTORS, MATRICES),
    last=LAST,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    error_order=ERROR_ORDER,
    steady=1.2,
)
