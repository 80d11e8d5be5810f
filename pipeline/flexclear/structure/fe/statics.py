r"""Static response of a free body, from one factorisation.

With six degrees of freedom held the stiffness is regular; its inverse G gives the response to balanced loads up to a
rigid motion. Inertia relief balances any load, :math:`P^T f = f - M R (R^T M R)^{-1} R^T f`, and removes rigid motion
from any response, :math:`P u = u - R (R^T M R)^{-1} R^T M u`. Held functionals C u = 0 add a small dense border:

.. math:: u = G f - G C^T \lambda + R c, \qquad C u = 0, \qquad R^T (f - C^T \lambda) = 0 .

Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 17 (inertia relief, attachment modes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from flexclear.structure.fe.model import Model, own_dofs
from flexclear.structure.sparse import Factor, cholesky
from flexclear.system.errors import InputError, SolverError

#: a pivot this small relative to its diagonal entry is rounding: the body moves there without strain
PIVOT = 1e-14


@dataclass(frozen=True)
class Flexibility:
    """The factorised stiffness of a body on six supports."""

    model: Model
    factor: Factor
    free: np.ndarray  #: degrees of freedom that are no supports
    momentum: np.ndarray  #: M R, shape (ndof, 6)
    inertia: np.ndarray  #: R^T M R, shape (6, 6)

    def response(self, loads: np.ndarray) -> np.ndarray:
        """Return G f, shape (ndof, m); for balanced loads correct up to a rigid motion."""
        result = np.zeros_like(loads, dtype=float)
        result[self.free] = self.factor.solve(loads[self.free])
        return result

    def balance_loads(self, loads: np.ndarray) -> np.ndarray:
        """Return P^T f: the loads with the inertia forces of the rigid motion that they cause."""
        return loads - self.momentum @ np.linalg.solve(self.inertia, self.model.rigid.T @ loads)

    def remove_momentum(self, shapes: np.ndarray) -> np.ndarray:
        """Return P u: shapes without momentum."""
        return shapes - self.model.rigid @ np.linalg.solve(self.inertia, self.momentum.T @ shapes)


def factorise_supported(model: Model, progress: Callable[[float], None]) -> Flexibility:
    """Factorise a body on six supports; raise InputError when the body is a mechanism."""
    size = np.linalg.norm(model.rigid, axis=0)
    _, places = scipy.linalg.qr(model.rigid.T / size[:, None], pivoting=True, mode="r")
    free = np.setdiff1d(np.arange(model.size), places[:6])
    inner = sp.csr_array(model.stiffness[free][:, free])
    try:
        factor = cholesky(inner, model.position[free], progress)
    except SolverError:
        raise _mechanism_error() from None
    if factor.smallest_pivot(inner.diagonal()) < PIVOT:
        raise _mechanism_error()
    momentum = model.mass @ model.rigid
    return Flexibility(model, factor, free, momentum, model.rigid.T @ momentum)


def _mechanism_error() -> InputError:
    return InputError(
        "mesh",
        "the body has more motions without strain than its six rigid ones, as where parts share only an edge or a node",
        "join the parts along faces, or define each as a separate body",
    )


@dataclass(frozen=True)
class Border:
    """Held functionals of a body, and their small dense system."""

    flexibility: Flexibility
    held: sp.csr_array
    dofs: np.ndarray | None  #: the degree of freedom of each functional, where each selects one
    answer: np.ndarray  #: G C^T, shape (ndof, c)
    scale: np.ndarray  #: of the multipliers, shape (c,)
    system: tuple[np.ndarray, np.ndarray]  #: LU factors

    def solve(self, loads: np.ndarray) -> np.ndarray:
        """Return the displacement under loads of shape (ndof, m) with the functionals at zero."""
        R = self.flexibility.model.rigid
        free = self.flexibility.response(loads)
        return self._finish(free, np.vstack([self.held @ free, R.T @ loads]), 0.0)

    def shapes(self, rows: np.ndarray) -> np.ndarray:
        """Return displacements with each functional of `rows` at one in turn, the others at zero, (ndof, rows)."""
        c = self.held.shape[0]
        values = np.eye(c)[:, rows]
        right = np.vstack([-values, np.zeros((6, len(rows)))])
        return self._finish(np.zeros((self.flexibility.model.size, len(rows))), right, values)

    def _finish(self, free: np.ndarray, right: np.ndarray, values: np.ndarray | float) -> np.ndarray:
        c = self.held.shape[0]
        right[:c] *= self.scale[:, None]
        solution = scipy.linalg.lu_solve(self.system, right)
        result = free - self.answer @ (self.scale[:, None] * solution[:c]) + self.flexibility.model.rigid @ solution[c:]
        if self.dofs is not None:
            # held degrees of freedom are exact, not only to rounding
            result[self.dofs] = values
        return result


def factorise_border(flexibility: Flexibility, held: sp.csr_array) -> Border:
    """Build the small system of held functionals, shape (c, ndof), which must prevent all rigid motion."""
    answer = flexibility.response(held.T.toarray())
    compliance, rigid = held @ answer, np.asarray(held @ flexibility.model.rigid)
    diagonal = np.abs(np.diag(compliance))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, max(diagonal.max(), 1e-300)))
    scaled = scale[:, None] * rigid
    inner = scale[:, None] * compliance * scale
    system = np.block([[inner, -scaled], [scaled.T, np.zeros((6, 6))]])
    return Border(flexibility, held, own_dofs(held), answer, scale, scipy.linalg.lu_factor(system))
