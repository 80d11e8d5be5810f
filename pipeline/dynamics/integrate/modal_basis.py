r"""Vibrations that modal stiffness gives the constrained mechanism, in the state just evaluated.

With M the mass matrix, J the closures' Jacobian and K the modal stiffness, the modes' springs accelerate the
coordinates by :math:`-P K q`, where :math:`P = M^{-1} - M^{-1}J^T(JM^{-1}J^T)^{-1}JM^{-1}`. The symmetric
:math:`K^{1/2} P K^{1/2} = Q \Omega^2 Q^T` separates them into oscillators :math:`z = Q^T K^{1/2} q`, each with a shape
over all coordinates and a fraction of the modal damping; the positions' rates and the drives' work follow linearly.
What this leaves out (other forces, coupling by damping, the change of pose) is not stiff, contacts and steep friction
excepted.

A is the matrix of all that: :math:`A y = B \Lambda C y`, where C reads (z, z') off a state, B lifts them to one and
:math:`C B = 1`, so that functions of A are functions of 2 x 2 matrices.

Source: Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), sec. 8.5 (Jacobi's method).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.bodies.interface import to_interface, to_modes
from flexclear.pipeline.dynamics.equations.closures import add_spread, solve, take_spread
from flexclear.pipeline.dynamics.equations.envelope import backward, forward
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import dot6

#: off-diagonal entries of this share of the diagonal ones' geometric mean are zero; sweeps, quadratically convergent
NOTHING, SWEEPS = 1e-13, 20
#: oscillators below this share of the largest frequency are not stiff, and left alone
SLOW = 1e-6
#: largest change of a coordinate by which the positions' rates are asked for
A_LITTLE = 1e-9


@kernel
def room(h):
    """Most oscillators: one per speed."""
    return h[m.NV]


def floats(h: np.ndarray) -> int:
    """Floats of the work space that a basis takes."""
    size, ny = int(h[m.NV]), int(h[m.NY])
    return 3 * size + 3 * size * size + 2 * size * ny


# Places; o is where the basis begins ----------------------------------------------------------------------------------
@kernel
def square(h, o, i):
    """Where w holds omega^2 of oscillator i [1/s^2]."""
    return o + i


@kernel
def damping(h, o, i):
    """Where w holds the damping of oscillator i [1/s]."""
    return o + room(h) + i


@kernel
def root(h, o, j):
    """Where w holds the root of the stiffness of spring j."""
    return o + 2 * room(h) + j


@kernel
def axes(h, o, i):
    """Where w holds column i of Q."""
    return o + room(h) * (3 + i)


@kernel
def matrix(h, o, i):
    """Where w holds row i of the symmetric matrix."""
    return o + room(h) * (3 + room(h) + i)


@kernel
def reading(h, o, i):
    """Where w holds row i of C: weights of the springs."""
    return o + room(h) * (3 + 2 * room(h) + i)


@kernel
def lifting(h, o, i):
    """Where w holds oscillator i's shape, of the state's length: rates of positions, speeds, and two of the work.

    Oscillating forces do work on drives whose speed changes within a step: the work at the start's speed, and its rate.
    """
    return o + room(h) * (3 + 3 * room(h)) + h[m.NY] * i


@kernel
def response(h, o, j):
    """Where w holds what the root of spring j's stiffness accelerates, the drives' power then, and its rate."""
    return lifting(h, o, room(h) + j)


@kernel
def count(h):
    """Number of modes, which is that of oscillators."""
    total = 0
    for k in range(h[m.N_FLEX]):
        total += m.FLEXES.n_modes(h, k)
    return total


# Functions of the state -----------------------------------------------------------------------------------------------
@kernel
def read(h, w, o, state, out):
    """C: z, and z' after `room` entries, of what w holds for each variable from index `state` on."""
    for i in range(count(h)):
        row, e, z, rate = reading(h, o, i), 0, 0.0, 0.0
        for k in range(h[m.N_FLEX]):
            q, c = state + m.FLEXES.q0(h, k), state + h[m.NQ] + m.FLEXES.c0(h, k)
            for j in range(m.FLEXES.n_modes(h, k)):
                z += w[row + e] * w[q + j]
                rate += w[row + e] * w[c + j]
                e += 1
        w[out + i], w[out + room(h) + i] = z, rate


@kernel
def lift(h, w, o, pair, t, out):
    """Add B, a time t after the pose, of (z, z') to what w holds for each variable from place `out` on.

    z' follows z after `room` entries.
    """
    nq, nv = h[m.NQ], h[m.NV]
    for i in range(count(h)):
        if w[square(h, o, i)] == 0.0:
            continue
        shape, z, rate = lifting(h, o, i), w[pair + i], w[pair + room(h) + i]
        for c in range(nq):
            w[out + c] += w[shape + c] * z
        for c in range(nq, nq + nv):
            w[out + c] += w[shape + c] * rate
        work = w[shape + nq + nv] + t * w[shape + nq + nv + 1]
        w[out + nq + nv + m.DRIVE_WORK] += work * (rate + w[damping(h, o, i)] * z)


@kernel
def work_rate(h, w, o, pair):
    """Rate at which the work that belongs to (z, z') changes because the drives' speeds do."""
    total, rates = 0.0, h[m.NQ] + h[m.NV] + 1
    for i in range(count(h)):
        total += w[lifting(h, o, i) + rates] * (w[pair + room(h) + i] + w[damping(h, o, i)] * w[pair + i])
    return total


@kernel
def turn(h, w, o, pair):
    """Lambda: (z, z') becomes (z', -omega^2 z - d z'), in place."""
    for i in range(count(h)):
        z, rate = w[pair + i], w[pair + room(h) + i]
        w[pair + i] = rate
        w[pair + room(h) + i] = -w[square(h, o, i)] * z - w[damping(h, o, i)] * rate


# Oscillators ----------------------------------------------------------------------------------------------------------
@kernel
def constrained(h, f, w, n, b):
    """P applied to the forces in w from place b; needs the factors of an evaluation. Leaves the multipliers.

    Modes are in the interface basis.
    """
    forward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], b)
    for k in range(h[m.MULTIPLIER], h[m.MULTIPLIER] + h[m.N_KEPT_ROWS]):
        w[k] = 0.0
    d = data(h, f, w, n)
    take_spread(d, b)
    solve(d)
    add_spread(d, b, 1.0)
    backward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], b)


@kernel
def drive_power(h, w, b, motion):
    """Power that the drives bring in at accelerations from place b and the multipliers that belong to them.

    motion: U for the power, DU for the rate at which it grows with the drives' speeds.
    """
    power = 0.0
    for p in range(h[m.N_KNOWN_PAIRS]):
        momentum, column = m.MOMENTA.row(h, m.KNOWN_PAIRS.momentum(h, p)), m.COLUMNS.row(h, m.KNOWN_PAIRS.column(h, p))
        speed = w[motion + h[m.NV] + m.KNOWN_PAIRS.drive(h, p)]
        power += dot6(w, momentum, w, column) * w[b + m.KNOWN_PAIRS.coordinate(h, p)] * speed
    for e in range(h[m.N_KNOWN_ENTRIES]):
        c, d, sign = m.KNOWN_ENTRIES.closure(h, e), m.KNOWN_ENTRIES.drive(h, e), m.KNOWN_ENTRIES.sign(h, e)
        col, speed = m.COLUMNS.row(h, m.KNOWN_ENTRIES.column(h, e)), w[motion + h[m.NV] + d]
        wrenches, first = m.ROWS.row(h, m.CLOSURES.row0(h, c)), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for k in range(m.CLOSURES.n_kept(h, c)):
            power -= sign * dot6(w, wrenches + 6 * k, w, col) * w[first + k] * speed
    return power


@kernel
def respond(h, f, w, n, b):
    """What the forces in w from place b do, in place; and the drives' power then, and its rate, added after it."""
    nv = h[m.NV]
    constrained(h, f, w, n, b)
    w[b + nv] += drive_power(h, w, b, h[m.U])
    w[b + nv + 1] += drive_power(h, w, b, h[m.DU])
    to_modes(data(h, f, w, n), b)


@kernel
def responses(h, f, w, n, o):
    """Responses to the root of each mode's stiffness, and the symmetric matrix."""
    nq, nv, e = h[m.NQ], h[m.NV], 0
    for i in range(count(h)):
        for k in range(nq, nq + nv + 2):
            w[response(h, o, i) + k] = 0.0
    for k in range(h[m.N_FLEX]):
        size, c0 = m.FLEXES.n_modes(h, k), m.FLEXES.c0(h, k)
        stiffness = h[m.FLEX_DATA.place] + m.FLEXES.data0(h, k) + 12 * size + size * size
        for j in range(size):
            w[root(h, o, e)] = np.sqrt(max(f[stiffness + j], 0.0))
            b = response(h, o, e) + nq
            w[b + c0 + j] = w[root(h, o, e)]
            to_interface(data(h, f, w, n), b)
            respond(h, f, w, n, b)
            e += 1
    for i in range(e):
        couple(h, w, o, i)


@kernel
def couple(h, w, o, i):
    """Row i of the symmetric matrix: what the response of mode i's spring does along all modes."""
    j, b = 0, response(h, o, i) + h[m.NQ]
    for k in range(h[m.N_FLEX]):
        for c in range(m.FLEXES.c0(h, k), m.FLEXES.c0(h, k) + m.FLEXES.n_modes(h, k)):
            w[matrix(h, o, i) + j] = w[root(h, o, j)] * w[b + c]
            j += 1


@kernel
def into_axes(h, w, o, n):
    """The symmetric matrix in the axes of the pose before, which are nearly its own."""
    spare = reading(h, o, 0)
    for i in range(n):
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += w[axes(h, o, i) + j] * w[matrix(h, o, j) + k]
            w[spare + n * i + k] = total
    for i in range(n):
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += w[spare + n * i + j] * w[axes(h, o, k) + j]
            w[matrix(h, o, i) + k] = total


@kernel
def rotate(w, a, b, n, c, s):
    """Turn two stretches of w into each other."""
    for k in range(n):
        x, y = w[a + k], w[b + k]
        w[a + k], w[b + k] = c * x - s * y, s * x + c * y


@kernel
def diagonalise(h, w, o, n):
    """Jacobi's rotations until the symmetric matrix is diagonal, taken along by its axes."""
    for _ in range(SWEEPS):
        turned = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                P, R = matrix(h, o, p), matrix(h, o, q)
                mixed, a, b = w[P + q], w[P + p], w[R + q]
                if not abs(mixed) > NOTHING * np.sqrt(max(a * b, 0.0)):
                    continue
                turned = True
                half = 0.5 * (b - a) / mixed
                t = (1.0 if half >= 0.0 else -1.0) / (abs(half) + np.sqrt(half * half + 1.0))
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                rotate(w, P, R, n, c, s)
                for k in range(n):
                    row = matrix(h, o, k)
                    x, y = w[row + p], w[row + q]
                    w[row + p], w[row + q] = c * x - s * y, s * x + c * y
                w[P + q] = w[R + p] = 0.0
                rotate(w, axes(h, o, p), axes(h, o, q), n, c, s)
        if not turned:
            return


@kernel
def damp(h, f, w, o, i):
    """Damping of oscillator i by the modal damping: the part that does not couple it to others."""
    total, e = 0.0, 0
    for k in range(h[m.N_FLEX]):
        n = m.FLEXES.n_modes(h, k)
        stiffness = h[m.FLEX_DATA.place] + m.FLEXES.data0(h, k) + 12 * n + n * n
        for j in range(n):
            if f[stiffness + j] > 0.0:
                total += w[axes(h, o, i) + e] ** 2 * f[stiffness + n + j] / f[stiffness + j]
            e += 1
    return w[square(h, o, i)] * total


def make_find_oscillators(retract: Callable) -> Callable:
    """The kernel find_oscillators(h, f, w, n, o, known), at the state in Y or Y_NEW that has just been evaluated."""

    @kernel
    def shapes(h, f, w, n, o, state, size):
        """Rows of C and shapes of B, from responses, axes and squares; slow oscillators have none."""
        nq, nv, largest = h[m.NQ], h[m.NV], 0.0
        for i in range(size):
            largest = max(largest, w[matrix(h, o, i) + i])
        for i in range(size):
            shape, omega2 = lifting(h, o, i), w[matrix(h, o, i) + i]
            stiff = omega2 > SLOW * SLOW * largest
            w[square(h, o, i)] = omega2 if stiff else 0.0
            for j in range(size):
                w[reading(h, o, i) + j] = w[axes(h, o, i) + j] * w[root(h, o, j)]
            for c in range(h[m.NY]):
                w[shape + c] = 0.0
            if not stiff:
                continue
            for j in range(size):
                part, weight = response(h, o, j), w[axes(h, o, i) + j] / omega2
                for c in range(nq, nq + nv + 2):
                    w[shape + c] += weight * w[part + c]
        for i in range(size):
            # the responses are used up: room for a displacement, the positions that it leads to, and the change
            shape, spare, longest = lifting(h, o, i), response(h, o, 0), 0.0
            for c in range(nv):
                longest = max(longest, abs(w[shape + nq + c]))
            if longest > 0.0:
                for c in range(nv):
                    w[spare + c] = w[shape + nq + c] * (A_LITTLE / longest)
                retract(h, f, w, n, state, spare, spare + nv, spare + nv + nq)
                for c in range(nq):
                    w[shape + c] = w[spare + nv + nq + c] * (longest / A_LITTLE)

    @kernel
    def find_oscillators(h, f, w, n, o, known):
        """Fill the basis; known: whether it holds the axes of another pose."""
        size = count(h)
        responses(h, f, w, n, o)
        if known:
            into_axes(h, w, o, size)
        else:
            for i in range(size):
                for j in range(size):
                    w[axes(h, o, i) + j] = 1.0 if i == j else 0.0
        diagonalise(h, w, o, size)
        shapes(h, f, w, n, o, n[m.STATE], size)
        for i in range(size):
            w[damping(h, o, i)] = damp(h, f, w, o, i)

    return find_oscillators
