"""Stage 1 of a body given by matrices: checked, in SI units, with its frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import MATRICES, conform
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.exchange import files
from flexclear.pipeline.structure.fe.exchange.files import COMPONENTS, Contents, Table
from flexclear.pipeline.structure.fe.model import grouped, symmetric
from flexclear.pipeline.structure.fe.recipe import Matrices, MatricesRecipe
from flexclear.pipeline.structure.fe.vtu import vtu

#: length [m], mass [kg] and time [s] of each consistent system
SYSTEMS = {"m-kg-s": (1.0, 1.0, 1.0), "mm-t-s": (1e-3, 1e3, 1.0), "mm-kg-ms": (1e-3, 1.0, 1e-3)}
#: asymmetry of a matrix, relative to its largest entry, that is taken for rounding of the file
SYMMETRIC = 1e-9


def build(recipe: MatricesRecipe, folder: Path, path: str) -> xr.Dataset:
    """The dataset (schema MATRICES); InputError for files that do not fit together."""
    where = f"{path} [shape]"
    contents = _read(recipe.shape, folder, where)
    stiffness, mass, position = _in_si(contents, recipe.shape.units, where)
    data: dict[str, Any] = {
        "unknown_node": (("unknown",), contents.table.node),
        "unknown_component": (("unknown",), np.array(COMPONENTS)[contents.table.component]),
        "unknown_position": (("unknown", "axis"), position),
    }
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        entries = sp.coo_array(_symmetric(matrix, name, where))
        for part, values in (("row", entries.row), ("column", entries.col), ("value", entries.data)):
            data[f"{name}_{part}"] = ((f"{name}_entry",), values)
    data |= {name: (MATRICES[name].dims, values) for name, values in contents.moments.items() if name in MATRICES}
    data |= _frames(recipe, contents.table, position, path)
    try:
        made = xr.Dataset(data)
    except ValueError as error:  # integrals in a file are of other sizes than its unknowns
        raise InputError(where, f"what the file holds does not fit together: {error}") from None
    return conform(
        made,
        MATRICES,
        title=recipe.title,
        body_kind="matrices",
        section="matrices",
        inertia_section="matrices",
        interfaces=" ".join(recipe.interfaces),
    )


def _read(shape: Matrices, folder: Path, where: str) -> Contents:
    if shape.file is not None:
        return files.read_npz(folder / shape.file, where)
    stiffness, mass, unknowns = (folder / str(name) for name in (shape.stiffness, shape.mass, shape.unknowns))
    return files.read_matrix_market(stiffness, mass, unknowns, where)


def _in_si(contents: Contents, system: str, where: str) -> tuple[sp.csr_array, sp.csr_array, np.ndarray]:
    length, mass, time = SYSTEMS[system]
    if system != "m-kg-s" and (contents.moments or np.any(contents.table.component == COMPONENTS.index("internal"))):
        raise InputError(where, "internal unknowns and integrals have no units of their own", 'units = "m-kg-s"')
    energy = mass * length**2 / time**2
    # u = S u' makes K = e S^-1 K' S^-1, and M the same times the square of the unit of time
    per_unit = sp.diags_array(np.where(contents.table.component < 3, 1.0 / length, 1.0))
    K, M = (sp.csr_array(per_unit @ matrix @ per_unit) for matrix in (contents.stiffness, contents.mass))
    return sp.csr_array(energy * K), sp.csr_array(energy * time**2 * M), length * contents.table.position


def _symmetric(matrix: sp.csr_array, name: str, where: str) -> sp.csr_array:
    if matrix.nnz == 0 or not np.isfinite(matrix.data).all():
        raise InputError(where, f"the {name} matrix is empty or has entries that are not finite")
    away = abs(matrix - matrix.T).max() / abs(matrix).max()
    if away > SYMMETRIC:
        raise InputError(where, f"the {name} matrix is not symmetric: entries differ by {away:.2g} of the largest")
    return symmetric(matrix)


def _frames(recipe: MatricesRecipe, table: Table, position: np.ndarray, path: str) -> dict[str, Any]:
    tied, origins = [], []
    for name, frame in recipe.frames.items():
        chosen, where = frame.nodes or (frame.node,), f"{path} [frames.{name}]"
        needed, remedy = (6, "tie the frame to the mean of `nodes`") if frame.node is not None else (3, "name others")
        for node in chosen:
            own = np.bincount(table.component[table.node == node], minlength=6)
            if not own.any():
                raise InputError(where, f"there is no node {node}", "use numbers from the table of unknowns")
            if not own[:needed].all():
                lacks = ", ".join(COMPONENTS[c] for c in np.flatnonzero(own[:needed] == 0))
                raise InputError(where, f"node {node} has no {lacks}", remedy)
            if own[:needed].max() > 1:
                twice = COMPONENTS[int(np.argmax(own[:needed]))]
                raise InputError(where, f"node {node} has {own[:needed].max()} unknowns {twice}", "write each unknown once")
        if needed == 3 and len(chosen) < 3:
            raise InputError(where, f"{len(chosen)} nodes cannot carry a frame's rotation", "name at least three")
        tied.append(np.array(chosen))
        origins.append(np.mean([position[table.node == node][0] for node in chosen], axis=0))
    nodes, frames = grouped(tied)
    return {
        "frame": (("frame",), list(recipe.frames)),
        "frame_position": (("frame", "axis"), np.array(origins)),
        "frame_rotation": (("frame", "axis", "axis2"), np.array([f.orientation() for f in recipe.frames.values()])),
        "tie_node": (("tie",), nodes),
        "tie_frame": (("tie",), frames),
    }


def as_vtu(mesh: xr.Dataset) -> bytes:
    """The nodes as points, for ParaView."""
    node, first = np.unique(mesh["unknown_node"].values, return_index=True)
    points = mesh["unknown_position"].values[first]
    return vtu(points, "vertex", np.arange(len(points))[:, None], of_points={"node": node})
