"""Solids as a kind of body."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.model import Interface, Kind, Model, SecondOrder
from flexclear.structure.fe.solid import mesh as meshes
from flexclear.structure.fe.solid.model import assemble, forms, inertial_loads, solid_of, unknowns_of
from flexclear.structure.fe.statics import Flexibility, factorise_border, factorise_supported

#: a body is a rod where its second largest extent is below this fraction of the largest
SLENDER = 0.5


def _mode_words(model: Model, families: list[str], vectors: np.ndarray) -> list[str]:
    """Return bending, torsion or axial for each mode of a rod, by its surface motion; elastic for other bodies."""
    X = model.drawn.position - model.drawn.position.mean(axis=0)
    _, extent, axes = np.linalg.svd(X, full_matrices=False)
    if extent[1] > SLENDER * extent[0]:
        return ["elastic"] * vectors.shape[1]
    u = model.drawn.nodal_motion(vectors)[:, :3]
    axis = axes[0]
    across = X - np.outer(X @ axis, axis)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    radial = np.divide(across, size, out=np.zeros_like(across), where=size > 1e-9 * extent[0])
    swirl = np.cross(axis, radial)
    along, out, turn = (np.einsum("nk,nkj->nj", e, u) for e in (np.broadcast_to(axis, X.shape), radial, swirl))
    energy = [(part**2).sum(axis=0) for part in (along, out, turn)]
    return [_kind_of_mode(*parts) for parts in zip(*energy, strict=True)]


def _kind_of_mode(along: float, out: float, turn: float) -> str:
    # 4.0: a mode is torsion where the swirl about the axis has this many times the energy of all other motion
    if turn > 4.0 * (along + out):
        return "torsion"
    return "axial" if along > out + turn else "bending"


def _second_order(
    mesh: xr.Dataset, model: Model, vectors: np.ndarray, stiffening: bool, held: Interface | None
) -> SecondOrder:
    """Return the second-order motion under the stresses of a free spin; with stiffening, under those of all loads."""
    flexibility, n = factorise_supported(model, lambda fraction: None), vectors.shape[1]
    solid, unknowns = solid_of(mesh), unknowns_of(mesh)
    spread, (line, nodal) = unknowns.spread, inertial_loads(solid)
    forms_of = partial(forms, mesh, solid, unknowns, vectors)
    if not stiffening:
        pairs = np.stack(np.triu_indices(3), axis=1)
        nodal = np.stack([0.5 * (nodal[:, k, l] + nodal[:, l, k]) for k, l in pairs], axis=1)
        work = forms_of(*_free_body_response(flexibility, spread, line, nodal, spread.T @ nodal))
        moment = np.empty((3, 3, n, n))
        for (k, l), form in zip(pairs, work, strict=True):
            moment[k, l] = moment[l, k] = -form
        return SecondOrder(moment)
    of_frames = np.hstack([frame.motion.T.toarray() for frame in model.interfaces])
    nodal = np.hstack([nodal.reshape(len(nodal), 12), np.zeros((len(nodal), of_frames.shape[1]))])
    loads = np.hstack([spread.T @ nodal[:, :12], of_frames])
    if held is None:
        response, nodal = _free_body_response(flexibility, spread, line, nodal, loads)
    else:
        response = factorise_border(flexibility, held.motion).solve(loads)
    found = -forms_of(response, nodal)
    moments, at_frames = found[:12].reshape(4, 3, n, n), found[12:].reshape(-1, 2, 3, n, n)
    return SecondOrder(moments[:3], moments[3], at_frames[:, 0], at_frames[:, 1])


def _free_body_response(
    flexibility: Flexibility, spread: sp.csr_array, line: sp.csr_array, nodal: np.ndarray, loads: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return response (ndof, m) and nodal loads (3 nodes, m) of a free body, with its inertia forces."""
    acceleration = np.linalg.solve(flexibility.inertia, flexibility.model.rigid.T @ loads)
    moved = spread @ (flexibility.model.rigid @ acceleration)
    inertia = (line @ moved.reshape(line.shape[0], -1)).reshape(moved.shape)
    return flexibility.response(flexibility.balance_loads(loads)), nodal - inertia


KIND = Kind(build=meshes.build, vtu=meshes.as_vtu, assemble=assemble, words=_mode_words, second_order=_second_order)
