r"""Cross sections of a rod for stress recovery: the mass beyond each section, and fibre stress per section force.

A rod is an open chain, so its internal forces under given loads follow from equilibrium alone: the static response that
the method of mode acceleration takes to interface and inertia loads needs no compliance here, and the two methods,
mode acceleration and force summation, coincide. The recovery needs the rod's mass as slices with their shapes, and
for each section the slices and frames on its far side.

Every cell has one section at either end, so that forces which act at a node show as a jump.
Axial stress is :math:`\sigma = N/A + M_y z/I_y - M_z y/I_z`. Shear stress of circles and tubes is the exact solution of
St. Venant (torsion and flexure); that of rectangles the exact one of torsion and the parabola of flexure, which leaves
out Poisson's part of the variation across the width.

Sources: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 11 (mode acceleration);
Love, *A Treatise on the Mathematical Theory of Elasticity*, ch. XV (flexure of a hollow circular cylinder);
Timoshenko & Goodier, *Theory of Elasticity*, sec. 109 (torsion of a rectangle).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flexclear.structure.fe import beam as beams
from flexclear.structure.fe import section as sections
from flexclear.structure.fe.beam import N_DOFS, Beam
from flexclear.structure.fe.section import POINTS, Section, Value
from flexclear.structure.fe.slices import slices
from flexclear.system.errors import InputError

CONSTANTS = ("area", "second_moment")
#: fibres around a round section, in steps of 5 deg; one of them lies in the plane of bending (`Outline.round`)
AROUND = 72
#: fibres along each side of a rectangle, corners included
ALONG = 9
#: odd terms of the series of a rectangle's torsion; they fall as 1/n^2 at the middle of a side
TERMS = np.arange(1, 400, 2)


@dataclass(frozen=True)
class Outline:
    """Stress maps of one section.

    stress: axial stress and shear stress along y and z [Pa] per N, Qy, Qz, T, My, Mz, shape (fibres, 3, 6).
    round: True when equal about every axis, so that y may be turned into the plane of bending.
    """

    stress: np.ndarray
    round: bool


def recover(mesh: xr.Dataset, modes: xr.Dataset, gauges: Mapping[str, Any]) -> dict[str, Any]:
    """Return the variables STRESS of a bundle; without `fibre_stress` where a section has no known outline.

    Raises InputError for gauges, which exist on solids only.
    """
    for name in gauges:
        problem = f"'{gauges[name]['body']}' is a rod, which has sections instead of a surface of nodes"
        raise InputError(f"[output.gauges.{name}]", problem, "remove the gauge; each end of a cell is recorded")
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
    first = np.arange(2 * cells) // 2 + ending  # the cell that begins at the section, or the one after the section
    inside = np.repeat(np.arange(cells), len(POINTS))[None, :] >= first[:, None]
    return {
        "slice_mass": (("slice",), body.mass),
        "slice_position": (("slice", "axis"), body.position),
        "slice_spread": (("slice", "axis", "axis2"), body.spread),
        "slice_translation_shape": (shape, moved[:, :3]),
        "slice_rotation_shape": (shape, moved[:, 3:]),
        "slice_beyond": (
            ("section", "slice"),
            np.hstack([inside, _lies_beyond(lumps, positions, ending)]).astype(np.int8),
        ),
        "frame_beyond": (
            ("section", "frame"),
            _lies_beyond(x[mesh["frame_node"].values], positions, ending).astype(np.int8),
        ),
    }


def _lies_beyond(points: np.ndarray, positions: np.ndarray, ending: np.ndarray) -> np.ndarray:
    """Return True where nodes at `points` lie beyond each section; a cell's end node lies beyond its end section."""
    ahead = points[None, :] - positions[:, None]
    return (ahead > 0.0) | (ending[:, None] & (ahead == 0.0))


def _fibres(mesh: xr.Dataset) -> dict[str, Any]:
    outlines: list[Outline] = []
    types = tuple(mesh.attrs["section"].split())
    poisson = 0.5 * mesh["youngs_modulus"].values / mesh["shear_modulus"].values - 1.0
    area, second = (_constants_at_ends(mesh, name) for name in CONSTANTS)
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
    # sections of other types may have fewer fibres; their last fibre is repeated
    filled = [np.pad(m.stress, ((0, most - len(m.stress)), (0, 0), (0, 0)), mode="edge") for m in outlines]
    return {
        "fibre_stress": (("section", "fibre", "stress", "section_load"), np.stack(filled)),
        "section_round": (("section",), np.array([maps.round for maps in outlines], dtype=np.int8)),
    }


def _constants_at_ends(mesh: xr.Dataset, name: str) -> np.ndarray:
    """Return a section constant at both ends of each cell, shape (cells, 2) or (cells, 2, 3)."""
    values = beams.at_points(mesh, name)
    if f"{name}_profile" not in mesh:
        return values[:, :2]
    # areas and second moments of linear tapers are polynomials of degree four at most, which five points determine
    powers = np.vander(POINTS, increasing=True)
    ends = np.vander([0.0, 1.0], len(POINTS), increasing=True) @ np.linalg.inv(powers)
    return np.einsum("ep,cp...->ce...", ends, values)


def outline(types: tuple[str, ...], given: Section, poisson: float) -> Outline | None:
    """Return the stress maps of a section with these constants of one of `types`; None without a known outline."""
    name, lengths = sections.shape(types, given)
    if name not in OUTLINES:
        return None
    return OUTLINES[name](sections.SHAPES[name].constants(*lengths), poisson, *lengths)


def _round_outline(section: Section, poisson: float, radius: float, inner: float = 0.0) -> Outline:
    angle = 2.0 * math.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(angle), np.sin(angle)])
    y, z = np.concatenate([radius * ring, inner * ring if inner else np.zeros((2, 1))], axis=1)
    stress = _axial(section, y, z)
    stress[:, 1, 3], stress[:, 2, 3] = -z / section.torsion, y / section.torsion
    stress[:, 1, 1], stress[:, 2, 1] = _flexure(y, z, radius, inner, poisson, section.second_z)
    # a force along z equals one along y in axes turned by a quarter
    stress[:, 2, 2], stress[:, 1, 2] = _flexure(z, y, radius, inner, poisson, section.second_y)
    return Outline(stress, True)


def _axial(section: Section, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    stress = np.zeros((len(y), 3, 6))
    stress[:, 0, 0] = 1.0 / section.area
    stress[:, 0, 4], stress[:, 0, 5] = z / section.second_y, -y / section.second_z
    return stress


def _flexure(
    y: np.ndarray, z: np.ndarray, radius: float, inner: float, poisson: float, second: Value
) -> tuple[np.ndarray, np.ndarray]:
    """Return the shear stress along y and z per unit force along y."""
    square, k = np.maximum(y**2 + z**2, 1e-12 * radius**2), 0.75 + 0.5 * poisson
    hole = (radius * inner) ** 2
    along = -k * (radius**2 + inner**2) - k * hole * (z**2 - y**2) / square**2 + 0.75 * (y**2 - z**2)
    across = 2.0 * k * hole * y * z / square**2 - 1.5 * y * z
    scale = -1.0 / (2.0 * (1.0 + poisson) * second)
    along = along + 0.5 * poisson * y**2 + (1.0 - 0.5 * poisson) * z**2
    return scale * along, scale * (across + (2.0 + poisson) * y * z)


def _rectangle_outline(section: Section, poisson: float, width: float, height: float) -> Outline:
    """Return the stress maps of a rectangle; its flexure neglects the effect of Poisson's ratio."""
    s = np.linspace(-0.5, 0.5, ALONG)
    half = np.full(ALONG, 0.5)
    y = width * np.concatenate([s, s, half, -half, [0.0]])
    z = height * np.concatenate([half, -half, s, s, [0.0]])
    stress = _axial(section, y, z)
    stress[:, 1, 3], stress[:, 2, 3] = _torsion(y, z, width, height, section.torsion)
    stress[:, 1, 1] = 1.5 / section.area * (1.0 - (2.0 * y / width) ** 2)
    stress[:, 2, 2] = 1.5 / section.area * (1.0 - (2.0 * z / height) ** 2)
    return Outline(stress, False)


#: stress maps by type of section; other types have no known outline
OUTLINES: dict[str, Callable[..., Outline]] = {
    "circle": _round_outline,
    "tube": _round_outline,
    "rectangle": _rectangle_outline,
}


def _torsion(y: np.ndarray, z: np.ndarray, width: float, height: float, J: Value) -> tuple[np.ndarray, np.ndarray]:
    """Return the shear stress along y and z of a rectangle per unit torque."""
    a, b, n = 0.5 * width, 0.5 * height, TERMS
    sign = np.where(n % 4 == 1, 1.0, -1.0) / n**2
    wave = np.outer(y, n) * math.pi / (2.0 * a)
    # cosh(k z) / cosh(k b) and sinh(k z) / cosh(k b) without their large exponents
    k, far = n * math.pi / (2.0 * a), np.abs(z)[:, None]
    rise, fall = np.exp(-k * (b - far)), np.exp(-k * (b + far))
    base = 1.0 + np.exp(-2.0 * k * b)
    cosh, sinh = (rise + fall) / base, np.sign(z)[:, None] * (rise - fall) / base
    series = 16.0 * a / math.pi**2
    along_y = -series * np.sum(sign * sinh * np.cos(wave), axis=1)
    along_z = 2.0 * y - series * np.sum(sign * cosh * np.sin(wave), axis=1)
    return along_y / J, along_z / J
