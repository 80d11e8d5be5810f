r"""Solids as models: displacements of the nodes, and six degrees of freedom of each rigidly tied frame.

Geometric stiffness of the stresses in a solid under given loads.

A load with the stress :math:`\sigma` in equilibrium does the second-order work

.. math:: \tfrac12\int \sigma_{ij}\,u_{k,i}\,u_{k,j}\,dV + \sum_n r_n\cdot\tfrac12\,\theta\times(\theta\times\rho_n)

on a displacement u. The sum is over nodes that follow a rigid frame at the distance :math:`\rho_n`, with the forces r
that hold them there. In a body that spins, this work cancels the spurious centrifugal softening of displacements
that are linear in the modes, since :math:`\int\sigma_{ij}\,dV` is the virial of the loads.

Source: Zienkiewicz & Taylor, *The Finite Element Method*, vol. 2 (initial stress); Wallrapp & Schwertassek (1991),
International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe import model as models
from flexclear.structure.fe.model import Drawn, Families, Integrals, Model
from flexclear.structure.fe.solid import elasticity
from flexclear.structure.fe.solid.elasticity import Solid
from flexclear.structure.fe.solid.geometry import Geometry, boundary, face_nodes
from flexclear.structure.fe.solid.mesh import mean_motion

#: families by direction, in their order within a cluster of equal frequencies
FAMILIES = ("y", "z", "x")
#: components of a frame's motion by family: a rotation about z moves the body along y
MEMBER = {"y": (1, 5), "z": (2, 4), "x": (0, 3)}
#: corners of the pieces into which a face is cut, by its number of nodes, in the order of `Element.face_nodes`
PIECES = {
    3: [[0, 1, 2]],
    4: [[0, 1, 2, 3]],
    6: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    8: [[0, 1, 2, 3]],
    9: [[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]],
}


@dataclass(frozen=True)
class Unknowns:
    """Map from the model's vector to the displacements of all nodes, (3 n, ndof), and the meaning of its unknowns."""

    spread: sp.csr_array
    position: np.ndarray  #: [m], shape (ndof, 3)
    component: np.ndarray  #: 0 .. 5, shape (ndof,)
    first: dict[int, int]  #: first unknown of each rigidly tied frame, by its number


def assemble(mesh: xr.Dataset) -> Model:
    """Build the model of a solid mesh (schema SOLID)."""
    solid = solid_of(mesh)
    unknowns = unknowns_of(mesh)
    T = unknowns.spread
    line = elasticity.mass(solid)
    K = T.T @ elasticity.stiffness(solid) @ T
    M = T.T @ sp.csr_array(sp.kron(line, sp.eye_array(3))) @ T
    frames = models.interfaces(mesh, partial(_motion, mesh, unknowns))
    recipe = mesh.attrs["interfaces"].split()
    ends = tuple(frame for name in recipe[:2] for frame in frames if frame.name == name)
    return Model(
        stiffness=models.symmetric_part(K),
        mass=models.symmetric_part(M),
        rigid=models.rigid_motions(unknowns.position, unknowns.component, unknowns.position.mean(axis=0)),
        position=unknowns.position,
        interfaces=frames,
        ends=ends,
        integrate=partial(integrals, line, solid.nodes, T),
        families=families(unknowns.position, unknowns.component),
        drawn=_drawn_surface(mesh, T),
    )


def integrals(line: sp.csr_array, nodes: np.ndarray, spread: sp.csr_array, vectors: np.ndarray) -> Integrals:
    """Return volume integrals from the mass matrix of one axis; its space holds positions as exactly as displacements.

    line: [kg], shape (n, n).  nodes: [m], shape (n, 3).  spread: vector to displacements, shape (3 n, ndof).
    """
    n, count = len(nodes), vectors.shape[1]
    S = (spread @ vectors).reshape(n, 3, count)
    weighted = (line @ S.reshape(n, -1)).reshape(n, 3, count)
    moment = line @ nodes
    pair = np.empty((3, 3, count, count))
    for k in range(3):
        for l in range(3):
            pair[k, l] = S[:, k].T @ weighted[:, l] if l >= k else pair[l, k].T
    return Integrals(
        mass=float(line.sum()),
        first_moment=moment.sum(axis=0),
        second_moment=nodes.T @ moment,
        modal_first_moment=weighted.sum(axis=0),
        position_mode_moment=np.einsum("nk,nlj->klj", nodes, weighted, optimize=True),
        mode_mode_moment=pair,
        second_order_moment=np.zeros_like(pair),
        untilted_inertia=np.zeros((3, 3)),
    )


def solid_of(mesh: xr.Dataset) -> Solid:
    """Return nodes, cells and materials of a mesh."""
    region = mesh["cell_region"].values
    E, nu, rho = (mesh[name].values[region] for name in ("youngs_modulus", "poisson", "density"))
    lame, shear = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
    return Solid(mesh.attrs["element"], mesh["node_position"].values, mesh["cell_node"].values, lame, shear, rho)


def unknowns_of(mesh: xr.Dataset) -> Unknowns:
    """Build the model's vector: displacements of the free nodes, then six unknowns of each rigidly tied frame."""
    x, n = mesh["node_position"].values, mesh.sizes["node"]
    tie_node, tie_frame = mesh["tie_node"].values, mesh["tie_frame"].values
    rigid = np.flatnonzero(mesh["frame_tie"].values == "rigid")
    led = np.zeros(n, dtype=bool)
    led[tie_node[np.isin(tie_frame, rigid)]] = True
    free = np.flatnonzero(~led)
    size = 3 * len(free)
    rows = [(3 * free[:, None] + np.arange(3)).ravel()]
    columns, values = [np.arange(size)], [np.ones(size)]
    positions, component, first = [np.repeat(x[free], 3, axis=0)], [np.tile(np.arange(3), len(free))], {}
    for k in rigid:
        nodes, position = tie_node[tie_frame == k], mesh["frame_position"].values[k]
        motion = models.rigid_displacements(x[nodes] - position)
        rows.append(np.broadcast_to((3 * nodes[:, None] + np.arange(3))[:, :, None], motion.shape).ravel())
        columns.append(np.broadcast_to(size + np.arange(6), motion.shape).ravel())
        values.append(motion.ravel())
        positions.append(np.tile(position, (6, 1)))
        component.append(np.arange(6))
        first[int(k)] = size
        size += 6
    where = (np.concatenate(rows), np.concatenate(columns))
    spread = sp.csr_array(sp.coo_array((np.concatenate(values), where), shape=(3 * n, size)))
    spread.eliminate_zeros()
    return Unknowns(spread, np.vstack(positions), np.concatenate(component), first)


def _motion(mesh: xr.Dataset, unknowns: Unknowns, k: int) -> sp.csr_array:
    """Return the motion of frame k: its own unknowns, or the mean motion of its nodes, shape (6, ndof)."""
    if k in unknowns.first:
        return models.selection(unknowns.first[k] + np.arange(6), len(unknowns.position))
    tied = mesh["tie_frame"].values == k
    nodes, weight = mesh["tie_node"].values[tied], mesh["tie_weight"].values[tied]
    x, position = mesh["node_position"].values, mesh["frame_position"].values[k]
    return sp.csr_array(mean_motion(x[nodes], weight, nodes, position, len(x)) @ unknowns.spread)


def families(position: np.ndarray, component: np.ndarray) -> Families:
    """Return the families of unknowns along x, y, z; position [m] (ndof, 3), component 0 .. 5, or more, (ndof,)."""
    member = np.zeros(len(position), dtype=np.int64)
    for rank, name in enumerate(FAMILIES):
        member[np.isin(component, MEMBER[name])] = rank
    main = tuple(np.flatnonzero(component == MEMBER[name][0]) for name in FAMILIES)
    extent = np.ptp(position, axis=0)
    along = position[:, int(np.argmax(extent))]
    local = sp.csr_array(sp.eye_array(len(position), format="csr"))
    return Families(FAMILIES, local, member, main, (along - along.min()) / extent.max())


def surface(mesh: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of the boundary, ascending, and the corners of its faces among them, shape (faces, corners).

    Faces with nodes between their corners are cut into several, where these nodes can be corners of all pieces.
    """
    geometry = Geometry(mesh.attrs["element"], mesh["node_position"].values, mesh["cell_node"].values, {}, {})
    faces = face_nodes(geometry, *boundary(geometry))
    corners = PIECES[faces.shape[1]]
    pieces = faces[:, corners].reshape(-1, len(corners[0]))
    used, cell = np.unique(pieces, return_inverse=True)
    return used, cell.reshape(pieces.shape)


def _drawn_surface(mesh: xr.Dataset, spread: sp.csr_array) -> Drawn:
    used, cell = surface(mesh)
    # nodes of a solid have no rotations
    unknowns, rows = (
        (size * np.asarray(nodes)[:, None] + np.arange(3)).ravel() for size, nodes in ((3, used), (6, range(len(used))))
    )
    motion = sp.csr_array(models.selection(unknowns, spread.shape[0], rows, 6 * len(used)) @ spread)
    return Drawn(mesh["node_position"].values[used], cell, np.zeros(len(cell)), motion)


def inertial_loads(solid: Solid) -> tuple[sp.csr_array, np.ndarray]:
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
