r"""Exponential functions phi_k of the matrix of one damped oscillator.

.. math:: \varphi_0(X) = e^X, \qquad \varphi_k(X) = 1/k! + X \varphi_{k+1}(X), \qquad
          X = \tau\begin{pmatrix} 0 & 1 \\ -\omega^2 & -d \end{pmatrix}

Since :math:`X^2 = -a - bX` with :math:`a = (\omega\tau)^2` and :math:`b = d\tau`, each is
:math:`\alpha_k + \beta_k X`, two numbers.

Source: Hochbruck & Ostermann, Exponential integrators, *Acta Numerica* 19 (2010), sec. 2.1.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from flexclear.dynamics.kernels import kernel

#: phi_0 to phi_4: a right-hand side that is a cubic in time needs the last
PHI_COUNT = 5
#: below this a + b the series of phi_4 is taken, and the others from it: upwards, division by a leaves rounding
SERIES_LIMIT, TERMS = 1.0, 14
#: where (b / 2)^2 - a is more, two decays are distinguished; where it is less, a is not small
DISTINCT = 0.0625
INVERSE_FACTORIALS = np.array([1.0 / factorial(k) for k in range(PHI_COUNT + TERMS)])


@kernel
def decaying(w, out, x):
    """Store phi_0(-x), phi_1(-x), ... for a number x >= 0 in every second entry of w from index out."""
    value = 0.0
    if x < SERIES_LIMIT:
        for k in range(PHI_COUNT + TERMS - 1, -1, -1):
            value = INVERSE_FACTORIALS[k] - x * value
            if k < PHI_COUNT:
                w[out + 2 * k] = value
        return
    value = np.exp(-x)
    for k in range(PHI_COUNT):
        w[out + 2 * k] = value
        value = (INVERSE_FACTORIALS[k] - value) / x


@kernel
def apart(w, out, a, b, root):
    """Do as `phi_functions` for real eigenvalues with a distance of 2 root, by the phi functions of each."""
    fast = 0.5 * b + root
    slow = a / fast
    decaying(w, out, slow)
    decaying(w, out + 1, fast)
    for k in range(PHI_COUNT):
        beta = (w[out + 2 * k] - w[out + 2 * k + 1]) / (2.0 * root)
        w[out + 2 * k] += slow * beta
        w[out + 2 * k + 1] = beta


@kernel
def phi_functions(w, out, a, b):
    """Store alpha_0, beta_0, alpha_1, ... in w from index out; a = (omega tau)^2 and b = d tau, neither below 0.

    Their error is at most some ten thousand roundings of 1/k!, and mostly a few.
    """
    if a + b < SERIES_LIMIT:
        alpha, beta = INVERSE_FACTORIALS[PHI_COUNT - 1 + TERMS], 0.0
        for k in range(PHI_COUNT + TERMS - 2, -1, -1):
            alpha, beta = INVERSE_FACTORIALS[k] - a * beta, alpha - b * beta
            if k < PHI_COUNT:
                w[out + 2 * k], w[out + 2 * k + 1] = alpha, beta
        return
    square, decay = a - 0.25 * b * b, np.exp(-0.5 * b)
    if square < -DISTINCT:
        apart(w, out, a, b, np.sqrt(-square))
        return
    if square > DISTINCT:
        root = np.sqrt(square)
        alpha, beta = decay * np.cos(root), decay * np.sin(root) / root
    else:  # the same series, whether it swings or creeps
        alpha = beta = decay
        # even order to which sine and cosine are expanded in between
        for k in range(12, 0, -2):
            alpha, beta = decay - square / ((k - 1) * k) * alpha, decay - square / (k * (k + 1)) * beta
    alpha += 0.5 * b * beta
    for k in range(PHI_COUNT):
        w[out + 2 * k], w[out + 2 * k + 1] = alpha, beta
        rest = alpha - INVERSE_FACTORIALS[k]
        alpha, beta = beta - b * rest / a, -rest / a
