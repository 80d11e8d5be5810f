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

from flexclear.pipeline.core.scene.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import hermite
from flexclear.pipeline.dynamics.integrate.method import Method, slope
from flexclear.pipeline.dynamics.integrate.newton import (
    COLUMN_STEP,
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
SLOW_CONVERGENCE = 0.3

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
def stage_vector(d, kind, i):
    """Where w holds vector i of a kind."""
    return d.at_memory + VECTORS + d.ny * (3 * kind + i)


@kernel
def jacobian_entry(d, i, k):
    """Where w holds an entry of the Jacobian."""
    return d.at_memory + VECTORS + d.ny * N_VECTORS + d.ny * i + k


@kernel
def factors(d, system):
    """Where w holds the factors of a system."""
    size = d.ny
    return jacobian_entry(d, d.ny, 0) + system * size * size


@kernel
def pivots(d, system):
    """Where w holds the row exchanges of a system's factors, behind one real and one complex matrix."""
    return factors(d, 3) + d.ny * system


# Linear systems ------------------------------------------------------------------------------------------------------
@kernel
def factorise(d, step):
    """Factors of both systems for a step; False when one is singular."""
    size, real, rest = d.ny, factors(d, REAL), factors(d, COMPLEX)
    for i in range(size):
        for k in range(size):
            entry, o = d.w[jacobian_entry(d, i, k)], size * i + k
            d.w[real + o] = d.w[rest + o] = -entry
            d.w[rest + size * size + o] = 0.0
        d.w[real + (size + 1) * i] += MU_REAL / step
        d.w[rest + (size + 1) * i] += MU_REST / step
        d.w[rest + size * size + (size + 1) * i] = MU_IMAG / step
    d.memory[FACTORED_STEP] = step
    return lu_factor(d.w, real, pivots(d, REAL), size) and lu_factor_complex(d.w, rest, pivots(d, COMPLEX), size)


@kernel
def solve_real(d, b):
    """Solve the real system in place for the right-hand side from place b."""
    lu_solve(d.w, factors(d, REAL), pivots(d, REAL), d.ny, b)


@kernel
def solve_complex(d, b, e):
    """Solve the complex system in place: real part of the right-hand side from place b, imaginary part from e."""
    lu_solve_complex(d.w, factors(d, COMPLEX), pivots(d, COMPLEX), d.ny, b, e)


# Collocation polynomial ----------------------------------------------------------------------------------------------
@kernel
def coefficient(d, c, k):
    """Coefficient of theta^(k + 1) for state variable c."""
    return (
        P[0, k] * d.w[stage_vector(d, Z, 0) + c]
        + P[1, k] * d.w[stage_vector(d, Z, 1) + c]
        + P[2, k] * d.w[stage_vector(d, Z, 2) + c]
    )


@kernel
def write_polynomial(d, out):
    """The polynomial of the present step into four vectors from place out."""
    for c in range(d.ny):
        d.w[out + c] = d.y[c]
        for k in range(3):
            d.w[out + d.ny * (k + 1) + c] = coefficient(d, c, k)


@kernel
def extend(d, step):
    """Prepare the dense output: the polynomial, a cubic."""
    write_polynomial(d, d.at_dense)


@kernel
def keep(d, step):
    """The polynomial of an accepted step predicts the stages of the next."""
    write_polynomial(d, stage_vector(d, POLYNOMIAL, 0))
    d.memory[LAST_STEP] = step


@kernel
def begin(d):
    """No polynomial is known; the Jacobian holds until the iteration says otherwise, whatever the contacts' modes."""
    d.memory[LAST_STEP] = 0.0


# Newton's iteration --------------------------------------------------------------------------------------------------
@kernel
def transform(d, matrix, source, target):
    """Three vectors of one kind as combinations of those of another."""
    for c in range(d.ny):
        a = d.w[stage_vector(d, source, 0) + c]
        b = d.w[stage_vector(d, source, 1) + c]
        e = d.w[stage_vector(d, source, 2) + c]
        for i in range(3):
            d.w[stage_vector(d, target, i) + c] = matrix[i, 0] * a + matrix[i, 1] * b + matrix[i, 2] * e


@kernel
def predict(d, step):
    """Stages from the polynomial of the step before; without one, positions move on with their rates at the start.

    Not speeds, whose rates at the start may be far from those of a stiff step. Positions must: at rest where a contact
    begins the first iterate would not touch, and the force, seen by the second one only, would look like divergence.
    """
    length, o, size = d.memory[LAST_STEP], stage_vector(d, POLYNOMIAL, 0), d.ny
    for i in range(3):
        x = 1.0 + C[i] * step / length if length > 0.0 else 0.0
        for c in range(size):
            rise = (d.w[o + 3 * size + c] * x + d.w[o + 2 * size + c]) * x + d.w[o + size + c]
            extrapolated = d.w[o + c] + rise * x - d.y[c]
            along = C[i] * step * d.slopes[c] if c < d.nq else 0.0
            d.w[stage_vector(d, Z, i) + c] = extrapolated if length > 0.0 else along
    transform(d, T_INVERSE, Z, TRANSFORMED)


@kernel
def residuals(d, step):
    """Right-hand sides of the systems, from the stages' slopes."""
    size, first = d.ny, slope(d, 1)
    for c in range(size):
        a, b, e = d.w[first + c], d.w[first + size + c], d.w[first + 2 * size + c]
        one = d.w[stage_vector(d, TRANSFORMED, 0) + c] / step
        two = d.w[stage_vector(d, TRANSFORMED, 1) + c] / step
        three = d.w[stage_vector(d, TRANSFORMED, 2) + c] / step
        for i in range(3):
            total = T_INVERSE[i, 0] * a + T_INVERSE[i, 1] * b + T_INVERSE[i, 2] * e
            if i == 0:
                total -= MU_REAL * one
            elif i == 1:
                total -= MU_REST * two - MU_IMAG * three
            else:
                total -= MU_REST * three + MU_IMAG * two
            d.w[stage_vector(d, CORRECTION, i) + c] = total


@kernel
def correct(d):
    """Add the corrections; their norm in units of the tolerance."""
    total = 0.0
    for c in range(d.ny):
        scale = error_scale(d, c)
        for i in range(3):
            change = d.w[stage_vector(d, CORRECTION, i) + c]
            d.w[stage_vector(d, TRANSFORMED, i) + c] += change
            total += (change / scale) ** 2
    transform(d, T, TRANSFORMED, Z)
    return np.sqrt(total / (3.0 * d.ny))


@kernel
def estimate(d, step, start):
    """Norm of the filtered error, left in row ESTIMATE, from a slope at (or near) the start of the step."""
    out = slope(d, ESTIMATE)
    for c in range(d.ny):
        bent = 0.0
        for i in range(3):
            bent += E[i] * d.w[stage_vector(d, Z, i) + c]
        d.w[out + c] = d.w[start + c] + bent / step
    solve_real(d, out)
    return scaled_norm(d, out)


def make_kernels(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""

    @kernel
    def jacobian(d):
        """Change of all rates with all variables, at the start of the step; works and losses change none."""
        size, near = d.ny, slope(d, 1)
        works = d.nq + d.nv
        states = works + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * d.n_contacts
        for c in range(size):
            d.y_stage[c] = d.y[c]
        for k in range(size):
            if works <= k < states:
                for i in range(size):
                    d.w[jacobian_entry(d, i, k)] = 0.0
                continue
            y = d.y[k]
            d.y_stage[k] = y + COLUMN_STEP * (d.floors[d.groups[k].group].natural + abs(y))
            change = d.y_stage[k] - y
            evaluate(d, d.time, d.at_y_stage, near)
            d.evaluations += 1
            if d.evaluation != m.OK:
                return False
            for i in range(size):
                difference = d.w[near + i] - d.slopes[i]
                d.w[jacobian_entry(d, i, k)] = difference / change
            d.y_stage[k] = y
        d.jacobians += 1
        d.memory[JACOBIAN_HOLDS], d.memory[FACTORED_STEP] = 1.0, 0.0
        return True

    @kernel
    def iterate(d, step):
        """Newton's iterations: rate at which the corrections fell, or -1 when they did not."""
        size, last_norm, rate = d.ny, 0.0, 0.0
        for k in range(MOST_ITERATIONS):
            for i in range(3):
                for c in range(size):
                    d.y_stage[c] = d.y[c] + d.w[stage_vector(d, Z, i) + c]
                t = d.time + C[i] * step
                evaluate(d, t, d.at_y_stage, slope(d, i + 1))
                d.evaluations += 1
                if d.evaluation != m.OK:
                    return -1.0
            residuals(d, step)
            solve_real(d, stage_vector(d, CORRECTION, 0))
            solve_complex(d, stage_vector(d, CORRECTION, 1), stage_vector(d, CORRECTION, 2))
            norm = correct(d)
            rate = norm / last_norm if k > 0 else 0.0
            verdict = converged(k, norm, last_norm, d.rtol)
            if verdict != 0:
                return rate if verdict > 0 else -1.0
            last_norm = norm
        return -1.0

    @kernel
    def attempt(d, step):
        """State Y_NEW after a step from Y; False when Newton's iteration fails with a fresh Jacobian too."""
        set_error_scales(d, d.at_y)
        for _ in range(2):
            fresh = d.memory[JACOBIAN_HOLDS] == 0.0
            if fresh and not jacobian(d):
                return False
            if d.memory[FACTORED_STEP] != step and not factorise(d, step):
                return False
            predict(d, step)
            rate = iterate(d, step)
            if rate >= 0.0:
                d.memory[JACOBIAN_HOLDS] = 1.0 if rate <= SLOW_CONVERGENCE else 0.0
                for c in range(d.ny):
                    d.y_new[c] = d.y[c] + d.w[stage_vector(d, Z, 2) + c]
                return True
            d.memory[JACOBIAN_HOLDS] = 0.0
            if fresh:
                return False
        return False

    @kernel
    def error(d, step):
        """Norm of the local error, 1 at the tolerance; what is too large is filtered twice."""
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
    slopes=ROWS,
    last=LAST,
    dense=hermite.ROWS,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    error_order=ERROR_ORDER,
    steady=1.2,
    memory=memory,
)
