r"""Stage 1 of solids: nodes, cells, materials and tied frames from a recipe.

Frames tied to nodes: selection of the nodes, and rigid or mean ties.

Rigid (RBE2): the nodes follow the frame, :math:`u_n = u_p + \theta\times(x_n - p)`. Mean (RBE3): the frame follows the
nodes, with weights w (the area that a node represents) and :math:`c = \sum w x / \sum w`,

.. math:: \theta = J^{-1}\sum w\,(x_n-c)\times u_n, \quad J = \sum w\,(|r|^2 1 - r r^T), \quad
          u_p = \sum w\,u_n/\sum w + \theta\times(p - c) .

A force on such a frame acts as tractions of the same resultant, and nothing is stiffened.
Source: the MSC Nastran elements of these names; Heirman & Desmet (2010), Multibody Syst. Dyn. 23, 219-243.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.artifacts.schema import SOLID, conform
from flexclear.numerics.rotations import skew
from flexclear.scene.registry import suggestion
from flexclear.structure.fe.model import flatten_groups
from flexclear.structure.fe.solid import geometry as geometries
from flexclear.structure.fe.solid import imported, step
from flexclear.structure.fe.solid.elements import ELEMENTS, on_face
from flexclear.structure.fe.solid.geometry import Geometry, boundary, boundary_nodes, face_nodes
from flexclear.structure.fe.solid.recipe import MeshFile, On, SolidRecipe, StepFile
from flexclear.structure.fe.vtu import vtu
from flexclear.system.errors import InputError


def build(recipe: SolidRecipe, folder: Path, path: str) -> xr.Dataset:
    """Build the mesh dataset (schema SOLID); raise InputError for faulty meshes and frames."""
    where = f"{path} [shape]"
    shape = recipe.shape
    if isinstance(shape, StepFile):
        geometry = step.mesh_step_file(shape, folder, where)
    elif isinstance(shape, MeshFile):
        geometry = imported.read_geometry(shape, folder, where)
    else:
        geometry = geometries.generate_mesh(shape)
    geometries.check(geometry, where)
    names, region = _materials(recipe, geometry, path)
    materials = [recipe.materials.get(name) or recipe.material for name in names]
    data: dict[str, Any] = {
        "node_position": (("node", "axis"), geometry.nodes),
        "cell_node": (("cell", "corner"), geometry.cells),
        "cell_region": (("cell",), region),
        "region": (("region",), names),
    }
    for name in ("youngs_modulus", "poisson", "density"):
        data[name] = (("region",), np.array([getattr(material, name) for material in materials]))
    data |= _frames(recipe, geometry, path) | _regions(geometry)
    kind = dict.fromkeys(("body_kind", "section", "inertia_section"), "solid") | {"element": geometry.element}
    return conform(xr.Dataset(data), SOLID, title=recipe.title, interfaces=" ".join(recipe.interfaces), **kind)


def _materials(recipe: SolidRecipe, geometry: Geometry, path: str) -> tuple[list[str], np.ndarray]:
    """Return the names of the regions with a material, and the region of each cell."""
    if recipe.material is not None:
        return ["body"], np.zeros(len(geometry.cells), dtype=np.int64)
    names = list(recipe.materials)
    region = np.full(len(geometry.cells), -1, dtype=np.int64)
    for k, name in enumerate(names):
        where = f"{path} [materials.{name}]"
        if name not in geometry.cell_regions:
            known = ", ".join(sorted(geometry.cell_regions)) or "none"
            raise InputError(where, f"no region of solid cells is called '{name}'", f"known: {known}")
        cells = geometry.cell_regions[name]
        if np.any(region[cells] >= 0):
            other = names[int(region[cells].max())]
            raise InputError(where, f"the regions '{other}' and '{name}' share cells", "give each cell one material")
        region[cells] = k
    bare = int(np.count_nonzero(region < 0))
    if bare:
        raise InputError(f"{path} [materials]", f"{bare} of {len(region)} cells belong to none of {names}", "add them")
    return names, region


def _regions(geometry: Geometry) -> dict[str, Any]:
    """Return the boundary nodes of each named region, as variables of schema SOLID."""
    outside = geometries.boundary_nodes(geometry)
    groups = {name: np.intersect1d(nodes, outside) for name, nodes in regions(geometry).items()}
    nodes, region = flatten_groups(groups.values())
    return {
        "surface_region": (("surface_region",), list(groups)),
        "patch_node": (("patch",), nodes),
        "patch_region": (("patch",), region),
    }


def _frames(recipe: SolidRecipe, geometry: Geometry, path: str) -> dict[str, Any]:
    taken = np.full(len(geometry.nodes), -1, dtype=np.int64)
    names, tied, weights, origins = list(recipe.frames), [], [], []
    for k, (name, frame) in enumerate(recipe.frames.items()):
        where = f"{path} [frames.{name}.on]"
        nodes = selected_nodes(geometry, frame.on, where)
        x, weight = geometry.nodes[nodes], areas(geometry, nodes)
        check_rank(x, where)
        if frame.tie == "rigid":
            other = taken[nodes].max()
            if other >= 0:
                problem = f"'{names[other]}' and '{name}' tie the same nodes rigidly"
                raise InputError(where, problem, "make one of them a mean tie")
            taken[nodes] = k
            if taken.min() >= 0:
                raise InputError(where, "rigid ties take every node of the body", "tie fewer nodes, or their mean")
        tied.append(nodes)
        weights.append(weight)
        origins.append(centre(x, weight) if frame.position is None else np.array(frame.position))
    nodes, frames = flatten_groups(tied)
    return {
        "frame": (("frame",), names),
        "frame_tie": (("frame",), [frame.tie for frame in recipe.frames.values()]),
        "frame_position": (("frame", "axis"), np.array(origins)),
        "frame_rotation": (("frame", "axis", "axis2"), np.array([f.orientation() for f in recipe.frames.values()])),
        "tie_node": (("tie",), nodes),
        "tie_weight": (("tie",), np.concatenate(weights)),
        "tie_frame": (("tie",), frames),
    }


def as_vtu(mesh: xr.Dataset) -> bytes:
    """Return the solid with its material in the cells as a VTU file, for ParaView."""
    region = mesh["cell_region"].values
    data = {name: mesh[name].values[region] for name in ("youngs_modulus", "poisson", "density")}
    cell = ELEMENTS[mesh.attrs["element"]].cell
    return vtu(mesh["node_position"].values, cell, mesh["cell_node"].values, of_cells=data | {"region": region})


#: default distance from a surface within which a node lies on it, as a fraction of the body's size
TOLERANCE = 1e-6


def selected_nodes(geometry: Geometry, on: On, where: str) -> np.ndarray:
    """Return the nodes that a rule selects, ascending; raise InputError for no node or an unknown region."""
    if on.region is not None:
        named = regions(geometry)
        if on.region not in named:
            hint = suggestion(on.region, named) if named else "the mesh has none; select by plane or cylinder"
            raise InputError(f"{where[:-1]}.region]", f"no region is called '{on.region}'", hint)
        nodes = named[on.region]
    else:
        nodes = _nodes_on_surface(geometry, on)
    if nodes.size == 0:
        x = geometry.nodes
        box = " to ".join(str([float(f"{v:.6g}") for v in end]) for end in (x.min(axis=0), x.max(axis=0)))
        raise InputError(where, f"selects no node; the body lies within {box} m", "check position and units")
    return nodes


def regions(geometry: Geometry) -> dict[str, np.ndarray]:
    """Return the nodes of each named region; of a region with faces and cells, those of the faces."""
    of_cells = {name: np.unique(geometry.cells[cells]) for name, cells in geometry.cell_regions.items()}
    return of_cells | geometry.node_regions


def _nodes_on_surface(geometry: Geometry, on: On) -> np.ndarray:
    outside = boundary_nodes(geometry)
    x = geometry.nodes[outside]
    if on.plane is not None:
        normal = np.array(on.plane.normal) / np.linalg.norm(on.plane.normal)
        distance = (x - np.array(on.plane.point)) @ normal
    elif on.cylinder is not None:
        axis = np.array(on.cylinder.axis) / np.linalg.norm(on.cylinder.axis)
        r = x - np.array(on.cylinder.point)
        distance = np.linalg.norm(r - np.outer(r @ axis, axis), axis=1) - on.cylinder.radius
    else:
        assert on.sphere is not None
        distance = np.linalg.norm(x - np.array(on.sphere.centre), axis=1) - on.sphere.radius
    limit = on.tolerance if on.tolerance is not None else TOLERANCE * float(np.ptp(geometry.nodes, axis=0).max())
    return outside[np.abs(distance) <= limit]


def areas(geometry: Geometry, nodes: np.ndarray) -> np.ndarray:
    """Return integrals of the nodes' shape functions over the selected faces [m^2]; ones without a selected face."""
    weight = np.zeros(len(geometry.nodes))
    cells, faces = boundary(geometry)
    whole = np.isin(face_nodes(geometry, cells, faces), nodes).all(axis=1)
    for face in np.unique(faces[whole]):
        at, directions = on_face(geometry.element, int(face))
        part = geometry.cells[cells[whole & (faces == face)]]
        J = np.einsum("cai,qaj->cqij", geometry.nodes[part], at.gradient, optimize=True)
        along, across = (np.einsum("cqij,j->cqi", J, d) for d in directions)
        area = np.linalg.norm(np.cross(along, across), axis=2) * at.weight
        np.add.at(weight, part, area @ at.value)
    return weight[nodes] if weight[nodes].any() else np.ones(len(nodes))


def centre(x: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the weighted centre of points (n, 3)."""
    return weight @ x / weight.sum()


def check_rank(x: np.ndarray, where: str) -> None:
    """Raise InputError when the nodes lie on a line, about which a rotation is not determined."""
    spread = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    if len(x) < 3 or spread[1] < 1e-9 * spread[0]:
        problem = f"{len(x)} nodes on a line cannot carry a frame's rotation"
        raise InputError(where, problem, "select a face, or more nodes of it")


def mean_motion(x: np.ndarray, weight: np.ndarray, nodes: np.ndarray, position: np.ndarray, size: int) -> sp.csr_array:
    """Return the motion of a frame that follows nodes, as functionals of all displacements, shape (6, 3 size)."""
    w = weight / weight.sum()
    c = centre(x, w)
    r = x - c
    J = np.einsum("n,nk->", w, r**2) * np.eye(3) - np.einsum("n,nk,nl->kl", w, r, r)
    turn = np.linalg.solve(J, (w[:, None, None] * skew(r)).transpose(1, 0, 2).reshape(3, -1))
    shift = (w[:, None, None] * np.eye(3)).transpose(1, 0, 2).reshape(3, -1) - skew(position - c) @ turn
    values = np.vstack([shift, turn])
    columns = (3 * nodes[:, None] + np.arange(3)).ravel()
    rows = np.repeat(np.arange(6), columns.size)
    return sp.csr_array((values.ravel(), (rows, np.tile(columns, 6))), shape=(6, 3 * size))
