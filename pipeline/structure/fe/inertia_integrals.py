r"""Inertia invariants of a body given as slices of mass.

A point of a slice is at :math:`X + r` and moves by :math:`S = s + \theta\times r`. With the eigenvectors d and
eigenvalues :math:`\lambda` of the spread :math:`D = \int\rho\,r r^T` each integral is a sum over slices, as in

.. math:: \int\rho\,S_k S_l = \sum m\,s_k s_l + \sum_d \lambda_d (\theta\times d)_k (\theta\times d)_l

Source: the invariants of Wang & Wang (2019), eqs. (9)-(15); Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.structure.fe.model import Integrals
from flexclear.pipeline.structure.fe.slices import Slices


def integrate(body: Slices, vectors: np.ndarray) -> Integrals:
    """All invariants for vectors of shape (ndof, n); exact but for rounding."""
    m, X, D = body.mass, body.position.T, body.spread
    s, theta = (np.stack([along @ vectors for along in maps]) for maps in (body.translation, body.rotation))
    mode_mode = _mode_mode(m, s)
    position_mode = np.einsum("p,kp,lpj->klj", m, X, s)
    # principal directions of each slice: three weighted motions instead of the nine products of axes
    weights, directions = np.linalg.eigh(D)
    for weight, d in zip(weights.T, directions.transpose(2, 1, 0), strict=True):
        turned = np.cross(theta, d[:, :, None], axis=0)
        mode_mode += _mode_mode(weight, turned)
        position_mode += np.einsum("p,kp,lpj->klj", weight, d, turned)
    return Integrals(
        mass=float(m.sum()),
        first_moment=X @ m,
        second_moment=(m * X) @ X.T + D.sum(axis=0),
        modal_first_moment=np.einsum("p,kpj->kj", m, s),
        position_mode_moment=position_mode,
        mode_mode_moment=mode_mode,
    )


def _mode_mode(weight: np.ndarray, s: np.ndarray) -> np.ndarray:
    return np.einsum("kpi,lpj->klij", s * weight[:, None], s, optimize=True)
