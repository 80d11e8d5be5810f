r"""Slices of mass that move with a beam's sections: the form in which volume integrals are evaluated.

A point of a slice at :math:`X + r` moves by :math:`s + \theta\times r`. With the slice's mass :math:`m`, centre
:math:`X` (so :math:`\int\rho\,r = 0`) and spread :math:`D = \int\rho\,r r^T`, every integral that is linear in
products of positions and shapes is a sum over slices. With the eigenvectors d and eigenvalues :math:`\lambda` of the
spread, for instance,

.. math:: \int\rho\,S_k S_l = \sum m\,s_k s_l + \sum_d \lambda_d (\theta\times d)_k (\theta\times d)_l

A lumped mass is a slice of its own.

The spread follows from the rotary inertia J that the theory gives to the section,
:math:`D = \tfrac12 \mathrm{tr}(J) 1 - J`. For a plane section this is the true spread. Without rotary inertia in
bending (Euler-Bernoulli) it is the formal one that gives the section spin about the axis only, in rigid as in
elastic motion, so that the motion of a mechanism does not depend on how the body frame is tied to the rod.

Source: the invariants of Wang & Wang (2019), eqs. (9)-(15); Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.beam import Beam, at_points, node_dofs, per_point
from flexclear.structure.fe.model import Integrals, carried, selection

VALUES = ("mass", "position", "spread")


@dataclass(frozen=True)
class Slices:
    """p slices and their motion under a model's vector, in axes of the mesh frame."""

    mass: np.ndarray  #: [kg], shape (p,)
    position: np.ndarray  #: X of the centre of mass [m], shape (p, 3)
    spread: np.ndarray  #: D [kg m^2], shape (p, 3, 3)
    motion: sp.csr_array  #: vector to x y z of each centre of mass, then rx ry rz, slice by slice, shape (6 p, ndof)


def integrate(body: Slices, vectors: np.ndarray) -> Integrals:
    """Return all invariants for vectors of shape (ndof, n); exact but for rounding."""
    m, X, D = body.mass, body.position.T, body.spread
    moved = (body.motion @ vectors).reshape(len(m), 6, vectors.shape[1]).transpose(1, 0, 2)
    s, theta = np.ascontiguousarray(moved[:3]), np.ascontiguousarray(moved[3:])
    mode_mode = _mode_mode(m, s)
    position_mode = np.einsum("p,kp,lpj->klj", m, X, s)
    # principal directions of each slice: three weighted motions, instead of nine products of axes
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
    """Return slices at the Gauss points of all cells, then the lumped masses.

    Sums over them integrate products of two shapes exactly.
    """
    rod = _rod(mesh, beam)
    if "lump_node" not in mesh:
        return rod
    lumps = _lumps(mesh, beam.size)
    mass, position, spread = (np.concatenate([getattr(part, name) for part in (rod, lumps)]) for name in VALUES)
    return Slices(mass, position, spread, sp.csr_array(sp.vstack([rod.motion, lumps.motion])))


def _rod(mesh: xr.Dataset, beam: Beam) -> Slices:
    R = beam.axes
    weight = beam.basis.dx * per_point(mesh, "density")
    x = np.asarray(beam.basis.global_coordinates())[0].ravel()
    start = beam.node_position[0] - R[:, 0] * mesh["abscissa"].values[0]
    D = spread((at_points(mesh, "inertia_moment") * weight[..., None]).reshape(-1, 1, 3) * np.eye(3))
    D[:, 1, 2] = D[:, 2, 1] = (per_point(mesh, "inertia_product") * weight).ravel()
    D = np.einsum("ik,pkl,jl->pij", R, D, R)
    mass, position = (weight * at_points(mesh, "area")).ravel(), start + np.outer(x, R[:, 0])
    return Slices(mass, position, D, _motion(beam))


def spread(inertia: np.ndarray) -> np.ndarray:
    """Return D of bodies with these inertias about their centres of mass, both of shape (p, 3, 3)."""
    result: np.ndarray = 0.5 * np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    return result


def _motion(beam: Beam) -> sp.csr_array:
    """Return the motion of the section at all Gauss points, from the shape functions of each cell."""
    basis, shape = beam.basis, beam.basis.dx.shape
    first = 6 * np.arange(basis.dx.size).reshape(shape)
    entries = []
    for i, column in enumerate(basis.element_dofs):
        s, (t, v, w) = beam.kinematics.section(*basis.basis[i])
        for k, values in enumerate((*s, t, -1.0 * w, v)):
            of_function = (np.asarray(values), first + k, column[:, None])
            entries.append([np.broadcast_to(part, shape).ravel() for part in of_function])
    values, rows, columns = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    mask = values != 0.0  # each function moves one field only
    local = sp.csr_array((values[mask], (rows[mask], columns[mask])), shape=(6 * first.size, beam.size))
    return sp.csr_array(sp.kron(sp.eye_array(2 * first.size), beam.axes) @ local @ beam.to_fields)


def _lumps(mesh: xr.Dataset, size: int) -> Slices:
    nodes, offset = mesh["lump_node"].values, mesh["lump_offset"].values
    position = mesh["node_position"].values[nodes] + offset
    motion = at_centres(selection(node_dofs(nodes), size), offset)
    return Slices(mesh["lump_mass"].values, position, spread(mesh["lump_inertia"].values), motion)


def at_centres(nodes: sp.csr_array, r: np.ndarray) -> sp.csr_array:
    """Return the motion of centres at r [m], (p, 3), from the nodes, s = u + theta x r; motions: (6 p, ndof)."""
    lever = np.tile(np.eye(6), (len(r), 1, 1))
    lever[:, :3] = carried(r)
    return sp.csr_array(sp.block_diag(list(lever)) @ nodes)
