r"""Surface stress fields of a solid by mode acceleration: the fields that its stress combines linearly.

With shapes V of frequencies Omega, and G the response of the free body to balanced loads (`modes.statics`), a load g
adds to the response of the shapes, :math:`V\Omega^{-2}V^T g`, the part that they lack:

.. math:: u = V q + \sum_i \left(G - V\Omega^{-2}V^T\right) P^T g_i\,c_i .

The loads are unit forces and moments of the frames, the inertia of the body under any linear field of acceleration
:math:`a + B X` (translation, angular acceleration, centrifugal), and that of each shape. So interface loads and inertia
of the rigid motion act in full, whatever the shapes are; of a Craig-Bampton basis the former lack nothing.

In each cell stress is taken at the points where it is most accurate (Barlow), and extrapolated to the
nodes by the polynomial through them. A node has the mean of its cells; at a material interface, of the stiffer ones.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 11 (mode acceleration); Barlow (1976), Int.
J. Numer. Methods Eng. 10, 243-251; Hinton & Campbell (1974), Int. J. Numer. Methods Eng. 8, 461-480.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.artifacts.coordinates import AXES
from flexclear.scene.registry import suggestion
from flexclear.structure.fe.model import DIRECTIONS, Model, flatten_groups, rows
from flexclear.structure.fe.solid import elasticity
from flexclear.structure.fe.solid.elasticity import Solid
from flexclear.structure.fe.solid.elements import ELEMENTS, from_stress_points, sample_element
from flexclear.structure.fe.solid.model import assemble, solid_of, surface, unknowns_of
from flexclear.structure.fe.statics import factorise_supported
from flexclear.system.errors import InputError

#: rows and columns of the six components of a symmetric tensor, in the order of the dimension `tensor`
ROWS, COLUMNS = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
#: largest distance of a gauge's node from the given position, as a fraction of the body's size
ASTRAY = 0.1
#: mesh variables by the key of a gauge: names, nodes, and the index of the name of each node
CHOSEN = {
    "frame": ("frame", "tie_node", "tie_frame"),
    "region": ("surface_region", "patch_node", "patch_region"),
}


def recover(mesh: xr.Dataset, modes: xr.Dataset, gauges: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the variables STRESS of a bundle.

    gauges: those of this body by name, as in `[output.gauges]`.  Raises InputError for one that is not on the surface.
    """
    model, unknowns, solid = assemble(mesh), unknowns_of(mesh), solid_of(mesh)
    shown, doubtful = surface(mesh)[0], _near_rigid_ties(mesh)
    places = _gauge_indices(mesh, shown, gauges)
    if doubtful[shown].all():
        artefact = "cells at a rigidly tied frame, where stress is an artefact of the tie"
        problem = f"all surface nodes lie in {artefact}"
        raise InputError("[output] stress", problem, "refine the mesh, or tie the frame in the mean")
    vectors, omega = modes["vector"].values, 2.0 * np.pi * modes["frequency"].values
    inertia = _inertia(elasticity.mass(solid), solid.nodes, unknowns.spread)
    loads = np.hstack([rows(model.interfaces, model.size).T.toarray(), inertia, -(model.mass @ vectors)])
    fields = unknowns.spread @ np.hstack([vectors, _missing_response(model, vectors, omega, loads)])
    names = [f"mode {k + 1}" for k in range(len(omega))]
    names += [f"{frame.name} {direction}" for frame in model.interfaces for direction in DIRECTIONS]
    names += [f"acceleration {k}" for k in AXES] + [f"acceleration {k} per {x}" for k in AXES for x in AXES]
    names += [f"acceleration of mode {k + 1}" for k in range(len(omega))]
    entries, gauge = flatten_groups(places.values())
    return {
        "stress_field": (("node", "tensor", "field"), at_nodes(solid, shown, fields)),
        "field": (("field",), names),
        "node_doubtful": (("node",), doubtful[shown].astype(np.int8)),
        "gauge": (("gauge",), list(places)),
        "gauge_node": (("gauge_entry",), entries),
        "gauge_index": (("gauge_entry",), gauge),
    }


def at_nodes(solid: Solid, nodes: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Return the stress of displacement fields (3 n, f) at some nodes, shape (nodes, 6, f) [Pa per unit of field]."""
    at = sample_element(solid.element, ELEMENTS[solid.element].stress_order)
    outward, f = from_stress_points(solid.element), fields.shape[1]
    moved = fields.reshape(-1, 3, f)
    number = np.full(len(solid.nodes), -1)
    number[nodes] = np.arange(len(nodes))
    stiffest = np.zeros(len(solid.nodes))
    np.maximum.at(stiffest, solid.cells, solid.shear[:, None])
    total, count = np.zeros((len(nodes), 6 * f)), np.zeros(len(nodes))
    for part in elasticity.chunks(solid, at, f):
        cells = solid.cells[part]
        slope = np.einsum("cqaj,caif->cqijf", elasticity.gradients(solid, part, at)[1], moved[cells], optimize=True)
        values = _stress(slope, solid.lame[part], solid.shear[part])
        of_cells = np.einsum("aq,cqsf->casf", outward, values, optimize=True).reshape(cells.size, -1)
        entry = np.flatnonzero(((number[cells] >= 0) & (solid.shear[part, None] >= stiffest[cells])).ravel())
        row = number[cells].ravel()[entry]
        gather = sp.csr_array((np.ones(len(entry)), (row, entry)), shape=(len(nodes), cells.size))
        total += gather @ of_cells
        count += np.bincount(row, minlength=len(nodes))
    return (total / count[:, None]).reshape(len(nodes), 6, f)


def _stress(slope: np.ndarray, lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Return stress components (cell, point, 6, f) of displacement gradients (cell, point, 3, 3, f)."""
    mu = shear[:, None, None, None]
    result = mu * (slope[:, :, ROWS, COLUMNS] + slope[:, :, COLUMNS, ROWS])
    result[:, :, :3] += lame[:, None, None, None] * np.einsum("cqiif->cqf", slope)[:, :, None]
    return np.asarray(result)


def _inertia(line: sp.csr_array, nodes: np.ndarray, spread: sp.csr_array) -> np.ndarray:
    """Return inertia loads of the accelerations e_k, then e_k X_l with l running faster, shape (ndof, 12)."""
    weighted = line @ np.column_stack([np.ones(len(nodes)), nodes])
    forces = np.zeros((len(nodes), 3, 3, 4))
    for k in range(3):
        forces[:, k, k] = -weighted
    loads = (spread.T @ forces.reshape(-1, 12)).reshape(-1, 3, 4)
    return np.hstack([loads[:, :, 0], loads[:, :, 1:].reshape(-1, 9)])


def _missing_response(model: Model, vectors: np.ndarray, omega: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Return the part of the response to each balanced load that the shapes lack, up to rigid motion, (ndof, loads)."""
    flexibility = factorise_supported(model, lambda _: None)
    balanced = flexibility.balance_loads(loads)
    return flexibility.response(balanced) - vectors @ ((vectors.T @ balanced) / omega[:, None] ** 2)


def _near_rigid_ties(mesh: xr.Dataset) -> np.ndarray:
    """Return True for nodes with a cell that touches a rigidly tied node, shape (n,)."""
    rigid = np.flatnonzero(mesh["frame_tie"].values == "rigid")
    tied = np.zeros(mesh.sizes["node"], dtype=bool)
    tied[mesh["tie_node"].values[np.isin(mesh["tie_frame"].values, rigid)]] = True
    cells = mesh["cell_node"].values
    touching = np.zeros_like(tied)
    touching[cells[tied[cells].any(axis=1)]] = True
    return touching


def _gauge_indices(
    mesh: xr.Dataset, shown: np.ndarray, gauges: Mapping[str, Mapping[str, Any]]
) -> dict[str, np.ndarray]:
    """Return the indices of each gauge's nodes among the shown ones."""
    found = {}
    for name, gauge in gauges.items():
        where = f"[output.gauges.{name}]"
        if gauge.get("position") is not None:
            found[name] = np.array([_nearest_node(mesh["node_position"].values[shown], gauge["position"], where)])
            continue
        kind = "frame" if gauge.get("frame") is not None else "region"
        dim, nodes, index = CHOSEN[kind]
        names = mesh[dim].values.tolist()
        if gauge[kind] not in names:
            raise InputError(f"{where} {kind}", f"unknown {kind} '{gauge[kind]}'", suggestion(gauge[kind], names))
        chosen = mesh[nodes].values[mesh[index].values == names.index(gauge[kind])]
        found[name] = np.flatnonzero(np.isin(shown, chosen))
        if not found[name].size:
            raise InputError(f"{where} {kind}", f"'{gauge[kind]}' has no node on the surface", "choose another region")
    return found


def _nearest_node(x: np.ndarray, position: tuple[float, float, float], where: str) -> int:
    away = np.linalg.norm(x - np.array(position), axis=1)
    nearest = int(np.argmin(away))
    if away[nearest] > ASTRAY * float(np.ptp(x, axis=0).max()):
        at = [float(f"{v:.6g}") for v in x[nearest]]
        problem = f"the nearest node of the surface, at {at} m, is {away[nearest]:.3g} m away"
        raise InputError(f"{where} position", problem, "give a position on the surface, in the body frame")
    return nearest
