"""Rods as finite elements, taken apart into planes: recipes, and frequencies with the ends held."""

from typing import Any

import numpy as np
import scipy.linalg
import xarray as xr

from flexclear.structure.fe import beam
from flexclear.structure.kinds import kind
from tests.analytic.beam_solutions import PAPER_ROD

RECIPE = {
    "elements": 12,
    "shape": {"type": "straight-beam", "length": PAPER_ROD.length},
    "material": {
        "density": PAPER_ROD.density,
        "youngs_modulus": PAPER_ROD.youngs_modulus,
        "poisson": PAPER_ROD.poisson,
    },
    "section": {"type": "circle", "radius": PAPER_ROD.radius},
    "frames": {"bottom": {"x": 0.0}, "top": {"x": PAPER_ROD.length}},
    "interfaces": ["bottom", "top"],
}
#: a section by its constants
GENERAL = {"type": "general", "area": 3e-4, "torsion": 1e-8, "second_y": 8e-9, "second_z": 5e-9}
#: what a recipe of segments takes over
WITHOUT_SHAPE = {name: RECIPE[name] for name in ("material", "frames", "interfaces")}
#: motions of the section, as indices of ux uy uz rx ry rz in rod axes
BENDING, BENDING_Z, TORSION, EXTENSION = (1, 5), (2, 4), (3,), (0,)
#: what a letter holds: index into the motions above (deflection, slope); torsion and extension have the first only
HELD = {"F": (), "P": (0,), "G": (1,), "C": (0, 1)}
WORDS = {"F": "free", "P": "pinned", "G": "guided", "C": "fixed"}
#: rigid motions that the ends leave to a plane of bending
RIGID = {"FF": 2, "PF": 1, "FP": 1, "GG": 1, "GF": 1, "FG": 1}


def build(**changes: Any) -> xr.Dataset:
    """The paper's rod with other entries in its recipe."""
    return kind.build(RECIPE | changes)


def held_rows(system: beam.Beam, motions: tuple[int, ...], ends: str) -> np.ndarray:
    """Which unknowns of some motions of the section remain, ends held as the two letters say; shape (size,), bool."""
    remain = np.isin(system.component, motions)
    for start, letter in zip((0, system.nodal_size - 6), ends, strict=True):
        for k in HELD[letter]:
            if k < len(motions):
                remain[start + motions[k]] = False
    return remain


def held_system(rod: xr.Dataset, motions: tuple[int, ...], ends: str) -> tuple[np.ndarray, np.ndarray]:
    """Dense stiffness and mass of some motions of the section, ends held as the two letters say."""
    system = beam.assemble(rod)
    rows = held_rows(system, motions, ends)
    K, M = (beam.in_rod_axes(system, matrix.toarray()) for matrix in (system.stiffness, system.mass))
    K, M = (beam.in_rod_axes(system, matrix.T).T for matrix in (K, M))
    return K[np.ix_(rows, rows)], M[np.ix_(rows, rows)]


def frequencies(rod: xr.Dataset, motions: tuple[int, ...], ends: str, count: int) -> np.ndarray:
    """The lowest elastic frequencies [Hz], shape (count,)."""
    rigid = RIGID.get(ends, 0) if len(motions) == 2 else int(ends == "FF")
    values = scipy.linalg.eigvalsh(*held_system(rod, motions, ends))
    return np.sqrt(values[rigid : rigid + count]) / (2.0 * np.pi)


def lowest(rod: xr.Dataset, start: str, end: str, count: int | None) -> np.ndarray:
    """The lowest elastic frequencies [Hz] of all motions together, dofs at both ends held by their digits (of
    ux uy uz rx ry rz); all frequencies without a count."""
    system = beam.assemble(rod)
    held = [int(d) for d in start] + [system.nodal_size - 6 + int(d) for d in end]
    free = np.setdiff1d(np.arange(system.size), held)
    K, M = (matrix.toarray()[np.ix_(free, free)] for matrix in (system.stiffness, system.mass))
    rigid = 0 if held else 6
    return np.sqrt(scipy.linalg.eigvalsh(K, M)[rigid:][:count]) / (2.0 * np.pi)


def order(elements: list[int], errors: np.ndarray) -> np.ndarray:
    """Observed order of convergence, errors of shape (len(elements), ...)."""
    flat = np.log(np.abs(errors)).reshape(len(elements), -1)
    return -np.polyfit(np.log(elements), flat, 1)[0].reshape(np.shape(errors)[1:])
