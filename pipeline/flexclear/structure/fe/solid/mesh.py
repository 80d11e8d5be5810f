"""Stage 1 of solids: nodes, cells, materials and tied frames from a recipe."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import SOLID, conform
from flexclear.structure.fe.model import flatten_groups
from flexclear.structure.fe.solid import geometry as geometries
from flexclear.structure.fe.solid import imported, step, ties
from flexclear.structure.fe.solid.elements import ELEMENTS
from flexclear.structure.fe.solid.geometry import Geometry
from flexclear.structure.fe.solid.recipe import MeshFile, SolidRecipe, StepFile
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
    regions = {name: np.intersect1d(nodes, outside) for name, nodes in ties.regions(geometry).items()}
    nodes, region = flatten_groups(regions.values())
    return {
        "surface_region": (("surface_region",), list(regions)),
        "patch_node": (("patch",), nodes),
        "patch_region": (("patch",), region),
    }


def _frames(recipe: SolidRecipe, geometry: Geometry, path: str) -> dict[str, Any]:
    taken = np.full(len(geometry.nodes), -1, dtype=np.int64)
    names, tied, weights, origins = list(recipe.frames), [], [], []
    for k, (name, frame) in enumerate(recipe.frames.items()):
        where = f"{path} [frames.{name}.on]"
        nodes = ties.selected_nodes(geometry, frame.on, where)
        x, weight = geometry.nodes[nodes], ties.areas(geometry, nodes)
        ties.check_rank(x, where)
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
        origins.append(ties.centre(x, weight) if frame.position is None else np.array(frame.position))
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
