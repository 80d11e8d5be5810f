r"""Geometric stiffness of the stresses in a solid under given loads.

A load with the stress :math:`\sigma` in equilibrium does the second-order work

.. math:: \tfrac12\int \sigma_{ij}\,u_{k,i}\,u_{k,j}\,dV + \sum_n r_n\cdot\tfrac12\,\theta\times(\theta\times\rho_n)

on a displacement u. The sum is over nodes that follow a rigid frame at the distance :math:`\rho_n`, with the forces r
that hold them there. In a body that spins, this work cancels the spurious centrifugal softening of displacements
that are linear in the modes, since :math:`\int\sigma_{ij}\,dV` is the virial of the loads.

Source: Zienkiewicz & Taylor, *The Finite Element Method*, vol. 2 (initial stress); Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.solid import elasticity
from flexclear.structure.fe.solid.elasticity import Solid
from flexclear.structure.fe.solid.model import Unknowns


def inertial(solid: Solid) -> tuple[sp.csr_array, np.ndarray]:
    """Return the nodes' mass along one axis, (nodes, nodes), and nodal loads rho X_k e_l.

    The loads have the shape (3 nodes, k, l) with k from 0 to 3 (X_3 = 1).
    """
    line, place = elasticity.mass(solid), np.column_stack([solid.nodes, np.ones(len(solid.nodes))])
    return line, np.einsum("nk,li->nikl", line @ place, np.eye(3)).reshape(-1, 4, 3)


def forms(
    mesh: xr.Dataset,
    solid: Solid,
    unknowns: Unknowns,
    vectors: np.ndarray,
    displacement: np.ndarray,
    loads: np.ndarray,
) -> np.ndarray:
    """Return the second-order work per pair of vectors, shape (m, n, n), of m loads in equilibrium.

    vectors, displacement: model's vectors, the second of the response to each load, (ndof, n) and (ndof, m).
    loads: nodal, inertia forces included, without those on frames, (3 nodes, m).
    """
    u = unknowns.spread @ displacement
    S = (unknowns.spread @ vectors).reshape(len(solid.nodes), -1)
    result = np.stack([_work(elasticity.stress_stiffness(solid, one.reshape(-1, 3)), S) for one in u.T])
    for frame, first in unknowns.first.items():
        nodes = mesh["tie_node"].values[mesh["tie_frame"].values == frame]
        # the stiffness of the nodes that the frame leads is that of their cells
        around = np.isin(solid.cells, nodes).any(axis=1)
        parts = {name: getattr(solid, name)[around] for name in ("cells", "lame", "shear", "density")}
        force = (elasticity.stiffness(replace(solid, **parts)) @ u - loads).reshape(len(solid.nodes), 3, -1)[nodes]
        arm = solid.nodes[nodes] - mesh["frame_position"].values[frame]
        result += _of_rigid_frame(force, arm, vectors[first + 3 : first + 6])
    return result


def _work(stress: sp.csr_array, S: np.ndarray) -> np.ndarray:
    """Return sum over x y z of S^T stress S, shape (n, n); S: displacements of the nodes, (nodes, 3 n)."""
    n = S.shape[1] // 3
    form = S.reshape(-1, n).T @ (stress @ S).reshape(-1, n)
    return 0.5 * (form + form.T)


def _of_rigid_frame(force: np.ndarray, arm: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the work of forces (nodes, 3, m) that hold nodes at `arm` to a frame that turns by theta, (m, n, n)."""
    virial = np.einsum("nim,nj->mij", force, arm)
    turned = np.einsum("ia,mij,jb->mab", theta, virial, theta, optimize=True)
    result: np.ndarray = 0.5 * (turned + turned.swapaxes(1, 2))
    return result - np.trace(virial, axis1=1, axis2=2)[:, None, None] * (theta.T @ theta)
