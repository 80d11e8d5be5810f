r"""Natural vibrations about an equilibrium, or about steady motion: :math:`\ddot z + D\dot z + Kz = 0`.

Stiff contacts beside soft pendulums: a stiffness differenced along mixed directions would leave rounding of the stiff
ones in the soft. So it is taken twice, the second time along the vibrations that the first gave, and the eigenvalue
problem is solved in coordinates scaled by their own frequency.

Source: Meirovitch, *Principles and Techniques of Vibrations*, ch. 4 (undamped), 6 and 11 (damped, gyroscopic).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.linear.bench import Bench
from pipeline.dynamics.linear.tangent import Tangent, damping, stiffness

#: an eigenvalue of the stiffness within this many estimated errors of zero is zero
NOTHING = 10.0
#: the same, as a share of the largest eigenvalue
NOTHING_BESIDE = 1e-13
#: asymmetry below this share of the scaled stiffness is rounding
NEGLIGIBLE = 1e-9
#: a motion without stiffness is scaled by this share of the highest frequency
LEAST_SCALE = 1e-6
#: an eigenvalue with this share of imaginary part is real, it decays or grows without vibrating; likewise imaginary
REAL = 1e-12


@dataclass(frozen=True)
class Vibrations:
    """Small motions exp(lambda t) w, ascending in frequency; pairs of complex lambda once, with Im > 0.

    value: lambda [1/s], complex, shape (n,).  shape: displacements w of the coordinates, complex, shape (nv, n), with
    w^H M w = 1.  free: how many motions have no stiffness.
    """

    value: np.ndarray
    shape: np.ndarray
    free: int


def vibrations(bench: Bench, at: Tangent) -> Vibrations:
    """All small motions about a pose in balance."""
    if not at.Z.shape[1]:
        return Vibrations(np.zeros(0, dtype=complex), np.zeros((len(at.bias), 0), dtype=complex), 0)
    motions = at.Z
    for _ in range(2):
        K, _ = stiffness(bench, at, motions)
        motions = motions @ np.linalg.eigh(0.5 * (K + K.T))[1]
    K, error = stiffness(bench, at, motions)
    D, rate_error = damping(bench, at, motions)
    diagonal = np.abs(np.diag(K))
    limp = diagonal <= np.maximum(NOTHING * error, NOTHING_BESIDE**2 * diagonal.max())
    least = NOTHING_BESIDE * max(float(np.abs(D).max()), float(np.sqrt(diagonal.max())))
    D[np.abs(D) <= np.maximum(NOTHING * rate_error[None, :], least)] = 0.0
    loose = limp & ~np.any(D, axis=0) & ~np.any(D, axis=1)
    K[:, limp], K[limp, :] = 0.0, 0.0
    kept = ~loose
    value, shape = _solve(K[np.ix_(kept, kept)], D[np.ix_(kept, kept)], error[kept])
    full = np.zeros((len(K), value.size), dtype=complex)
    full[kept] = shape
    full = np.hstack([np.eye(len(K), dtype=complex)[:, loose], full])
    value = np.concatenate([np.zeros(int(loose.sum()), dtype=complex), value])
    order = np.lexsort((np.abs(value), np.abs(value.imag), np.arange(len(value)) >= loose.sum()))
    return Vibrations(value[order], motions @ full[:, order], int(limp.sum()))


def _solve(K: np.ndarray, D: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues lambda and vectors of z'' + D z' + K z = 0, one of each conjugate pair.

    error: of each column of K.
    """
    own = np.sqrt(np.abs(np.diag(K)))
    scale = np.maximum(own, LEAST_SCALE * own.max(initial=1e-300))
    doubt = NOTHING * (error[:, None] + error[None, :]) + NEGLIGIBLE * np.outer(scale, scale)
    if np.all(np.abs(K - K.T) <= doubt):
        # of the two values of an entry the column with the smaller error has the better one
        K = np.where(error[:, None] < error[None, :], K.T, K)
        K = np.triu(K) + np.triu(K, 1).T
        if not np.any(D):
            return _undamped(K)
    # coordinates z and z'/scale change at comparable rates
    A = np.block([[np.zeros_like(K), np.diag(scale)], [-K / scale[None, :], -D]])
    value, vectors = np.linalg.eig(A)
    # displacements, not speeds: a creeping motion has none
    shape = vectors[: len(K)] / scale[:, None]
    real = np.abs(value.imag) <= REAL * np.abs(value)
    lasting = np.abs(value.real) <= REAL * np.abs(value)
    value = np.where(real, value.real, np.where(lasting, 1j * value.imag, value))
    kept = (value.imag > 0.0) | real
    value, shape = value[kept], shape[:, kept]
    value[np.abs(value) <= REAL * np.abs(value).max(initial=0.0)] = 0.0
    return value, shape / np.linalg.norm(shape, axis=0)


def _undamped(K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Real vibrations; a falling motion (negative stiffness) has lambda = +sqrt(-k)."""
    k, axes = np.linalg.eigh(K)
    return np.sqrt(-k.astype(complex)), axes.astype(complex)
