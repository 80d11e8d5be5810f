r"""Deficits of a reduced body, measured against the full model.

*Compliance*: displacement of a frame under unit static loads while another frame is held (or none is, and the load
is balanced by the body's inertia), for the full model, and the fraction of it that the basis reaches.

*Error bound*: a force :math:`f e^{i\omega t}` at a frame moves the free body by u, and the reduced one (with its rigid
motion) by :math:`\hat u`. With :math:`D = K - \omega^2 M` and the residual :math:`r = f - D\hat u`, which the basis and
the rigid motions do not feel, the error at the frame along the force is :math:`r^T D^{-1} r`. In the elastic modes of
the full model this is :math:`\sum_j (\phi_j^T r)^2 / (\omega_j^2-\omega^2)`, so below the first frequency
:math:`\omega_1`

.. math:: 0 \le f^T(u - \hat u) \le \frac{r^T G r}{1 - \omega^2/\omega_1^2},

where :math:`r^T G r = \sum_j (\phi_j^T r)^2/\omega_j^2` needs one static solution of the full model. At rest the bound
is the missing compliance itself.

*Resolved frequency*: the highest frequency of the free body up to which the basis, with the rigid motions, has every
frequency within a hundredth.

*Effective mass*: of a mode of unit modal mass, the square of its momentum per unit rigid motion, about the centre of
mass.

Sources: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 17; Parlett, *The Symmetric Eigenvalue
Problem* (1998), ch. 11 (residual bounds).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from flexclear.artifacts.compliance import fractions, frame_compliance
from flexclear.structure.fe.model import DIRECTIONS, Interface, Model
from flexclear.structure.fe.statics import Flexibility
from flexclear.structure.modes import normal
from flexclear.structure.modes.reference import in_own_axes
from flexclear.system.progress import Progress

#: frequencies of the error bound, as fractions of the free body's first frequency
BOUND_AT = (0.0, 0.25, 0.5)
#: a frequency is resolved when its relative difference from the full model's is at most this
RESOLVED = 0.01
#: largest number of frequencies of the full model to compare with; each costs a solution of the full model
COMPARED = 40


def measure(flexibility: Flexibility, vectors: np.ndarray, progress: Progress) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return deficits (schema BUNDLE) and attributes of a basis of mass-normalised modes, shape (ndof, n)."""
    model = flexibility.model
    names = [frame.name for frame in model.interfaces]
    progress(None, "compliance of the full model")
    whole = full_compliance(flexibility, model.interfaces)
    fraction = fractions(of_basis(flexibility, model.interfaces, vectors), whole)
    first, resolved = _frequencies(flexibility, vectors, progress)
    progress(None, "error bounds")
    at = first * np.array(BOUND_AT)
    data = {
        "frame_held": (("frame_held",), names),
        "direction": (("direction",), list(DIRECTIONS)),
        "bound_frequency": (("bound_frequency",), at),
        "compliance_full": (("frame", "frame_held", "direction"), whole),
        "compliance_share": (("frame", "frame_held", "direction"), fraction),
        "error_bound": (("frame", "direction", "bound_frequency"), error_bounds(flexibility, vectors, at, first)),
        "effective_mass": (("direction", "mode"), _effective_mass(model, vectors)),
    }
    return data, {"first_free_frequency": first, "resolved_frequency": resolved}


def error_bounds(flexibility: Flexibility, vectors: np.ndarray, hertz: np.ndarray, first: float) -> np.ndarray:
    """Return error bounds [m/N, rad/(N m)] for unit loads at every frame, shape (p, 6, frequencies).

    hertz: frequencies of the load, below `first`, the free body's first one [Hz].
    """
    model = flexibility.model
    basis = np.hstack([model.rigid, vectors])
    K, M = model.stiffness @ basis, model.mass @ basis
    loads = frame_motions(flexibility, model.interfaces)[0].T
    result = np.empty((loads.shape[1], len(hertz)))
    for k, value in enumerate(hertz):
        square = (2.0 * np.pi * value) ** 2
        if square == 0.0:
            # at rest an unbalanced load has no equilibrium; the inertia of the free body balances it
            residual = flexibility.balance_loads(loads)
            residual = residual - K[:, 6:] @ _solve(vectors.T @ K[:, 6:], vectors.T @ residual)
        else:
            inner = basis.T @ (K - square * M)
            residual = loads - (K - square * M) @ _solve(inner, basis.T @ loads)
        energy = np.einsum("ij,ij->j", residual, flexibility.response(flexibility.balance_loads(residual)))
        result[:, k] = energy / (1.0 - (value / first) ** 2)
    # rounding may give negative values where a basis misses nothing
    return np.maximum(result, 0.0).reshape(len(model.interfaces), 6, len(hertz))


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    # a shape's diagonal entry vanishes where its Rayleigh quotient is the frequency
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-9 * np.abs(matrix).max(axis=0)))
    return scale[:, None] * scipy.linalg.solve(scale[:, None] * matrix * scale, scale[:, None] * right)


def _frequencies(flexibility: Flexibility, vectors: np.ndarray, progress: Progress) -> tuple[float, float]:
    """Return the free body's first frequency, and the highest one that the basis resolves (zero: none) [Hz]."""
    model = flexibility.model
    count = min(vectors.shape[1], COMPARED, model.size - 6)
    none = sp.csr_array((0, model.size))
    full = normal.eigenvalues_to_hz(
        normal.lowest_modes(model, none, count, lambda: flexibility, progress, rough=True).values
    )
    shapes = flexibility.remove_momentum(vectors)
    values, _ = normal.rediagonalise(model.stiffness, model.mass, shapes)
    resolved = np.abs(normal.eigenvalues_to_hz(values)[:count] / full - 1.0) <= RESOLVED
    whole = count if resolved.all() else int(np.argmin(resolved))
    return float(full[0]), float(full[whole - 1]) if whole else 0.0


def _effective_mass(model: Model, vectors: np.ndarray) -> np.ndarray:
    """Return the effective mass of each mode [kg, kg m^2], shape (6, n)."""
    momentum = model.mass @ model.rigid
    inertia = model.rigid.T @ momentum
    # rigid rotation about the centre of mass: subtract the translation that cancels its momentum
    shift = np.eye(6)
    shift[:3, 3:] = -inertia[:3, 3:] / inertia[0, 0]
    return (shift.T @ (momentum.T @ vectors)) ** 2


def frame_motions(flexibility: Flexibility, interfaces: tuple[Interface, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return motions of p frames in their own axes: functionals (6 p, ndof), and their rigid motions (p, 6, 6)."""
    motion = np.vstack([in_own_axes(frame).toarray() for frame in interfaces])
    return motion, (motion @ flexibility.model.rigid).reshape(-1, 6, 6)


def full_compliance(flexibility: Flexibility, interfaces: tuple[Interface, ...]) -> np.ndarray:
    """Return the compliance [m/N, rad/(N m)] of each frame with each other one held (itself: none), shape (p, p, 6)."""
    (motion, rigid), p = frame_motions(flexibility, interfaces), len(interfaces)
    loads = np.hstack([motion.T, flexibility.momentum])
    gram = loads.T @ flexibility.response(loads)
    result = np.empty((p, p, 6))
    for i in range(p):
        for j in range(p):
            # the load on i and its reaction: at j, or the inertia of the whole body
            balance = np.zeros((6 * p + 6, 6))
            balance[6 * i : 6 * i + 6] = np.eye(6)
            if i == j:
                balance[6 * p :] = -np.linalg.solve(flexibility.inertia, rigid[i].T)
            else:
                balance[6 * j : 6 * j + 6] = -np.linalg.solve(rigid[j].T, rigid[i].T)
            result[i, j] = np.einsum("ad,ab,bd->d", balance, gram, balance)
    return result


def of_basis(flexibility: Flexibility, interfaces: tuple[Interface, ...], vectors: np.ndarray) -> np.ndarray:
    """Return the compliance that shapes (ndof, n) represent, as `full_compliance`; any combination, any scale."""
    functionals, rigid = frame_motions(flexibility, interfaces)
    K = vectors.T @ (flexibility.model.stiffness @ vectors)
    relief = np.linalg.solve(flexibility.inertia, flexibility.momentum.T @ vectors)
    scale = 1.0 / np.sqrt(np.diag(K))
    inner = scale[:, None] * (0.5 * (K + K.T)) * scale
    motion = (functionals @ (vectors * scale)).reshape(len(interfaces), 6, -1)
    return frame_compliance(motion, rigid, relief * scale, inner)


def least_fraction(
    flexibility: Flexibility, interfaces: tuple[Interface, ...], vectors: np.ndarray
) -> tuple[float, str]:
    """Return the least compliance fraction between interfaces (of a single one: of the free body), and its location."""
    whole = full_compliance(flexibility, interfaces)
    each = fractions(of_basis(flexibility, interfaces, vectors), whole)
    if len(interfaces) > 1:
        each[np.arange(len(each)), np.arange(len(each))] = 1.0
    i, j, d = np.unravel_index(int(np.argmin(each)), each.shape)
    held = "with nothing held" if i == j else f"with '{interfaces[j].name}' held"
    return float(each[i, j, d]), f"{DIRECTIONS[d]} of '{interfaces[i].name}' {held}"
