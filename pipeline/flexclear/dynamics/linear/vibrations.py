r"""Natural vibrations about an equilibrium or a steady motion: :math:`\ddot z + D\dot z + Kz = 0`.

With stiff contacts next to soft pendulums, a stiffness along mixed directions leaves rounding of the stiff ones in the
soft ones. It is therefore evaluated twice, the second time along the vibrations of the first, and the eigenproblem is
solved in coordinates scaled by their own frequency.

Source: Meirovitch, *Principles and Techniques of Vibrations*, ch. 4 (undamped), 6 and 11 (damped, gyroscopic).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flexclear.dynamics.linear.bench import Bench
from flexclear.dynamics.linear.tangent import EPSILON, Tangent, damping, stiffness

#: an eigenvalue of the stiffness within this many rounding errors of zero is zero
ZERO_EIGENVALUE = 10.0
#: an eigenvalue below this fraction of the largest is zero
RELATIVE_ZERO = 1e-13
#: asymmetry below this fraction of the scaled stiffness is rounding
ASYMMETRY = 1e-9
#: an eigenvalue with at most this fraction of imaginary part is real, without vibration; likewise imaginary
REAL = 1e-12


@dataclass(frozen=True)
class Vibrations:
    """Small motions exp(lambda t) w, ascending in frequency; pairs of complex lambda once, with Im > 0.

    value: lambda [1/s], complex, shape (n,).  shape: displacements w of the coordinates, complex, shape (nv, n), with
    w^H M w = 1.  free: number of motions without stiffness.  value_error: estimated errors of lambda [1/s], (n,).
    fixed: True for frequencies in fixed axes, where the equations vary with the drives (`floquet`).
    """

    value: np.ndarray
    shape: np.ndarray
    free: int
    value_error: np.ndarray
    fixed: bool = False

    @property
    def growth(self) -> float:
        """Largest rate at which a motion grows [1/s]; 0 where no motion grows by more than its error."""
        return float(
            np.max(np.where(self.value.real > ZERO_EIGENVALUE * self.value_error, self.value.real, 0.0), initial=0.0)
        )

    @property
    def stable(self) -> bool:
        """True when no small motion grows exponentially."""
        return self.growth == 0.0


@dataclass(frozen=True)
class Equations:
    """Equations z'' + D z' + K z = 0 of small motions; motions: speeds of all coordinates per z', shape (nv, n).

    free: True for motions without stiffness.  error, rate_error: rounding errors of the columns of K and D.
    """

    motions: np.ndarray
    K: np.ndarray
    D: np.ndarray
    free: np.ndarray
    error: np.ndarray
    rate_error: np.ndarray

    @property
    def scale(self) -> np.ndarray:
        """Frequency of each motion alone [rad/s], never 0."""
        return _scale(self.K)

    def first_order(self, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A of y' = A y with y = (z scale, z'), which change at comparable rates, and the errors of A."""
        n = len(self.K)
        A = np.block([[np.zeros_like(self.K), np.diag(scale)], [-self.K / scale[None, :], -self.D]])
        wrong = EPSILON * np.abs(A)
        wrong[n:] += np.concatenate([self.error / scale, self.rate_error])
        return A, wrong


def vibrations(bench: Bench, at: Tangent) -> Vibrations:
    """Compute all small motions about a pose in balance, with equations that do not vary with time."""
    if not at.Z.shape[1]:
        return Vibrations(np.zeros(0, dtype=complex), np.zeros((len(at.bias), 0), dtype=complex), 0, np.zeros(0))
    return time_invariant_motions(equations(bench, at, principal_motions(bench, at)))


def principal_motions(bench: Bench, at: Tangent) -> np.ndarray:
    """Return the vibrations by stiffness and mass alone, shape (nv, mobility)."""
    first, error = stiffness(bench, at, at.Z)
    return at.Z @ _principal(_symmetric(first, error), _without_stiffness(first, error))[1]


def equations(bench: Bench, at: Tangent, motions: np.ndarray) -> Equations:
    """Return the equations of small motions along `motions`, with zeros in place of rounding."""
    K, error = stiffness(bench, at, motions)
    D, rate_error = damping(bench, at, motions)
    free = _without_stiffness(K, error)
    least = RELATIVE_ZERO * max(float(np.abs(D).max()), float(np.sqrt(np.abs(np.diag(K)).max())))
    D[np.abs(D) <= np.maximum(ZERO_EIGENVALUE * rate_error[None, :], least)] = 0.0
    K[:, free], K[free, :] = 0.0, 0.0
    return Equations(motions, K, D, free, error, rate_error)


def time_invariant_motions(of: Equations) -> Vibrations:
    """Return the small motions of equations that do not vary with time."""
    if is_symmetric(of.K, of.error) and not np.any(of.D):
        k, axes = _principal(_symmetric(of.K, of.error), of.free)
        # a falling motion, of negative stiffness, grows as exp(+sqrt(-k) t)
        value, shape, value_error = np.sqrt((-k).astype(complex)), axes.astype(complex), np.zeros(len(k))
    else:
        value, shape, value_error = _damped_eigenpairs(of)
    order = frequency_order(value)
    return Vibrations(value[order], of.motions @ shape[:, order], int(of.free.sum()), value_error[order])


def frequency_order(value: np.ndarray) -> np.ndarray:
    """Return the order of eigenvalues by frequency, then by size."""
    return np.lexsort((np.abs(value), np.abs(value.imag)))


def eigenpairs(A: np.ndarray, wrong: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues and vectors of A, and errors of the eigenvalues by the errors `wrong` of A.

    An error is at most |y^H| |dA| |x| / |y^H x|, to first order, with left and right vectors y and x (Golub & Van Loan
    (2013), Matrix Computations, sec. 7.2.2).
    """
    value, left, vectors = scipy.linalg.eig(A, left=True)
    sizes = np.sum(np.abs(left) * (wrong @ np.abs(vectors)), axis=0)
    return value, vectors, sizes / np.maximum(np.abs(np.sum(left.conj() * vectors, axis=0)), np.finfo(float).tiny)


def _without_stiffness(K: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return True for motions without stiffness, within rounding."""
    own = _sizes(K)
    return own <= np.maximum(ZERO_EIGENVALUE * error, RELATIVE_ZERO**2 * own.max())


def _scale(K: np.ndarray) -> np.ndarray:
    own = np.sqrt(_sizes(K))
    # scale of a motion without stiffness, as a fraction of the highest frequency
    return np.maximum(own, 1e-6 * own.max() or 1.0)


def _sizes(K: np.ndarray) -> np.ndarray:
    """Return the size of each motion's stiffness: its own, or what cross-coupling with another one amounts to.

    Of a symmetric stiffness without negative eigenvalues that is the diagonal.
    """
    size, own = np.abs(K), np.abs(np.diag(K))
    both = np.maximum(np.maximum(size, size.T), own)
    return np.asarray((size * size.T / np.where(both > 0.0, both, 1.0)).max(axis=1))


def is_symmetric(K: np.ndarray, error: np.ndarray) -> bool:
    """Return True when K is symmetric within the errors of its columns: then the forces have a potential."""
    value_error = ZERO_EIGENVALUE * (error[:, None] + error[None, :]) + ASYMMETRY * np.outer(_scale(K), _scale(K))
    return bool(np.all(np.abs(K - K.T) <= value_error))


def _symmetric(K: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return K made symmetric: of the two values of an entry, that of the column with the smaller error."""
    better = np.where(error[:, None] < error[None, :], K.T, K)
    return np.triu(better) + np.triu(better, 1).T


def _principal(K: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues and axes of a symmetric stiffness; `free` motions have the eigenvalue 0.

    For a positive definite one, the singular values of its Cholesky factor are the frequencies: rounding
    is then relative to the highest frequency, not to its square.
    """
    firm = ~free
    inner = K[np.ix_(firm, firm)]
    try:
        axes, omega, _ = np.linalg.svd(np.linalg.cholesky(inner))
        inner_k = omega**2
    except np.linalg.LinAlgError:
        inner_k, axes = np.linalg.eigh(inner)
    k, full = np.zeros(len(K)), np.eye(len(K))
    k[firm] = inner_k
    full[np.ix_(firm, firm)] = axes
    return k, full


def _damped_eigenpairs(of: Equations) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues lambda and vectors, one of each conjugate pair, and errors of lambda."""
    loose = of.free & ~np.any(of.D, axis=0) & ~np.any(of.D, axis=1)
    kept = np.tile(~loose, 2)
    A, wrong = of.first_order(of.scale)
    value, vectors, value_error = eigenpairs(A[np.ix_(kept, kept)], wrong[np.ix_(kept, kept)])
    # displacements, not speeds: a creeping motion has hardly any speed
    inner = vectors[: len(value) // 2] / of.scale[~loose][:, None]
    real = np.abs(value.imag) <= REAL * np.abs(value)
    lasting = np.abs(value.real) <= np.maximum(REAL * np.abs(value), value_error)
    value = np.where(real, value.real, np.where(lasting, 1j * value.imag, value))
    value[np.abs(value) <= REAL * np.abs(value).max(initial=0.0)] = 0.0
    once = (value.imag > 0.0) | real
    shape = np.zeros((len(loose), int(once.sum())), dtype=complex)
    shape[~loose] = inner[:, once] / np.linalg.norm(inner[:, once], axis=0)
    still = np.eye(len(loose), dtype=complex)[:, loose]
    still_value = np.zeros(int(loose.sum()))
    return (
        np.concatenate([still_value.astype(complex), value[once]]),
        np.hstack([still, shape]),
        np.concatenate([still_value, value_error[once]]),
    )
