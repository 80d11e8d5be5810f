"""Meshes of beam recipes: nodes, two-node cells, section constants, lumped masses and named frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import MESH, conform
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.segments import SAME_PLACE, cut_names, nodes_of_cuts
from flexclear.structure.fe import section
from flexclear.structure.fe.beam_recipe import FRAME_ROTATION, BeamRecipe, Segment, segments
from flexclear.structure.fe.section import POINTS
from flexclear.structure.fe.vtu import vtu
from flexclear.system.errors import InputError

#: section constants that a taper changes, each with a profile along the cell
TAPERED = ("area", "second_moment", "inertia_moment", "shear_coefficient")


def build(recipe: BeamRecipe, folder: Path, where: str) -> xr.Dataset:
    """Build the mesh dataset (schema MESH); raise InputError for frames or masses that lie on no node."""
    parts = segments(recipe)
    x = _nodes(parts)
    R_MR = quaternion_to_matrix(recipe.pose.as_quaternion())
    position = np.array(recipe.pose.position) + np.outer(x, R_MR[:, 0])
    cells = np.arange(len(x) - 1)
    names = list(recipe.frames)
    nodes = np.array([_node_at(x, recipe.frames[name].x, f"{where} [frames.{name}.x]") for name in names])
    turned = [frame.orientation() for frame in recipe.frames.values()]
    data: dict[str, Any] = {
        "node_position": (("node", "axis"), position),
        "abscissa": (("node",), x),
        "rod_rotation": (("axis", "axis2"), R_MR),
        "cell_node": (("cell", "corner"), np.stack([cells, cells + 1], axis=1)),
        "frame_node": (("frame",), nodes),
        "frame_position": (("frame", "axis"), position[nodes]),
        "frame_rotation": (("frame", "axis", "axis2"), R_MR @ np.array(turned)),
    }
    data |= _constants(recipe, parts) | _lumps(recipe, x, R_MR, where)
    return conform(xr.Dataset(data, coords={"frame": names}), MESH, **_attributes(recipe, parts))


def cut_segment(mesh: xr.Dataset, segment: Sequence[int]) -> xr.Dataset:
    """Return one segment of a rod's mesh, ``(k, n)`` being the k-th of n, with frames at its cut ends.

    A mass at a cut belongs to the segment that ends there. Interfaces of the whole rod at a cut are left out, since the
    cut end is one.
    """
    k, count = segment
    first, last = nodes_of_cuts(mesh["abscissa"].values.tolist(), count)[k - 1 : k + 1]
    ends = {name: {f"cut_{k - 1}": first, f"cut_{k}": last}[name] for name in cut_names(segment)}
    nodes = dict(zip(mesh["frame"].values.tolist(), mesh["frame_node"].values.tolist(), strict=True))
    inside = [name for name in mesh.attrs["interfaces"].split() if first <= nodes[name] <= last]
    near, far = ([name for name, node in ends.items() if node == end] for end in (first, last))
    interfaces = " ".join([*near, *(name for name in inside if nodes[name] not in ends.values()), *far])
    part = mesh.isel(node=slice(first, last + 1), cell=slice(first, last))
    part = part.isel(frame=_entries_between(mesh["frame_node"].values, first, last))
    if "lump_node" in mesh:
        carried = _entries_between(mesh["lump_node"].values, first if k == 1 else first + 1, last)
        part = part.isel(lump=carried) if carried.size else part.drop_dims("lump")
    part = xr.concat([part, _cut_ends(mesh, ends)], "frame", data_vars="minimal", coords="minimal")
    part = part.assign({name: part[name] - first for name in ("cell_node", "frame_node", "lump_node") if name in part})
    return conform(part, MESH, **{**mesh.attrs, "interfaces": interfaces})


def _entries_between(nodes: np.ndarray, first: int, last: int) -> np.ndarray:
    """Return the indices of the entries whose nodes lie from `first` to `last`."""
    return np.flatnonzero((nodes >= first) & (nodes <= last))


def _cut_ends(mesh: xr.Dataset, ends: Mapping[str, int]) -> xr.Dataset:
    """Return frames at nodes of a rod, their z along it."""
    nodes, axes = np.array(list(ends.values()), dtype=np.int64), mesh["rod_rotation"].values @ FRAME_ROTATION
    data: dict[str, Any] = {
        "frame_node": (("frame",), nodes),
        "frame_position": (("frame", "axis"), mesh["node_position"].values[nodes]),
        "frame_rotation": (("frame", "axis", "axis2"), np.array([axes] * len(ends))),
    }
    return xr.Dataset(data, {"frame": list(ends)})


def _nodes(parts: tuple[Segment, ...]) -> np.ndarray:
    """Return the positions of the nodes along the rod [m]."""
    pieces = [np.linspace(s.start, s.end, s.elements + 1) for s in parts]
    return np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])


def _constants(recipe: BeamRecipe, parts: tuple[Segment, ...]) -> dict[str, Any]:
    """Return material and section constants of the cells; those of tapered cells at mid-cell, with profiles."""
    tapers = any(part.end_section is not None for part in parts)
    pieces = [_segment_constants(recipe, part, tapers) for part in parts]
    joined = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    for name in ("product_moment", "inertia_product"):
        if not joined[name].any():
            del joined[name]
    if np.isnan(joined["shear_coefficient"]).any():
        for name in ("shear_coefficient", "shear_coefficient_profile"):
            joined.pop(name, None)
    dims = {name: ("cell", "axis") if values.ndim == 2 else ("cell",) for name, values in joined.items()}
    dims |= {f"{name}_profile": ("cell", "point", *dims[name][1:]) for name in TAPERED if name in joined}
    return {name: (dims[name], values) for name, values in joined.items()}


def _segment_constants(recipe: BeamRecipe, part: Segment, tapers: bool) -> dict[str, np.ndarray]:
    n, material = part.elements, part.material or recipe.material
    middle = _section(recipe, part, (np.arange(n) + 0.5) / n)
    values = middle | {
        name: np.full(n, getattr(material, name)) for name in ("youngs_modulus", "shear_modulus", "density")
    }
    if tapers:
        points = _section(recipe, part, ((np.arange(n)[:, None] + POINTS) / n).ravel())
        for name in TAPERED:
            at_points = points[name].reshape(n, len(POINTS), *points[name].shape[1:])
            at_middle = middle[name][:, None]
            # without rotary inertia the value at mid-cell is zero, and so is the value at every Gauss point
            values[f"{name}_profile"] = np.divide(
                at_points, at_middle, out=np.ones_like(at_points), where=at_middle != 0.0
            )
    return values


def _section(recipe: BeamRecipe, part: Segment, s: np.ndarray) -> dict[str, np.ndarray]:
    """Return the section constants at the fractions s of a segment, each of shape (s,) or (s, 3)."""
    stiffness = section.constants(part.section, part.end_section, s)
    polar, about_y, about_z, product = section.inertia(part.section, part.end_section, part.inertia_section, s)
    if recipe.theory == "euler-bernoulli":
        about_y = about_z = product = 0.0
    poisson = (part.material or recipe.material).poisson
    kappa = section.shear_coefficient(part.section, part.end_section, s, poisson) or (np.nan, np.nan)
    return {
        "area": _columns_at_points(s, stiffness.area),
        "second_moment": _columns_at_points(s, stiffness.torsion, stiffness.second_y, stiffness.second_z),
        "product_moment": _columns_at_points(s, stiffness.product),
        "inertia_moment": _columns_at_points(s, polar, about_y, about_z),
        "inertia_product": _columns_at_points(s, product),
        "shear_coefficient": _columns_at_points(s, 1.0, *kappa),
    }


def _columns_at_points(s: np.ndarray, *values: Any) -> np.ndarray:
    columns = np.stack([np.broadcast_to(np.asarray(value, dtype=float), s.shape) for value in values], axis=-1)
    return columns if len(values) > 1 else columns[:, 0]


def _lumps(recipe: BeamRecipe, x: np.ndarray, R_MR: np.ndarray, where: str) -> dict[str, Any]:
    if not recipe.masses:
        return {}
    masses = recipe.masses
    inertia = np.array([mass.inertia for mass in masses.values()])
    nodes = [_node_at(x, mass.x, f"{where} [masses.{name}.x]") for name, mass in masses.items()]
    return {
        "lump_node": (("lump",), np.array(nodes)),
        "lump_mass": (("lump",), np.array([mass.mass for mass in masses.values()])),
        "lump_offset": (("lump", "axis"), np.array([mass.com for mass in masses.values()]) @ R_MR.T),
        "lump_inertia": (("lump", "axis", "axis2"), R_MR @ inertia @ R_MR.T),
    }


def _attributes(recipe: BeamRecipe, parts: tuple[Segment, ...]) -> dict[str, str]:
    return {
        "title": recipe.title,
        "section": _types(part.section for part in parts),
        "inertia_section": _types(part.inertia_section or part.section for part in parts),
        "interfaces": " ".join(recipe.interfaces),
        "theory": recipe.theory,
        "torsion": recipe.torsion,
        "extension": recipe.extension,
    }


def _types(types: Any) -> str:
    return " ".join(dict.fromkeys(section.type for section in types))


def _node_at(x: np.ndarray, position: float, where: str) -> int:
    """Return the index of the node at `position` [m]; raise InputError for a position between nodes."""
    nearest = int(np.argmin(np.abs(x - position)))
    if abs(x[nearest] - position) <= SAME_PLACE * x[-1]:
        return nearest
    neighbours = sorted(np.argsort(np.abs(x - position))[:2])
    shown = " and ".join(f"{x[k] * 1e3:.6g} mm" for k in neighbours)
    neighbourhood = f"{len(x) - 1} elements over {x[-1] * 1e3:.6g} mm have nodes at {shown}"
    moved = "mass" if "[masses." in where else "frame"
    remedy = f"move the {moved} to a node, or choose another number of elements"
    raise InputError(where, f"{position * 1e3:.6g} mm lies on no node; {neighbourhood}", remedy)


def as_vtu(mesh: xr.Dataset) -> bytes:
    """Return the beam's lines with section data in the cells as a VTU file, for ParaView."""
    names = ("area", "youngs_modulus", "shear_modulus", "density", "second_moment", "inertia_moment")
    data = {name: mesh[name].values for name in names}
    return vtu(mesh["node_position"].values, "line", mesh["cell_node"].values, of_cells=data)
