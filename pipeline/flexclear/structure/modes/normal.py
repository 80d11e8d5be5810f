"""Normal modes of a body with held motions, or of the free body without its rigid modes.

The symmetric eigenproblem K x = lambda M x is solved from its lower end, with equal results in every process; axes and
signs that it leaves open, and the family of each mode, are chosen here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from flexclear.numerics.rotations import index_of_largest
from flexclear.structure.fe.model import Model, own_dofs
from flexclear.structure.fe.statics import Flexibility, factorise_border
from flexclear.structure.sparse import negative_pivots
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


def lowest_modes(
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
    if size <= DENSE_LIMIT or count > size // 4:
        if size > DENSE_MOST:
            most = size // 4
            raise InputError(WHERE, f"{count} modes of {size} coordinates are too many", f"request at most {most}")
        return _dense_held(model, held, count) if held.shape[0] else _dense_free(model, count)
    return _sparse_modes(model, held, count, flexibility(), progress, rough=rough)


def _dense_free(model: Model, count: int) -> Normal:
    n = model.rigid.shape[1]
    values, shapes = dense_eigenpairs(model.stiffness, model.mass, n + min(count + 1, model.size - n))
    if len(values) > n:
        without_rigid(values, n)
    elastic = shapes[:, n : n + count]
    # the solver leaves a trace of rigid motion; momentum must vanish to rounding
    momentum = model.mass @ model.rigid
    elastic = elastic - model.rigid @ np.linalg.solve(model.rigid.T @ momentum, momentum.T @ elastic)
    return Normal(values[n : n + count], elastic, np.sort(eigenvalues_to_hz(values[:n])))


def _dense_held(model: Model, held: sp.csr_array, count: int) -> Normal:
    shapes = np.zeros((model.size, count))
    dofs = own_dofs(held)
    if dofs is not None:
        free = np.setdiff1d(np.arange(model.size), dofs)
        values, shapes[free] = dense_eigenpairs(model.stiffness[free][:, free], model.mass[free][:, free], count)
        return Normal(values, shapes, NOBODY)
    space = scipy.linalg.null_space(held.toarray())
    K, M = (space.T @ (matrix @ space) for matrix in (model.stiffness, model.mass))
    values, mixed = dense_eigenpairs(sp.csr_array(0.5 * (K + K.T)), sp.csr_array(0.5 * (M + M.T)), count)
    return Normal(values, space @ mixed, NOBODY)


def _sparse_modes(
    model: Model, held: sp.csr_array, count: int, flexibility: Flexibility, progress: Progress, *, rough: bool
) -> Normal:
    if held.shape[0]:
        inverse = factorise_border(flexibility, held).solve
    else:

        def inverse(loads: np.ndarray) -> np.ndarray:
            return flexibility.remove_momentum(flexibility.response(flexibility.balance_loads(loads)))

    def compliance(loads: np.ndarray) -> np.ndarray:
        progress(None, f"{count} normal modes of {model.size} coordinates")
        return inverse(loads.reshape(-1, 1)).ravel()

    # 1e-6: relative residual of a rough eigenvalue; the error of the frequency is at most its square
    values, shapes = lanczos_eigenpairs(model.stiffness, model.mass, count, compliance, 1e-6 if rough else 0.0)
    # ARPACK leaves a trace of the held motions in the shapes; one more step of the iteration removes it
    shapes = inverse(model.mass @ shapes) * values
    rigid = NOBODY
    if not held.shape[0]:
        rigid = _rigid_frequency(model, values[0])
    below = count_below_gap(values)
    if below is not None and not rough:
        progress(None, "checking that no mode was missed")
        _require_complete_spectrum(model, held, *below)
    return Normal(values, shapes, rigid)


def _rigid_frequency(model: Model, first: float) -> np.ndarray:
    """Return the frequencies [Hz] of the rigid motions, ascending; raise SolverError when they store energy."""
    K, M = (model.rigid.T @ (matrix @ model.rigid) for matrix in (model.stiffness, model.mass))
    values = scipy.linalg.eigh(K, M, eigvals_only=True)
    without_rigid(np.append(values, first), len(values))
    return np.sort(eigenvalues_to_hz(values))


def _require_complete_spectrum(model: Model, held: sp.csr_array, count: int, between: float) -> None:
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
        where = float(eigenvalues_to_hz(np.array([between]))[0])
        raise SolverError(f"modes: {below} frequencies lie below {where:.6g} Hz, the eigensolver found {count}")


#: up to this size the dense solver is as fast, finds every multiple root, and gives complete bases
DENSE_LIMIT = 900
#: relative difference below which two frequencies are equal
EQUAL = 1e-6
#: rigid eigenvalues are zero up to rounding; elastic ones lie at least this factor above them
RIGID_GAP = 1e4


def dense_eigenpairs(stiffness: sp.csr_array, mass: sp.csr_array, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the `count` lowest eigenvalues [rad^2/s^2], ascending, and mass-normalised vectors, shape (n, count).

    Raises InputError when the mass matrix is not positive definite.
    """
    try:
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray())
    except np.linalg.LinAlgError:
        raise InputError("mesh", "the mass matrix is not positive definite", "give every coordinate a mass") from None
    return values[:count], vectors[:, :count]


def lanczos_eigenpairs(
    stiffness: sp.csr_array,
    mass: sp.csr_array,
    count: int,
    inverse: Callable[[np.ndarray], np.ndarray],
    tolerance: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the `count` lowest eigenpairs by Lanczos steps with the inverse, which maps loads to displacements.

    Eigenvalues [rad^2/s^2] ascending; vectors mass-normalised, shape (n, count).  tolerance: zero for all digits.
    Raises SolverError when the solver does not converge.
    """
    n = mass.shape[0]
    # ARPACK starts from a random vector unless given one; in equal pairs this turns the shapes from run to run
    start = inverse(mass @ np.linspace(1.0, 2.0, n))
    operator = scipy.sparse.linalg.LinearOperator((n, n), matvec=inverse, dtype=float)
    try:
        values, vectors = scipy.sparse.linalg.eigsh(
            stiffness, k=count, M=mass, sigma=0.0, which="LM", v0=start, tol=tolerance, OPinv=operator
        )
    except scipy.sparse.linalg.ArpackError as error:
        raise SolverError(f"modes: the sparse eigensolver failed for {count} of {n} modes: {error}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def count_below_gap(values: np.ndarray) -> tuple[int, float] | None:
    """Return how many eigenvalues lie below the last gap between unequal ones, and a value in the gap, or None."""
    last = clusters(values)[-1][0]
    return (last, float(0.5 * (values[last - 1] + values[last]))) if last else None


def rediagonalise(stiffness: sp.csr_array, mass: sp.csr_array, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues and mass-normalised combinations of the columns of `basis`, ascending.

    basis: shape (ndof, n).  Raises SolverError when its columns are linearly dependent.
    """
    values, vectors = _rayleigh_ritz(stiffness, mass, basis)
    spread = vectors.T @ (mass @ vectors)
    # 1e-12: modal masses that deviate from one by more are recomputed from the modes themselves
    if np.abs(spread - np.eye(len(values))).max() > 1e-12:
        # attachment modes of neighbouring frames are nearly parallel; the first result is a well-conditioned start
        values, vectors = _rayleigh_ritz(stiffness, mass, vectors)
    return values, vectors


def _rayleigh_ritz(stiffness: sp.csr_array, mass: sp.csr_array, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # first make the diagonals equal: norms of constraint modes and normal modes differ by orders of magnitude
    scaled = basis / np.sqrt(np.einsum("ij,ij->j", basis, mass @ basis))
    K, M = scaled.T @ (stiffness @ scaled), scaled.T @ (mass @ scaled)
    try:
        values, combination = scipy.linalg.eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    except np.linalg.LinAlgError:
        raise SolverError(f"modes: the {basis.shape[1]} shapes of the basis are linearly dependent") from None
    return values, scaled @ combination


def eigenvalues_to_hz(values: np.ndarray) -> np.ndarray:
    """Convert eigenvalues [rad^2/s^2] to Hz; rigid modes may be negative by rounding, so the absolute value counts."""
    return np.sqrt(np.abs(values)) / (2.0 * np.pi)


def clusters(values: np.ndarray) -> list[tuple[int, int]]:
    """Return ranges [start, stop) of equal eigenvalues; a single eigenvalue is a range of length one."""
    hertz = eigenvalues_to_hz(values)
    breaks = np.flatnonzero(np.diff(hertz) > EQUAL * hertz[1:]) + 1
    edges = [0, *breaks.tolist(), len(values)]
    return [(a, b) for a, b in pairwise(edges) if b > a]


def without_rigid(values: np.ndarray, rigid: int) -> None:
    """Raise SolverError unless exactly the first `rigid` eigenvalues are rigid, below a gap of RIGID_GAP.

    The gap is missing where the mesh contains a mechanism, or where rounding hides it.
    """
    if not values[rigid] > RIGID_GAP * np.abs(values[:rigid]).max():
        last, first = eigenvalues_to_hz(values[rigid - 1 : rigid + 1])
        raise SolverError(
            f"modes: {rigid} rigid-body modes are expected below a gap, "
            f"but mode {rigid} is at {last:.3g} Hz and mode {rigid + 1} at {first:.3g} Hz"
        )


def orient(model: Model, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Turn vectors of equal eigenvalues to the body's axes, with families in their order.

    values: ascending, shape (n,).  vectors: mass-normalised, shape (ndof, n).
    """
    result = vectors.copy()
    local, weight = model.families.local, _rank(model)
    for start, stop in clusters(values):
        if stop - start > 1:
            part = vectors[:, start:stop]
            measure = (local @ part).T @ (weight[:, None] * (local @ (model.mass @ part)))
            turn = np.linalg.eigh(0.5 * (measure + measure.T))[1]
            result[:, start:stop] = part @ turn[:, ::-1]
    return result


def _rank(model: Model) -> np.ndarray:
    """Return a weight per local component that separates the families, and positions along the body within one."""
    families = model.families
    return 0.25 * (1.0 - families.along) + (len(families.names) - 1 - families.member)


def dominant_families(model: Model, vectors: np.ndarray) -> list[str]:
    """Return for each vector the family with the largest fraction of its kinetic energy."""
    families = model.families
    fraction = (families.local @ vectors) * (families.local @ (model.mass @ vectors))
    totals = np.stack([fraction[families.member == k].sum(axis=0) for k in range(len(families.names))])
    # torsion of a solid has equal fractions along y and z
    return [families.names[k] for k in index_of_largest(totals, axis=0)]


def fix_signs(model: Model, vectors: np.ndarray, families: list[str]) -> np.ndarray:
    """Return each vector with its largest displacement (for torsion, rotation) positive.

    Of equally large components, as at the two ends of an antisymmetric shape, the first counts.
    """
    result = vectors.copy()
    main = dict(zip(model.families.names, model.families.main, strict=True))
    for j, name in enumerate(families):
        component = model.families.local[main[name]] @ vectors[:, j]
        result[:, j] *= np.sign(component[index_of_largest(np.abs(component))])
    return result
