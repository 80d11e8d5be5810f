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

from flexclear.pipeline.dynamics.kernels import kernel

#: phi_0 to phi_4: a right-hand side that is a cubic in time needs the last
COUNT = 5
#: below this a + b the series of phi_4 is taken, and the others from it: upwards, division by a leaves rounding
SERIES, TERMS = 1.0, 14
INVERSE_FACTORIALS = np.array([1.0 / factorial(k) for k in range(COUNT + TERMS)])


@kernel
def phi_functions(w, out, a, b):
    """alpha_0, beta_0, alpha_1, ... into w from place out; a = (omega tau)^2, b = d tau with 0 <= b < 2 sqrt(a), or 0.

    Good to some thousand roundings of 1/k!.
    """
    if a + b < SERIES:
        alpha, beta = INVERSE_FACTORIALS[COUNT - 1 + TERMS], 0.0
        for k in range(COUNT + TERMS - 2, -1, -1):
            alpha, beta = INVERSE_FACTORIALS[k] - a * beta, alpha - b * beta
            if k < COUNT:
                w[out + 2 * k], w[out + 2 * k + 1] = alpha, beta
        return
    root, decay = np.sqrt(a - 0.25 * b * b), np.exp(-0.5 * b)
    beta = decay * np.sin(root) / root
    alpha = decay * np.cos(root) + 0.5 * b * beta
    for k in range(COUNT):
        w[out + 2 * k], w[out + 2 * k + 1] = alpha, beta
        rest = alpha - INVERSE_FACTORIALS[k]
        alpha, beta = beta - b * rest / a, -rest / a
