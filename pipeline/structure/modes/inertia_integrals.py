r"""Inertia invariants of a beam as the three-dimensional body that it is.

A point of the section is at :math:`X = x e_x + y e_y + z e_z` and moves by
:math:`S = s + \theta\times(y e_y + z e_z) = s + y\,a + z\,b`, :math:`a=\theta\times e_y, b=\theta\times e_z`.
Sections are principal and centred, so with :math:`I_z = \int y^2, I_y = \int z^2` of the *inertia* section each
integral is one over the axis:

.. math:: \int\rho\,S_i S_j = \int\rho\,(A\,s_i s_j + I_z a_i a_j + I_y b_i b_j)\,dx

Source: the invariants of Wang & Wang (2019), eqs. (9)-(15); Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.structure.fe.beam import Beam, Motion, section_motion

E_Y, E_Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Integrals:
    """Volume integrals over the undeformed body; axes of the mesh frame, n vectors."""

    mass: float  #: [kg]
    first_moment: np.ndarray  #: int rho X [kg m], shape (3,)
    second_moment: np.ndarray  #: int rho X X^T [kg m^2], shape (3, 3)
    modal_first_moment: np.ndarray  #: int rho S, shape (3, n)
    position_mode_moment: np.ndarray  #: int rho X_k S_lj, shape (3, 3, n)
    mode_mode_moment: np.ndarray  #: int rho S_ki S_lj, shape (3, 3, n, n)


@dataclass(frozen=True)
class _Measures:
    """Weights of the quadrature points: rho A, rho I_z, rho I_y times ds, each of shape (cells, points)."""

    line: np.ndarray
    along_y: np.ndarray
    along_z: np.ndarray


def integrate(mesh: xr.Dataset, beam: Beam, vectors: np.ndarray) -> Integrals:
    """All invariants for vectors in node order, shape (ndof, n); exact but for rounding."""
    motion = section_motion(beam, vectors)
    measures = _measures(mesh, motion)
    s = motion.translation
    a, b = (np.cross(motion.rotation, e, axisa=0, axisc=0) for e in (E_Y, E_Z))
    X = np.zeros((3, *motion.x.shape))
    X[0] = motion.x
    second = _outer(measures.line, X) + np.diag([0.0, measures.along_y.sum(), measures.along_z.sum()])
    mode_mode = _mode_mode(measures.line, s) + _mode_mode(measures.along_y, a) + _mode_mode(measures.along_z, b)
    return Integrals(
        mass=float(measures.line.sum()),
        first_moment=np.einsum("cq,kcq->k", measures.line, X),
        second_moment=second,
        modal_first_moment=np.einsum("cq,kcqj->kj", measures.line, s),
        position_mode_moment=_position_mode(measures, X, s, a, b),
        mode_mode_moment=mode_mode,
    )


def _measures(mesh: xr.Dataset, motion: Motion) -> _Measures:
    rho, area = mesh["density"].values, mesh["area"].values
    about_y, about_z = mesh["inertia_moment"].values[:, 1], mesh["inertia_moment"].values[:, 2]
    return _Measures(*((rho * section)[:, None] * motion.weight for section in (area, about_z, about_y)))


def _outer(weight: np.ndarray, X: np.ndarray) -> np.ndarray:
    return np.einsum("cq,kcq,lcq->kl", weight, X, X)


def _position_mode(measures: _Measures, X: np.ndarray, s: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    result = np.einsum("cq,kcq,lcqj->klj", measures.line, X, s)
    result[1] += np.einsum("cq,lcqj->lj", measures.along_y, a)
    result[2] += np.einsum("cq,lcqj->lj", measures.along_z, b)
    return result


def _mode_mode(weight: np.ndarray, s: np.ndarray) -> np.ndarray:
    flat = s.reshape(3, -1, s.shape[-1])
    weighted = flat * weight.reshape(1, -1, 1)
    return np.einsum("kpi,lpj->klij", weighted, flat, optimize=True)
