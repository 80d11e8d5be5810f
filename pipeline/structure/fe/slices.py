r"""A beam as slices of mass that move with its sections: what integrals over the volume need.

A point of a slice at :math:`X + r` moves by :math:`s + \theta\times r`. With the slice's mass :math:`m`, centre
:math:`X` (so :math:`\int\rho\,r = 0`) and spread :math:`D = \int\rho\,r r^T`, every integral that is linear in
products of positions and shapes is a sum over slices. With the eigenvectors d and eigenvalues :math:`\lambda` of the
spread, for instance,

.. math:: \int\rho\,S_k S_l = \sum m\,s_k s_l + \sum_d \lambda_d (\theta\times d)_k (\theta\times d)_l

A lumped mass is a slice of its own.

The spread follows from the rotary inertia J that the theory gives to the section,
:math:`D = \tfrac12 \mathrm{tr}(J) 1 - J`. For a plane section this is the true spread. Without rotary inertia in
bending (Euler-Bernoulli) it is the formal one that leaves the section its spin about the axis only, in rigid as in
elastic motion, so that the answer of a mechanism does not depend on how the body frame is tied to the rod.

Source: the invariants of Wang & Wang (2019), eqs. (9)-(15); Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import skew
from flexclear.pipeline.structure.fe.beam import N_DOFS, Beam, at_points, per_point
from flexclear.pipeline.structure.fe.model import Integrals

Maps = tuple[sp.csr_array, sp.csr_array, sp.csr_array]


@dataclass(frozen=True)
class Slices:
    """p slices and how a vector moves them; axes of the mesh frame."""

    mass: np.ndarray  #: [kg], shape (p,)
    position: np.ndarray  #: X of the centre of mass [m], shape (p, 3)
    spread: np.ndarray  #: D [kg m^2], shape (p, 3, 3)
    translation: Maps  #: vector to s of the centre of mass, along x, y, z, each of shape (p, ndof)
    rotation: Maps  #: vector to theta, likewise


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


def slices(mesh: xr.Dataset, beam: Beam) -> Slices:
    """Slices at the Gauss points of all cells, then the lumped masses.

    Sums over them integrate products of two shapes exactly.
    """
    mass, positions, spread = (np.concatenate(pair) for pair in zip(_rod(mesh, beam), _lumps(mesh), strict=True))
    translation, rotation = _section_maps(beam)
    if "lump_node" in mesh:
        s, theta = _lump_maps(mesh, beam.size)
        translation, rotation = _stacked(translation, s), _stacked(rotation, theta)
    return Slices(mass, positions, spread, translation, rotation)


def _rod(mesh: xr.Dataset, beam: Beam) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    R = beam.axes
    weight = beam.basis.dx * per_point(mesh, "density")
    x = np.asarray(beam.basis.global_coordinates())[0].ravel()
    start = beam.node_position[0] - R[:, 0] * mesh["abscissa"].values[0]
    spread = np.einsum("ik,pkl,jl->pij", R, _spread(mesh, weight), R)
    return (weight * at_points(mesh, "area")).ravel(), start + np.outer(x, R[:, 0]), spread


def _spread(mesh: xr.Dataset, weight: np.ndarray) -> np.ndarray:
    """D in rod axes, shape (p, 3, 3)."""
    J = (at_points(mesh, "inertia_moment") * weight[..., None]).reshape(-1, 3)
    spread = (0.5 * J.sum(axis=1)[:, None] - J)[:, :, None] * np.eye(3)
    spread[:, 1, 2] = spread[:, 2, 1] = (per_point(mesh, "inertia_product") * weight).ravel()
    return spread


def _section_maps(beam: Beam) -> tuple[Maps, Maps]:
    """Motion of the section at all Gauss points, from the values of each cell's own functions there."""
    basis, shape = beam.basis, beam.basis.dx.shape
    rows = np.arange(basis.dx.size).reshape(shape)
    parts: list[list[Any]] = [[] for _ in range(6)]
    for i, column in enumerate(basis.element_dofs):
        s, (t, v, w) = beam.kinematics.section(basis.basis[i])
        for part, values in zip(parts, (*s, t, -1.0 * w, v), strict=True):
            part.append((np.broadcast_to(np.asarray(values), shape), np.broadcast_to(column[:, None], shape)))
    fields = [_sparse(part, rows, beam.size) @ beam.to_fields for part in parts]
    return _turned(beam.axes, fields[:3]), _turned(beam.axes, fields[3:])


def _sparse(part: list[Any], rows: np.ndarray, size: int) -> sp.csr_array:
    values = np.concatenate([v.ravel() for v, _ in part])
    columns = np.concatenate([c.ravel() for _, c in part])
    mask = values != 0.0  # each function moves one field only
    where = (np.tile(rows.ravel(), len(part))[mask], columns[mask])
    return sp.csr_array((values[mask], where), shape=(rows.size, size))


def _turned(R: np.ndarray, local: list[sp.csr_array]) -> Maps:
    x, y, z = (sp.csr_array(row[0] * local[0] + row[1] * local[1] + row[2] * local[2]) for row in R)
    return x, y, z


def _lumps(mesh: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if "lump_node" not in mesh:
        return np.empty(0), np.empty((0, 3)), np.empty((0, 3, 3))
    J = mesh["lump_inertia"].values
    positions = mesh["node_position"].values[mesh["lump_node"].values] + mesh["lump_offset"].values
    return mesh["lump_mass"].values, positions, 0.5 * np.trace(J, axis1=1, axis2=2)[:, None, None] * np.eye(3) - J


def _lump_maps(mesh: xr.Dataset, size: int) -> tuple[Maps, Maps]:
    nodes = mesh["lump_node"].values
    rows = np.arange(len(nodes))
    node = [sp.csr_array((np.ones(len(nodes)), (rows, N_DOFS * nodes + k)), shape=(len(nodes), size)) for k in range(6)]
    return carried(node, mesh["lump_offset"].values)


def carried(node: list[sp.csr_array], r: np.ndarray) -> tuple[Maps, Maps]:
    """Motion of nodes carried to centres next to them, s = u + theta x r.

    node: vector to ux uy uz rx ry rz of the nodes, each of shape (p, ndof).  r: from node to centre [m], (p, 3).
    """
    lever = [[sp.diags_array(column) for column in row] for row in -skew(r).transpose(1, 2, 0)]
    x, y, z = (
        sp.csr_array(move + row[0] @ node[3] + row[1] @ node[4] + row[2] @ node[5])
        for move, row in zip(node[:3], lever, strict=True)
    )
    return (x, y, z), (node[3], node[4], node[5])


def _stacked(above: Maps, below: Maps) -> Maps:
    x, y, z = (sp.csr_array(sp.vstack(pair)) for pair in zip(above, below, strict=True))
    return x, y, z
