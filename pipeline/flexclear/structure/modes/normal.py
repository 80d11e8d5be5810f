"""Normal modes of a body with held motions, or of the free body without its rigid modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from flexclear.structure.fe.model import Model, own_dofs
from flexclear.structure.fe.statics import Flexibility, border
from flexclear.structure.modes import eigen
from flexclear.structure.sparse.multifrontal import negative_pivots
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

#: size of the largest dense eigenproblem; its three matrices take about a gigabyte
DENSE_MOST = 6000
NOBODY = np.empty(0)
WHERE = "modes.count"


@dataclass(frozen=True)
class Normal:
    """Ascending eigenvalues [rad^2/s^2], mass-normalised shapes (ndof, n), and removed rigid frequencies [Hz]."""

    values: np.ndarray
    shapes: np.ndarray
    rigid_frequency: np.ndarray


def lowest(
    model: Model,
    held: sp.csr_array,
    count: int,
    flexibility: Callable[[], Flexibility],
    progress: Progress,
    *,
    rough: bool = False,
) -> Normal:
    """Return the `count` lowest normal modes with the functionals `held`, shape (c, ndof), at zero.

    Without held functionals: those of the free body, without its six rigid modes, which a gap identifies.
    rough: frequencies of a large model to six digits only, without the check that none is missing.
    Raises InputError for too many modes of a large mesh, SolverError when some are missed.
    """
    size = model.size - held.shape[0]
    if size <= eigen.DENSE_LIMIT or count > size // 4:
        if size > DENSE_MOST:
            most = size // 4
            raise InputError(WHERE, f"{count} modes of {size} coordinates are too many", f"request at most {most}")
        return _dense_held(model, held, count) if held.shape[0] else _dense_free(model, count)
    return _sparse_modes(model, held, count, flexibility(), progress, rough=rough)


def _dense_free(model: Model, count: int) -> Normal:
    n = model.rigid.shape[1]
    values, shapes = eigen.dense_eigenpairs(model.stiffness, model.mass, n + min(count + 1, model.size - n))
    if len(values) > n:
        eigen.without_rigid(values, n)
    elastic = shapes[:, n : n + count]
    # the solver leaves a trace of rigid motion; momentum must vanish to rounding
    momentum = model.mass @ model.rigid
    elastic = elastic - model.rigid @ np.linalg.solve(model.rigid.T @ momentum, momentum.T @ elastic)
    return Normal(values[n : n + count], elastic, np.sort(eigen.frequency(values[:n])))


def _dense_held(model: Model, held: sp.csr_array, count: int) -> Normal:
    shapes = np.zeros((model.size, count))
    dofs = own_dofs(held)
    if dofs is not None:
        free = np.setdiff1d(np.arange(model.size), dofs)
        values, shapes[free] = eigen.dense_eigenpairs(model.stiffness[free][:, free], model.mass[free][:, free], count)
        return Normal(values, shapes, NOBODY)
    space = scipy.linalg.null_space(held.toarray())
    K, M = (space.T @ (matrix @ space) for matrix in (model.stiffness, model.mass))
    values, mixed = eigen.dense_eigenpairs(sp.csr_array(0.5 * (K + K.T)), sp.csr_array(0.5 * (M + M.T)), count)
    return Normal(values, space @ mixed, NOBODY)


def _sparse_modes(
    model: Model, held: sp.csr_array, count: int, flexibility: Flexibility, progress: Progress, *, rough: bool
) -> Normal:
    if held.shape[0]:
        inverse = border(flexibility, held).solve
    else:

        def inverse(loads: np.ndarray) -> np.ndarray:
            return flexibility.remove_momentum(flexibility.response(flexibility.balance_loads(loads)))

    def compliance(loads: np.ndarray) -> np.ndarray:
        progress(None, f"{count} normal modes of {model.size} coordinates")
        return inverse(loads.reshape(-1, 1)).ravel()

    # 1e-6: relative residual of a rough eigenvalue; the error of the frequency is at most its square
    values, shapes = eigen.lanczos_eigenpairs(model.stiffness, model.mass, count, compliance, 1e-6 if rough else 0.0)
    # ARPACK leaves a trace of the held motions in the shapes; one more step of the iteration removes it
    shapes = inverse(model.mass @ shapes) * values
    rigid = NOBODY
    if not held.shape[0]:
        rigid = _rigid_frequency(model, values[0])
    below = eigen.gap(values)
    if below is not None and not rough:
        progress(None, "checking that no mode was missed")
        _nothing_missed(model, held, *below)
    return Normal(values, shapes, rigid)


def _rigid_frequency(model: Model, first: float) -> np.ndarray:
    """Return the frequencies [Hz] of the rigid motions, ascending; raise SolverError when they store energy."""
    K, M = (model.rigid.T @ (matrix @ model.rigid) for matrix in (model.stiffness, model.mass))
    values = scipy.linalg.eigh(K, M, eigvals_only=True)
    eigen.without_rigid(np.append(values, first), len(values))
    return np.sort(eigen.frequency(values))


def _nothing_missed(model: Model, held: sp.csr_array, count: int, between: float) -> None:
    """Raise SolverError unless K - s M, s = `between`, has `count` negative pivots (Sylvester's law of inertia)."""
    shifted = sp.csr_array(model.stiffness - between * model.mass)
    dofs = own_dofs(held)
    extra, positions = 0, model.position
    if held.shape[0] == 0:
        count += model.rigid.shape[1]
    elif dofs is not None:
        free = np.setdiff1d(np.arange(model.size), dofs)
        shifted, positions = sp.csr_array(shifted[free][:, free]), positions[free]
    else:
        # each held functional adds one eigenvalue of either sign (Gould 1985)
        extra = held.shape[0]
        shifted = sp.csr_array(
            sp.vstack([sp.hstack([shifted, held.T]), sp.hstack([held, sp.csr_array((extra, extra))])])
        )
        positions = np.vstack([positions, np.zeros((extra, 3))])
    below = negative_pivots(shifted, positions, extra) - extra
    if below != count:
        where = float(eigen.frequency(np.array([between]))[0])
        raise SolverError(f"modes: {below} frequencies lie below {where:.6g} Hz, the eigensolver found {count}")
