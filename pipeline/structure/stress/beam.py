r"""A rod's cross sections for stress recovery: what lies beyond each, and what its forces do to its fibres.

A rod is an open chain, so its internal forces under given loads follow from equilibrium alone: the static response that
the method of mode acceleration takes to interface and inertia loads needs no compliance here, and the two methods,
mode acceleration and force summation, are one. What is needed of the rod is its mass as slices with their shapes, and
for each section which slices and frames lie on its far side.

There is one section at either end of every cell, so that forces which act at a node show as a jump.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 11 (mode acceleration).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe import beam as beams
from flexclear.pipeline.structure.fe.beam import N_DOFS, Beam
from flexclear.pipeline.structure.fe.section import POINTS, Section
from flexclear.pipeline.structure.fe.slices import slices
from flexclear.pipeline.structure.stress.outline import Outline, outline

CONSTANTS = ("area", "second_moment")


def recover(mesh: xr.Dataset, modes: xr.Dataset, gauges: Mapping[str, Any]) -> dict[str, Any]:
    """Variables STRESS of a bundle; without `fibre_stress` where some section has no known outline.

    InputError for gauges, which are on solids.
    """
    for name in gauges:
        problem = f"'{gauges[name]['body']}' is a rod, which has sections and no surface of nodes"
        raise InputError(f"[output.gauges.{name}]", problem, "take the gauge out; each end of a cell is recorded")
    beam, vectors = beams.assemble(mesh), modes["vector"].values
    nodes = mesh["cell_node"].values.ravel()
    return _sections(mesh, beam, vectors, nodes) | _slices(mesh, beam, vectors, nodes) | _fibres(mesh)


def _sections(mesh: xr.Dataset, beam: Beam, vectors: np.ndarray, nodes: np.ndarray) -> dict[str, Any]:
    moved = vectors[: beam.nodal_size].reshape(-1, N_DOFS, vectors.shape[1])[nodes]
    shape = ("section", "axis", "mode")
    return {
        "section_place": (("section",), mesh["abscissa"].values[nodes]),
        "section_position": (("section", "axis"), beam.node_position[nodes]),
        "section_rotation": (("section", "axis", "axis2"), np.tile(beam.axes, (len(nodes), 1, 1))),
        "section_translation_shape": (shape, moved[:, :3]),
        "section_rotation_shape": (shape, moved[:, 3:]),
    }


def _slices(mesh: xr.Dataset, beam: Beam, vectors: np.ndarray, nodes: np.ndarray) -> dict[str, Any]:
    body = slices(mesh, beam)
    shape = ("slice", "axis", "mode")
    moved = (body.motion @ vectors).reshape(-1, 6, vectors.shape[1])
    x, cells = mesh["abscissa"].values, mesh.sizes["cell"]
    positions, ending = x[nodes], np.tile([False, True], cells)
    lumps = x[mesh["lump_node"].values] if "lump_node" in mesh else np.empty(0)
    first = np.arange(2 * cells) // 2 + ending  # the cell that begins at the section, or after it
    inside = np.repeat(np.arange(cells), len(POINTS))[None, :] >= first[:, None]
    return {
        "slice_mass": (("slice",), body.mass),
        "slice_position": (("slice", "axis"), body.position),
        "slice_spread": (("slice", "axis", "axis2"), body.spread),
        "slice_translation_shape": (shape, moved[:, :3]),
        "slice_rotation_shape": (shape, moved[:, 3:]),
        "slice_beyond": (("section", "slice"), np.hstack([inside, _beyond(lumps, positions, ending)]).astype(np.int8)),
        "frame_beyond": (
            ("section", "frame"),
            _beyond(x[mesh["frame_node"].values], positions, ending).astype(np.int8),
        ),
    }


def _beyond(points: np.ndarray, positions: np.ndarray, ending: np.ndarray) -> np.ndarray:
    """Whether what sits on nodes at `points` lies beyond each section; where a cell ends, its end node does."""
    ahead = points[None, :] - positions[:, None]
    return (ahead > 0.0) | (ending[:, None] & (ahead == 0.0))


def _fibres(mesh: xr.Dataset) -> dict[str, Any]:
    outlines: list[Outline] = []
    types = tuple(mesh.attrs["section"].split())
    poisson = 0.5 * mesh["youngs_modulus"].values / mesh["shear_modulus"].values - 1.0
    area, second = (_at_ends(mesh, name) for name in CONSTANTS)
    product = mesh["product_moment"].values if "product_moment" in mesh else np.zeros(mesh.sizes["cell"])
    for cell in range(mesh.sizes["cell"]):
        for end in (0, 1):
            torsion, about_y, about_z = second[cell, end].tolist()
            given = Section(float(area[cell, end]), torsion, about_y, about_z, float(product[cell]))
            maps = outline(types, given, float(poisson[cell]))
            if maps is None:
                return {}
            outlines.append(maps)
    most = max(len(maps.stress) for maps in outlines)
    # sections of other types may have fewer fibres: their last one again
    filled = [np.pad(m.stress, ((0, most - len(m.stress)), (0, 0), (0, 0)), mode="edge") for m in outlines]
    return {
        "fibre_stress": (("section", "fibre", "stress", "section_load"), np.stack(filled)),
        "section_round": (("section",), np.array([maps.round for maps in outlines], dtype=np.int8)),
    }


def _at_ends(mesh: xr.Dataset, name: str) -> np.ndarray:
    """A section constant at both ends of each cell, shape (cells, 2) or (cells, 2, 3)."""
    values = beams.at_points(mesh, name)
    if f"{name}_profile" not in mesh:
        return values[:, :2]
    # areas and second moments of linear tapers are polynomials of degree four at most, which five points know
    powers = np.vander(POINTS, increasing=True)
    ends = np.vander([0.0, 1.0], len(POINTS), increasing=True) @ np.linalg.inv(powers)
    return np.einsum("ep,cp...->ce...", ends, values)
