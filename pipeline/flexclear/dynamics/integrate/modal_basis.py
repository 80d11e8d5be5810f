r"""Vibrations of the constrained mechanism under its modal stiffness.

With M the mass matrix, J the closures' Jacobian and K the modal stiffness, the modes' springs accelerate the
coordinates by :math:`-P K q`, where :math:`P = M^{-1} - M^{-1}J^T(JM^{-1}J^T)^{-1}JM^{-1}`. The symmetric
:math:`K^{1/2} P K^{1/2} = Q \Omega^2 Q^T` separates them into oscillators :math:`z = Q^T K^{1/2} q`, each with a shape
over all coordinates and a fraction of the modal damping; the positions' rates and the drives' work follow linearly. The
remainder (other forces, coupling by damping, the change of pose) is not stiff, contacts and steep friction excepted.

These vibrations are linear in the state: :math:`A y = B \Lambda C y`, where C extracts (z, z') from a state, B maps
them to a state and :math:`C B = 1`, so that functions of A are functions of 2 x 2 matrices.

Source: Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), sec. 8.5 (Jacobi's method).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel

#: oscillators below this fraction of the largest frequency are not stiff, and are integrated with the rest
NOT_STIFF = 1e-6


@kernel
def lifting(d, i):
    """Return the index in w of oscillator i's shape, of the state's length: rates of positions, speeds, two works.

    Oscillating forces work on drives whose speed changes within a step: the work at the start's speed, and its rate.
    """
    return d.at_lifting + d.ny * i


@kernel
def response(d, j):
    """Return the index in w of the rates by the root of spring j's stiffness, the drives' power, its rate."""
    return d.at_response + d.ny * j


@kernel
def oscillation(d, p, i):
    """Return (z, z') of oscillator i in pair p of all oscillators."""
    return d.oscillations[d.nv * p + i]


@kernel
def count(d):
    """Return the number of oscillators, equal to that of the modes."""
    total = 0
    for k in range(d.n_flex):
        total += d.flexes[k].n_modes
    return total


# Functions of the state -----------------------------------------------------------------------------------------------
@kernel
def modal_values(d, state, p):
    """Apply C: fill pair p from the variables in w from index `state` on."""
    for i in range(count(d)):
        e, z, rate = d.nv * i, 0.0, 0.0
        for k in range(d.n_flex):
            q, c = state + d.flexes[k].q0, state + d.nq + d.flexes[k].c0
            for j in range(d.flexes[k].n_modes):
                z += d.reading[e] * d.w[q + j]
                rate += d.reading[e] * d.w[c + j]
                e += 1
        pair = oscillation(d, p, i)
        pair.z, pair.rate = z, rate


@kernel
def lift(d, p, t, out):
    """Apply B, a time t after the pose: add pair p to the variables in w from index `out` on."""
    nq, nv = d.nq, d.nv
    for i in range(count(d)):
        if d.oscillators[i].square == 0.0:
            continue
        shape, z, rate = lifting(d, i), oscillation(d, p, i).z, oscillation(d, p, i).rate
        for c in range(nq):
            d.w[out + c] += d.w[shape + c] * z
        for c in range(nq, nq + nv):
            d.w[out + c] += d.w[shape + c] * rate
        work = d.w[shape + nq + nv] + t * d.w[shape + nq + nv + 1]
        d.w[out + nq + nv + m.DRIVE_WORK] += work * (rate + d.oscillators[i].damping * z)


@kernel
def work_rate(d, p):
    """Return the rate of pair p's work that is due to the drives' changing speeds."""
    total, rates = 0.0, d.nq + d.nv + 1
    for i in range(count(d)):
        pair = oscillation(d, p, i)
        total += d.w[lifting(d, i) + rates] * (pair.rate + d.oscillators[i].damping * pair.z)
    return total


@kernel
def turn(d, p):
    """Apply Lambda: (z, z') of pair p becomes (z', -omega^2 z - d z')."""
    for i in range(count(d)):
        one, pair = d.oscillators[i], oscillation(d, p, i)
        z, rate = pair.z, pair.rate
        pair.z, pair.rate = rate, -one.square * z - one.damping * rate


# Oscillators ----------------------------------------------------------------------------------------------------------
@kernel
def couple(d, i):
    """Fill row i of the symmetric matrix: the response of mode i's spring along all modes."""
    j, b = 0, response(d, i) + d.nq
    for k in range(d.n_flex):
        for c in range(d.flexes[k].c0, d.flexes[k].c0 + d.flexes[k].n_modes):
            d.coupling[d.nv * i + j] = d.oscillators[j].root * d.w[b + c]
            j += 1


@kernel
def into_axes(d, n):
    """Replace the symmetric matrix S by Q^T S Q, with the axes Q of the previous pose, nearly its own; uses READING."""
    nv, S, QtS, Qt = d.nv, d.coupling, d.reading, d.axes
    for i in range(n):
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += Qt[nv * i + j] * S[nv * j + k]
            QtS[n * i + k] = total
    for i in range(n):
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += QtS[n * i + j] * Qt[nv * k + j]
            S[nv * i + k] = total


@kernel
def rotate(entries, a, b, stride, n, c, s):
    """Rotate two rows or columns of n entries, from indices a and b on with a stride, by cosine c and sine s."""
    for k in range(0, stride * n, stride):
        x, y = entries[a + k], entries[b + k]
        entries[a + k], entries[b + k] = c * x - s * y, s * x + c * y


@kernel
def diagonalise(d, n):
    """Diagonalise the symmetric matrix by Jacobi's rotations, and rotate its axes along."""
    nv, S = d.nv, d.coupling
    # off-diagonal entries below this fraction of the diagonal ones' geometric mean count as zero; most Jacobi sweeps
    for _ in range(20):
        turned = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                mixed, a, b = S[nv * p + q], S[nv * p + p], S[nv * q + q]
                if not abs(mixed) > 1e-13 * np.sqrt(max(a * b, 0.0)):
                    continue
                turned = True
                half = 0.5 * (b - a) / mixed
                t = (1.0 if half >= 0.0 else -1.0) / (abs(half) + np.sqrt(half * half + 1.0))
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                rotate(S, nv * p, nv * q, 1, n, c, s)
                rotate(S, p, q, nv, n, c, s)
                S[nv * p + q] = S[nv * q + p] = 0.0
                rotate(d.axes, nv * p, nv * q, 1, n, c, s)
        if not turned:
            return


@kernel
def damp(d, i):
    """Return the damping of oscillator i by the modal damping, without its coupling to other oscillators."""
    total, e = 0.0, d.nv * i
    for k in range(d.n_flex):
        n = d.flexes[k].n_modes
        stiffness = d.at_flex_data + d.flexes[k].data0 + 12 * n + n * n
        for j in range(n):
            if d.f[stiffness + j] > 0.0:
                total += d.axes[e] ** 2 * d.f[stiffness + n + j] / d.f[stiffness + j]
            e += 1
    return d.oscillators[i].square * total


@kernel
def shapes(d, n):
    """Fill rows of C and shapes of B from responses, axes and squares; slow oscillators get none."""
    nv, largest = d.nv, 0.0
    for i in range(n):
        largest = max(largest, d.coupling[(nv + 1) * i])
    for i in range(n):
        shape, omega2 = lifting(d, i), d.coupling[(nv + 1) * i]
        stiff = omega2 > NOT_STIFF * NOT_STIFF * largest
        d.oscillators[i].square = omega2 if stiff else 0.0
        for j in range(n):
            d.reading[nv * i + j] = d.axes[nv * i + j] * d.oscillators[j].root
        for c in range(d.ny):
            d.w[shape + c] = 0.0
        for j in range(n if stiff else 0):
            part, weight = response(d, j), d.axes[nv * i + j] / omega2
            for c in range(d.ny):
                d.w[shape + c] += weight * d.w[part + c]


def make_find_oscillators(lists: Any) -> Callable:
    """Build the kernel find_oscillators(d, known), for the state in Y; lists: as of `method.Method.make_kernels`."""
    factor_springs, release_spring = lists.factor_springs, lists.release_spring

    @kernel
    def responses(d):
        """Compute the responses to the root of each mode's stiffness, and the symmetric matrix."""
        e = 0
        factor_springs(d, d.time, d.at_y)
        for k in range(d.n_flex):
            size, c0 = d.flexes[k].n_modes, d.flexes[k].c0
            stiffness = d.at_flex_data + d.flexes[k].data0 + 12 * size + size * size
            for j in range(size):
                b = response(d, e)
                for c in range(d.ny):
                    d.w[b + c] = 0.0
                d.oscillators[e].root = d.w[b + d.nq + c0 + j] = np.sqrt(max(d.f[stiffness + j], 0.0))
                release_spring(d, d.time, d.at_y, b)
                e += 1
        for i in range(e):
            couple(d, i)

    @kernel
    def find_oscillators(d, known):
        """Compute the oscillators; known: whether the axes of another pose are stored."""
        size = count(d)
        responses(d)
        if known:
            into_axes(d, size)
        else:
            for i in range(size):
                for j in range(size):
                    d.axes[d.nv * i + j] = 1.0 if i == j else 0.0
        diagonalise(d, size)
        shapes(d, size)
        for i in range(size):
            d.oscillators[i].damping = damp(d, i)

    return find_oscillators
