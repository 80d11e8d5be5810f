"""Matrices of another code as a model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph
import xarray as xr

from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.structure.fe.exchange import lumped
from flexclear.pipeline.structure.fe.exchange.files import COMPONENTS
from flexclear.pipeline.structure.fe.model import (
    Drawn,
    Integrals,
    Model,
    interfaces,
    node_motion,
    rigid_motions,
    selection,
)
from flexclear.pipeline.structure.fe.slices import integrate
from flexclear.pipeline.structure.fe.solid import ties
from flexclear.pipeline.structure.fe.solid.model import families, integrals
from flexclear.pipeline.structure.sparse.multifrontal import cholesky

WHERE = "mesh recipe [shape]"
#: blocks of the mass matrix for x, y and z that differ by less, relative to the largest entry, are the same
ALIKE = 1e-9
#: strain forces of a rigid motion, relative to the largest term that they are a sum of
UNSTRAINED = 1e-6


def assemble(mesh: xr.Dataset) -> Model:
    """The model of a dataset (schema MATRICES); InputError when the matrices are not those of a free body."""
    component = np.array([COMPONENTS.index(name) for name in mesh["unknown_component"].values])
    positions, n = mesh["unknown_position"].values, mesh.sizes["unknown"]
    K, M = (_matrix(mesh, name, n) for name in ("stiffness", "mass"))
    rigid = rigid_motions(positions, component, positions.mean(axis=0))
    _check(K, M, rigid, positions)
    frames = interfaces(mesh, partial(_motion, mesh, component))
    names = mesh.attrs["interfaces"].split()
    return Model(
        stiffness=K,
        mass=M,
        rigid=rigid,
        position=positions,
        interfaces=frames,
        ends=tuple(frame for name in names[:2] for frame in frames if frame.name == name),
        integrate=_integrate(mesh, M, component),
        families=families(positions, component),
        drawn=_drawn(mesh, component),
    )


def _matrix(mesh: xr.Dataset, name: str, n: int) -> sp.csr_array:
    row, column, value = (mesh[f"{name}_{part}"].values for part in ("row", "column", "value"))
    return sp.csr_array(sp.coo_array((value, (row, column)), shape=(n, n)))


def _check(K: sp.csr_array, M: sp.csr_array, rigid: np.ndarray, positions: np.ndarray) -> None:
    left = np.abs(K @ rigid).max(axis=0) / (abs(K) @ np.abs(rigid)).max(axis=0)
    if left.max() > UNSTRAINED:
        worst = COMPONENTS[int(np.argmax(left))]
        raise InputError(
            WHERE,
            f"a rigid motion along {worst} strains the body ({left.max():.2g} of the largest term)",
            "export the free body, without supports; check the units and the table of unknowns",
        )
    # unknowns of one node belong together, even where axial, bending and torsion are independent of each other
    _, node = np.unique(positions, axis=0, return_inverse=True)
    linked = sp.coo_array(K)
    pairs = (np.ones(linked.nnz), (node.ravel()[linked.row], node.ravel()[linked.col]))
    pieces, _ = scipy.sparse.csgraph.connected_components(sp.coo_array(pairs).tocsr(), directed=False)
    if pieces > 1:
        raise InputError(
            WHERE,
            f"the stiffness matrix is that of {pieces} bodies that share no node",
            "make each a body of its own",
        )
    try:
        cholesky(M, positions)
    except SolverError:
        raise InputError(WHERE, "the mass matrix is not positive definite", "give every unknown a mass") from None


def _integrate(mesh: xr.Dataset, M: sp.csr_array, component: np.ndarray) -> Callable[[np.ndarray], Integrals]:
    if "pair_value" in mesh:
        return partial(_from_moments, mesh)
    node = mesh["unknown_node"].values
    rows = [np.flatnonzero(component == k) for k in range(3)]
    rows = [row[np.argsort(node[row], kind="stable")] for row in rows]
    same = sum(len(row) for row in rows) == len(node) and all(np.array_equal(node[rows[0]], node[row]) for row in rows)
    if same:
        line = sp.csr_array(M[rows[0]][:, rows[0]])
        alike = ALIKE * abs(line).max()
        blocks = [(k, l, M[rows[k]][:, rows[l]]) for k in range(3) for l in range(3)]
        same = all(abs(block - line if k == l else block).max() <= alike for k, l, block in blocks)
    if not same:
        rigid = lumped.nodes(M, node, component, mesh["unknown_position"].values)
        if rigid is None:
            raise InputError(
                WHERE,
                "the mass matrix differs for motion along x, y and z and is not lumped at the nodes, so that it does "
                "not determine the volume integrals",
                "lump the mass, use nodes with three displacements, or give an npz with the integrals",
            )
        return partial(integrate, rigid)
    order = np.stack(rows, axis=1).ravel()
    spread = sp.csr_array(sp.eye_array(len(node), format="csr")[order])
    return partial(integrals, line, mesh["unknown_position"].values[rows[0]], spread)


def _from_moments(mesh: xr.Dataset, vectors: np.ndarray) -> Integrals:
    n, count = mesh.sizes["unknown"], vectors.shape[1]
    pair = np.empty((3, 3, count, count))
    axes, row, column, value = (mesh[f"pair_{name}"].values for name in ("axes", "row", "column", "value"))
    for k in range(3):
        for l in range(k, 3):
            at = axes == 3 * k + l
            matrix = sp.csr_array(sp.coo_array((value[at], (row[at], column[at])), shape=(n, n)))
            pair[k, l] = vectors.T @ (matrix @ vectors)
            pair[l, k] = pair[k, l].T
    return Integrals(
        mass=float(mesh["body_mass"]),
        first_moment=mesh["first_moment"].values,
        second_moment=mesh["second_moment"].values,
        modal_first_moment=mesh["unknown_first_moment"].values @ vectors,
        position_mode_moment=mesh["unknown_position_moment"].values @ vectors,
        mode_mode_moment=pair,
    )


def _motion(mesh: xr.Dataset, component: np.ndarray, k: int) -> sp.csr_array:
    """Motion of frame k: that of its node, or the mean one of its nodes."""
    tied, node = mesh["tie_node"].values[mesh["tie_frame"].values == k], mesh["unknown_node"].values
    count = 6 if len(tied) == 1 else 3
    rows = np.array([[np.flatnonzero((node == t) & (component == c))[0] for c in range(count)] for t in tied])
    pick = selection(rows.ravel(), len(component))
    if len(tied) == 1:
        return pick
    x = mesh["unknown_position"].values[rows[:, 0]]
    return sp.csr_array(ties.mean(x, np.ones(len(x)), np.arange(len(x)), x.mean(axis=0), len(x)) @ pick)


def _drawn(mesh: xr.Dataset, component: np.ndarray) -> Drawn:
    """Nodes as points; a component that a node does not have is drawn at rest."""
    numbers, first, index = np.unique(mesh["unknown_node"].values, return_index=True, return_inverse=True)
    count, position = len(numbers), mesh["unknown_position"].values[first]
    motion = node_motion(index.ravel(), component, count)
    return Drawn(position, np.arange(count)[:, None], np.zeros(count), motion)
