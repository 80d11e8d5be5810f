"""Stage 1: nodes, two-node beam cells, sections and named frames from a recipe."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import MESH, conform
from pipeline.core.errors import InputError
from pipeline.structure.fe import section as sections
from pipeline.structure.fe.recipe import CircleSection, EqualAreaSquare, Recipe, parse, read_recipe, sources

__all__ = ["build", "read_recipe", "write_vtu"]

#: columns: x, y, z of a named frame in mesh axes; z runs along the beam
FRAME_ROTATION = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def build(recipe: Mapping[str, Any], *, place: str = "mesh recipe") -> xr.Dataset:
    """The mesh dataset (schema MESH) of a recipe as `read_recipe` returns it.

    place: how messages call the recipe.  Raises InputError for a wrong recipe, and for a frame that
    lies on no node (with the nearest nodes).
    """
    checked = parse(recipe, place)
    n = checked.elements
    x = np.linspace(0.0, checked.shape.length, n + 1)
    stiffness, inertia = _stiffness_section(checked.section), _inertia_section(checked)
    names = list(checked.frames)
    nodes = np.array([_node_at(x, checked.frames[name].x, f"{place} [frames.{name}.x]") for name in names])
    positions = np.stack([x, np.zeros(n + 1), np.zeros(n + 1)], axis=1)
    per_cell = {
        "area": stiffness.area,
        "youngs_modulus": checked.material.youngs_modulus,
        "shear_modulus": checked.material.shear_modulus,
        "density": checked.material.density,
    }
    data: dict[str, Any] = {
        "node_position": (("node", "axis"), positions),
        "cell": (("cell", "corner"), np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)),
        "second_moment": (("cell", "axis"), np.tile(_moments(stiffness, stiffness.torsion), (n, 1))),
        "inertia_moment": (("cell", "axis"), np.tile(_moments(inertia, inertia.polar), (n, 1))),
        "frame_node": (("frame",), nodes),
        "frame_position": (("frame", "axis"), positions[nodes]),
        "frame_rotation": (("frame", "axis", "axis2"), np.tile(FRAME_ROTATION, (len(names), 1, 1))),
    } | {name: (("cell",), np.full(n, value)) for name, value in per_cell.items()}
    return conform(xr.Dataset(data, coords={"frame": names}), MESH, **_attributes(checked))


def _attributes(recipe: Recipe) -> dict[str, str | float]:
    inertia = recipe.inertia_section or recipe.section
    return {
        "title": recipe.title,
        "section": recipe.section.type,
        "inertia_section": inertia.type,
        "interfaces": " ".join(recipe.interfaces),
        "shear_coefficient": sections.circle_shear_coefficient(recipe.material.poisson),
        "source": sources(recipe),
    }


def _stiffness_section(given: CircleSection) -> sections.Section:
    return sections.circle(given.radius)


def _inertia_section(recipe: Recipe) -> sections.Section:
    given = recipe.inertia_section or recipe.section
    if isinstance(given, EqualAreaSquare):
        return sections.square(_stiffness_section(recipe.section).area ** 0.5)
    return sections.circle(given.radius)


def _moments(section: sections.Section, about_x: float) -> np.ndarray:
    return np.array([about_x, section.second_y, section.second_z])


def _node_at(x: np.ndarray, place: float, where: str) -> int:
    """Index of the node at `place` [m]; a frame between nodes would need interpolated constraints."""
    nearest = int(np.argmin(np.abs(x - place)))
    # positions come from decimal text; a nanometre per metre is far above their rounding
    if abs(x[nearest] - place) <= 1e-9 * x[-1]:
        return nearest
    near = sorted(np.argsort(np.abs(x - place))[:2])
    shown = " and ".join(f"{x[k] * 1e3:.6g} mm" for k in near)
    raise InputError(
        where,
        f"{place * 1e3:.6g} mm lies on no node; {len(x) - 1} elements over {x[-1] * 1e3:.6g} mm have nodes at {shown}",
        "move the frame to a node or choose another number of elements",
    )


def write_vtu(mesh: xr.Dataset, path: str | Path) -> None:
    """Write the mesh as a VTU file (lines with section data per cell) that ParaView and meshio open."""
    import meshio  # slow to import and needed by this function alone

    names = ("area", "youngs_modulus", "shear_modulus", "density", "second_moment", "inertia_moment")
    cell_data = {name: [mesh[name].values] for name in names}
    meshio.Mesh(mesh["node_position"].values, [("line", mesh["cell"].values)], cell_data=cell_data).write(
        path, file_format="vtu"
    )
