r"""Slices of mass that move with a beam's sections: the form in which volume integrals are evaluated.

A point of a slice at :math:`X + r` moves by :math:`s + \theta\times r`. With the slice's mass :math:`m`, centre
:math:`X` (so :math:`\int\rho\,r = 0`) and spread :math:`D = \int\rho\,r r^T`, every integral that is linear in
products of positions and shapes is a sum over slices. With the eigenvectors d and eigenvalues :math:`\lambda` of the
spread, for instance,

.. math:: \int\rho\,S_k S_l = \sum m\,s_k s_l + \sum_d \lambda_d (\theta\times d)_k (\theta\times d)_l

A lumped mass is a slice of its own.

The spread follows from the rotary inertia J that the theory gives to the section,
:math:`D = \tfrac12 \mathrm{tr}(J) 1 - J`. To second order the point also moves by
:math:`\tfrac12\theta\times(\theta\times r)`, because the section turns as a rigid one. This part counts where it
multiplies rotation of the body frame: without it a shaft that turns about its axis would soften in torsion.

A section without rotary inertia in bending (Euler-Bernoulli) twists but never tilts, and has no gyroscopic effect.
It has the spread of its area about the axis, scaled to its polar moment of inertia; a rigid motion of the body sees the
formal spread of inertia about the axis alone.

Source: the invariants of Wang & Wang (2019), eqs. (9)-(15); Shabana, *Dynamics of Multibody Systems*, ch. 5; Houbolt &
Brooks (1957), NACA Technical Note 3905 (second-order motion of sections).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.beam import Beam, at_points, node_dofs, per_point
from flexclear.structure.fe.model import Integrals, rigid_displacements, selection

VALUES = ("mass", "position", "spread", "rigid_spread", "offset")


@dataclass(frozen=True)
class Slices:
    """p slices and their motion under a model's vector, in axes of the mesh frame."""

    mass: np.ndarray  #: [kg], shape (p,)
    position: np.ndarray  #: X of the centre of mass [m], shape (p, 3)
    spread: np.ndarray  #: D [kg m^2], shape (p, 3, 3)
    motion: sp.csr_array  #: vector to x y z of each centre of mass, then rx ry rz, slice by slice, shape (6 p, ndof)
    rigid_spread: np.ndarray  #: D that a rigid motion of the body sees; differs where sections do not tilt
    offset: np.ndarray  #: of the centre of mass from the point that the slice turns about at rest [m], shape (p, 3)


def integrate(body: Slices, vectors: np.ndarray) -> Integrals:
    """Return all invariants for vectors of shape (ndof, n); exact but for rounding."""
    m, X, D = body.mass, body.position.T, body.spread
    s, theta = _motion_of_slices(body, vectors)
    mode_mode = _products_of_modes(m, s)
    position_mode = np.einsum("p,kp,lpj->klj", m, X, s)
    # principal directions of each slice: three weighted motions, instead of nine products of axes
    weights, directions = np.linalg.eigh(D)
    for weight, d in zip(weights.T, directions.transpose(2, 1, 0), strict=True):
        turned = np.cross(theta, d[:, :, None], axis=0)
        mode_mode += _products_of_modes(weight, turned)
        position_mode += np.einsum("p,kp,lpj->klj", weight, d, turned)
    return Integrals(
        mass=float(m.sum()),
        first_moment=X @ m,
        second_moment=(m * X) @ X.T + body.rigid_spread.sum(axis=0),
        modal_first_moment=np.einsum("p,kpj->kj", m, s),
        position_mode_moment=position_mode,
        mode_mode_moment=mode_mode,
        second_order_moment=section_rotation(body, vectors)[:3],
        untilted_inertia=_inertia_without_tilt(body),
    )


def section_rotation(body: Slices, vectors: np.ndarray, axis: np.ndarray | None = None) -> np.ndarray:
    r"""Return :math:`\int\rho X_k G_l` [kg], k < 3, and :math:`\int\rho\,G_l` [kg/m], k = 3, shape (4, 3, n, n).

    :math:`\tfrac12 q^T G q = \tfrac12\,\theta\times(\theta\times r)` is the second-order motion of sections that turn
    by theta; r: from the point that the section turns about.  vectors: shape (ndof, n).  axis: of the rod, where
    sections twist about their tilted axis, which adds :math:`\tfrac12\theta_1\,(\theta\times e)\times r`.
    """
    _, theta = _motion_of_slices(body, vectors)
    first = body.mass[:, None] * body.offset
    arms = np.concatenate([body.spread + body.position[:, :, None] * first[:, None], first[:, None]], axis=1)
    along = np.einsum("lpi,pkm,mpj->klij", theta, arms, theta, optimize=True)
    square = np.einsum("pkl,mpi,mpj->klij", arms, theta, theta, optimize=True)
    if axis is not None:
        tilt = np.cross(theta, axis, axisa=0, axisc=1)
        moved = np.cross(tilt[:, None], arms[..., None], axis=2)
        along += np.einsum("m,mpi,pklj->klij", axis, theta, moved, optimize=True)
    result: np.ndarray = 0.5 * (along + along.swapaxes(2, 3)) - square
    return result


def _motion_of_slices(body: Slices, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements of the centres of mass and rotation vectors of the slices, shape (3, p, n) each."""
    moved = (body.motion @ vectors).reshape(len(body.mass), 6, vectors.shape[1]).transpose(1, 0, 2)
    return np.ascontiguousarray(moved[:3]), np.ascontiguousarray(moved[3:])


def _inertia_without_tilt(body: Slices) -> np.ndarray:
    """Return the inertia of the sections that twist but do not tilt [kg m^2], shape (3, 3)."""
    formal = body.rigid_spread[np.any(body.rigid_spread != body.spread, axis=(1, 2))].sum(axis=0)
    inertia: np.ndarray = np.trace(formal) * np.eye(3) - formal
    return inertia


def _products_of_modes(weight: np.ndarray, s: np.ndarray) -> np.ndarray:
    return np.einsum("kpi,lpj->klij", s * weight[:, None], s, optimize=True)


def slices(mesh: xr.Dataset, beam: Beam) -> Slices:
    """Return slices at the Gauss points of all cells, then the lumped masses.

    Sums over them integrate products of two shapes exactly.
    """
    rod = _rod(mesh, beam)
    if "lump_node" not in mesh:
        return rod
    lumps = _lumps(mesh, beam.size)
    values = {name: np.concatenate([getattr(part, name) for part in (rod, lumps)]) for name in VALUES}
    return Slices(**values, motion=sp.csr_array(sp.vstack([rod.motion, lumps.motion])))


def _rod(mesh: xr.Dataset, beam: Beam) -> Slices:
    R = beam.axes
    weight = beam.basis.dx * per_point(mesh, "density")
    x = np.asarray(beam.basis.global_coordinates())[0].ravel()
    start = beam.node_position[0] - R[:, 0] * mesh["abscissa"].values[0]
    J = at_points(mesh, "inertia_moment") * weight[..., None]
    rigid = second_moments(J.reshape(-1, 1, 3) * np.eye(3))
    rigid[:, 1, 2] = rigid[:, 2, 1] = (per_point(mesh, "inertia_product") * weight).ravel()
    rigid = np.einsum("ik,pkl,jl->pij", R, rigid, R)
    mass, position = (weight * at_points(mesh, "area")).ravel(), start + np.outer(x, R[:, 0])
    centred = np.zeros_like(position)
    if J[..., 1:].any():
        return Slices(mass, position, rigid, section_motion(beam), rigid, centred)
    area = at_points(mesh, "second_moment")
    scale = (J[..., 0] / (area[..., 1] + area[..., 2])).ravel()
    D = np.zeros_like(rigid)
    D[:, 1, 1], D[:, 2, 2] = scale * area[..., 2].ravel(), scale * area[..., 1].ravel()
    D[:, 1, 2] = D[:, 2, 1] = scale * per_point(mesh, "product_moment").ravel()
    return Slices(mass, position, np.einsum("ik,pkl,jl->pij", R, D, R), section_motion(beam, tilts=0.0), rigid, centred)


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """Return D of bodies with these inertias about their centres of mass, both of shape (p, 3, 3)."""
    result: np.ndarray = 0.5 * np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    return result


def section_motion(beam: Beam, tilts: float = 1.0) -> sp.csr_array:
    """Return the motion of the section at all Gauss points; tilts: 0 for sections that only twist about the rod."""

    def section(*fields: Any) -> tuple[Any, ...]:
        s, (t, v, w) = beam.kinematics.section(*fields)
        return (*s, t, -tilts * w, tilts * v)

    return fields_at_points(beam, section)


def fields_at_points(beam: Beam, fields: Callable[..., tuple[Any, ...]]) -> sp.csr_array:
    """Return two vectors at each Gauss point from a model's vector, mesh axes, shape (6 points, ndof).

    fields: their six components in rod axes, from the fields of the beam's cells.
    """
    basis, shape = beam.basis, beam.basis.dx.shape
    first = 6 * np.arange(basis.dx.size).reshape(shape)
    entries = []
    for i, column in enumerate(basis.element_dofs):
        for k, values in enumerate(fields(*basis.basis[i])):
            of_function = (np.asarray(values), first + k, column[:, None])
            entries.append([np.broadcast_to(part, shape).ravel() for part in of_function])
    values, rows, columns = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    mask = values != 0.0  # each function moves one field only
    local = sp.csr_array((values[mask], (rows[mask], columns[mask])), shape=(6 * first.size, beam.size))
    return sp.csr_array(sp.kron(sp.eye_array(2 * first.size), beam.axes) @ local @ beam.to_fields)


def _lumps(mesh: xr.Dataset, size: int) -> Slices:
    nodes, offset = mesh["lump_node"].values, mesh["lump_offset"].values
    position = mesh["node_position"].values[nodes] + offset
    D, moved = second_moments(mesh["lump_inertia"].values), at_centres(selection(node_dofs(nodes), size), offset)
    return Slices(mesh["lump_mass"].values, position, D, moved, D, offset)


def at_centres(nodes: sp.csr_array, r: np.ndarray) -> sp.csr_array:
    """Return the motion of centres at r [m], (p, 3), from the nodes, s = u + theta x r; motions: (6 p, ndof)."""
    lever = np.tile(np.eye(6), (len(r), 1, 1))
    lever[:, :3] = rigid_displacements(r)
    return sp.csr_array(sp.block_diag(list(lever)) @ nodes)
