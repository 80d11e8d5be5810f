"""Bodies given by matrices: check them, convert them to SI units, and build a model from the dataset."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph
import xarray as xr

from flexclear.artifacts.schema import MATRICES, conform
from flexclear.numerics.rotations import skew
from flexclear.scene.registry import suggestion
from flexclear.structure.fe import model as models
from flexclear.structure.fe.exchange import files, programs
from flexclear.structure.fe.exchange.files import COMPONENTS, Contents, Table
from flexclear.structure.fe.model import Drawn, Integrals, Model
from flexclear.structure.fe.recipe import MatricesRecipe
from flexclear.structure.fe.slices import Slices, at_centres, integrate, second_moments
from flexclear.structure.fe.solid.mesh import mean_motion
from flexclear.structure.fe.solid.model import families, integrals
from flexclear.structure.fe.vtu import vtu
from flexclear.structure.sparse import cholesky
from flexclear.system.errors import InputError, SolverError

#: units of length [m], mass [kg] and time [s] of each consistent system
SYSTEMS = {
    "m-kg-s": (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "in-slinch-s": (0.0254, 4.4482216152605 / 0.0254, 1.0),
}
#: mass per volume of the box around a body [kg/m^3], and rough speed of sound [m/s], between which it is of a material
DENSITY = (1e-3, 1e6)
SPEED = (20.0, 3e5)
#: below this mass no body has this speed of sound: bodies in mm, t and s that are read in inches
LIGHT, FAST = 1.0, 3e4
#: asymmetry of a matrix, relative to its largest entry, that counts as rounding in the file
SYMMETRIC = 1e-9
WHERE = "mesh recipe [shape]"
#: entries of mass matrices are equal when they differ by less, relative to the largest or to the mass (times a length)
ALIKE = 1e-9
#: largest strain force of a rigid motion, relative to the largest term of the sum
UNSTRAINED = 1e-6


def build(recipe: MatricesRecipe, folder: Path, path: str) -> xr.Dataset:
    """Build the dataset (schema MATRICES); raise InputError for files that do not fit together."""
    where = f"{path} [shape]"
    contents = files.read(recipe.shape, folder, where)
    stiffness, mass, position = _in_si(contents, recipe.shape.units, where)
    _require_plausible(stiffness, mass, position, contents.table, recipe.shape.units, where)
    data: dict[str, Any] = {
        "unknown_node": (("unknown",), contents.table.node),
        "unknown_component": (("unknown",), np.array(COMPONENTS)[contents.table.component]),
        "unknown_position": (("unknown", "axis"), position),
    }
    asymmetry = 0.0
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        entries, away = _symmetric(matrix, name, where)
        asymmetry = max(asymmetry, away)
        for part, values in (("row", entries.row), ("column", entries.col), ("value", entries.data)):
            data[f"{name}_{part}"] = ((f"{name}_entry",), values)
    data |= {name: (MATRICES[name].dims, values) for name, values in contents.moments.items() if name in MATRICES}
    data |= _frames(recipe, contents, position, path)
    if contents.basis is not None:
        per_unit = np.where(contents.table.component < 3, SYSTEMS[recipe.shape.units][0], 1.0)
        data["given_shape"] = (("unknown", "shape"), per_unit[:, None] * contents.basis)
    if recipe.shape.listing is not None:
        _, unit, time = SYSTEMS[recipe.shape.units]
        frequency, total = programs.read_listing(folder / recipe.shape.listing, where)
        data["listed_frequency"] = (("listed",), frequency / time)
        data |= {} if total is None else {"listed_mass": ((), unit * total)}
    try:
        dataset = xr.Dataset(data)
    except ValueError as error:  # integrals in a file have other sizes than its unknowns
        raise InputError(where, f"the arrays do not fit together: {error}") from None
    kind = dict.fromkeys(("body_kind", "section", "inertia_section"), "matrices")
    return conform(
        dataset, MATRICES, title=recipe.title, asymmetry=asymmetry, interfaces=" ".join(recipe.interfaces), **kind
    )


def _in_si(contents: Contents, system: str, where: str) -> tuple[sp.csr_array, sp.csr_array, np.ndarray]:
    length, mass, time = SYSTEMS[system]
    if system != "m-kg-s" and (contents.moments or np.any(contents.table.component == COMPONENTS.index("internal"))):
        raise InputError(where, "internal unknowns and integrals have no units of their own", 'units = "m-kg-s"')
    energy = mass * length**2 / time**2
    # with u = S u' the matrices are K = e S^-1 K' S^-1 and M likewise, times the square of the unit of time
    per_unit = sp.diags_array(np.where(contents.table.component < 3, 1.0 / length, 1.0))
    K, M = (sp.csr_array(per_unit @ matrix @ per_unit) for matrix in (contents.stiffness, contents.mass))
    return sp.csr_array(energy * K), sp.csr_array(energy * time**2 * M), length * contents.table.position


def _require_plausible(
    K: sp.csr_array, M: sp.csr_array, position: np.ndarray, table: Table, units: str, where: str
) -> None:
    """Raise InputError where density and speed of sound are those of no material, but would be in other units."""
    moved = table.component < 3
    stiff, heavy = K.diagonal()[moved], M.diagonal()[moved]
    if not (stiff > 0.0).any() or not (heavy > 0.0).any():
        return
    X, total = position[moved], float(M[moved][:, moved].sum()) / 3.0
    sides = np.maximum(np.ptp(X, axis=0), 0.1 * np.ptp(X, axis=0).max())
    density = total / float(np.prod(sides)) if sides.all() else 0.0
    # the stiffness of a node against its neighbours is some E h, its mass some rho h^3
    spacing = (np.prod(sides) / len(np.unique(X, axis=0))) ** (1.0 / 3.0)
    sound = float(spacing * np.sqrt(np.median(stiff[stiff > 0.0]) / np.median(heavy[heavy > 0.0])))
    if _is_material(density, sound):
        return
    length, mass, time = SYSTEMS[units]
    for other, (l, m, t) in SYSTEMS.items():
        factors = (m / mass * (length / l) ** 3, l / length * time / t)
        if _is_material(density * factors[0], sound * factors[1]):
            problem = f"in {units} the body has some {density:.1g} kg/m3 and a speed of sound of {sound:.1g} m/s"
            raise InputError(where, problem, f'the files look as if units = "{other}"')


def _is_material(density: float, speed: float) -> bool:
    light_and_stiff = density < LIGHT and speed > FAST
    return DENSITY[0] < density < DENSITY[1] and SPEED[0] < speed < SPEED[1] and not light_and_stiff


def _symmetric(matrix: sp.csr_array, name: str, where: str) -> tuple[sp.coo_array, float]:
    """Return the symmetric part of a matrix, and how far entries differ, relative to the largest."""
    if matrix.nnz == 0 or not np.isfinite(matrix.data).all():
        raise InputError(where, f"the {name} matrix is empty or has entries that are not finite")
    away = float(abs(matrix - matrix.T).max() / abs(matrix).max())
    if away > SYMMETRIC:
        raise InputError(where, f"the {name} matrix is not symmetric: entries differ by {away:.2g} of the largest")
    return sp.coo_array(models.symmetric_part(matrix)), away


def _frames(recipe: MatricesRecipe, contents: Contents, position: np.ndarray, path: str) -> dict[str, Any]:
    tied, origins, table = [], [], contents.table
    for name, frame in recipe.frames.items():
        chosen, where = frame.nodes or (frame.node,), f"{path} [frames.{name}]"
        if frame.set is not None:
            chosen = _node_set(contents.sets, frame.set, where)
        single = frame.node is not None or (frame.set is not None and len(chosen) == 1)
        needed, remedy = (6, "tie the frame to the mean of `nodes`") if single else (3, "name others")
        for node in chosen:
            own = np.bincount(table.component[table.node == node], minlength=6)
            if not own.any():
                raise InputError(where, f"unknown node {node}", "use numbers from the table of unknowns")
            if not own[:needed].all():
                lacks = ", ".join(COMPONENTS[c] for c in np.flatnonzero(own[:needed] == 0))
                raise InputError(where, f"node {node} has no {lacks}", remedy)
            if own[:needed].max() > 1:
                twice = COMPONENTS[int(np.argmax(own[:needed]))]
                problem = f"node {node} has {own[:needed].max()} unknowns {twice}"
                raise InputError(where, problem, "write each unknown once")
        if needed == 3 and len(chosen) < 3:
            raise InputError(where, f"{len(chosen)} nodes cannot carry a frame's rotation", "name at least three")
        tied.append(np.array(chosen))
        origins.append(np.mean([position[table.node == node][0] for node in chosen], axis=0))
    nodes, frames = models.flatten_groups(tied)
    return {
        "frame": (("frame",), list(recipe.frames)),
        "frame_position": (("frame", "axis"), np.array(origins)),
        "frame_rotation": (("frame", "axis", "axis2"), np.array([f.orientation() for f in recipe.frames.values()])),
        "tie_node": (("tie",), nodes),
        "tie_frame": (("tie",), frames),
    }


def _node_set(sets: dict[str, np.ndarray], name: str, where: str) -> tuple[int, ...]:
    known = {other.upper(): other for other in sets}
    if name.upper() not in known:
        remedy = suggestion(name, sets) if sets else "give `nodes`, a deck with node sets"
        raise InputError(where, f"unknown set of nodes '{name}'", remedy)
    return tuple(sets[known[name.upper()]].tolist())


def as_vtu(mesh: xr.Dataset) -> bytes:
    """Return the nodes as points in a VTU file, for ParaView."""
    node, first = np.unique(mesh["unknown_node"].values, return_index=True)
    points = mesh["unknown_position"].values[first]
    return vtu(points, "vertex", np.arange(len(points))[:, None], of_points={"node": node})


def assemble(mesh: xr.Dataset) -> Model:
    """Build the model of a dataset (schema MATRICES); raise InputError unless the matrices are those of a free body."""
    component = np.array([COMPONENTS.index(name) for name in mesh["unknown_component"].values])
    positions, n = mesh["unknown_position"].values, mesh.sizes["unknown"]
    K, M = (_matrix(mesh, name, n) for name in ("stiffness", "mass"))
    rigid = models.rigid_motions(positions, component, positions.mean(axis=0))
    _check_matrices(K, M, rigid, positions)
    frames = models.interfaces(mesh, partial(frame_motion, mesh, component))
    names = mesh.attrs["interfaces"].split()
    return Model(
        stiffness=K,
        mass=M,
        rigid=rigid,
        position=positions,
        interfaces=frames,
        ends=tuple(frame for name in names[:2] for frame in frames if frame.name == name),
        integrate=_integrator(mesh, M, component),
        families=families(positions, component),
        drawn=_points_to_draw(mesh, component),
        given=mesh["given_shape"].values if "given_shape" in mesh else None,
    )


def _matrix(mesh: xr.Dataset, name: str, n: int) -> sp.csr_array:
    row, column, value = (mesh[f"{name}_{part}"].values for part in ("row", "column", "value"))
    return sp.csr_array(sp.coo_array((value, (row, column)), shape=(n, n)))


def _check_matrices(K: sp.csr_array, M: sp.csr_array, rigid: np.ndarray, positions: np.ndarray) -> None:
    left = models.rigid_motion_force(K, rigid)
    if left.max() > UNSTRAINED:
        worst = COMPONENTS[int(np.argmax(left))]
        problem = f"a rigid motion along {worst} strains the body ({left.max():.2g} of the largest term)"
        remedy = "export the free body, without supports; check the units and the table of unknowns"
        raise InputError(WHERE, problem, remedy)
    # unknowns of one node are connected, even where axial, bending and torsion do not couple
    _, node = np.unique(positions, axis=0, return_inverse=True)
    linked = sp.coo_array(K)
    pairs = (np.ones(linked.nnz), (node.ravel()[linked.row], node.ravel()[linked.col]))
    pieces, _ = scipy.sparse.csgraph.connected_components(sp.coo_array(pairs).tocsr(), directed=False)
    if pieces > 1:
        problem = f"the stiffness matrix describes {pieces} bodies without common nodes"
        raise InputError(WHERE, problem, "define each as a separate body")
    try:
        cholesky(M, positions)
    except SolverError:
        raise InputError(WHERE, "the mass matrix is not positive definite", "give every unknown a mass") from None


def _integrator(mesh: xr.Dataset, M: sp.csr_array, component: np.ndarray) -> Callable[[np.ndarray], Integrals]:
    """Return the function that integrates motions over the volume: by given moments, slices, or one axis' mass."""
    if "pair_value" in mesh:
        return partial(_from_moments, mesh)
    node = mesh["unknown_node"].values
    rows = [np.flatnonzero(component == k) for k in range(3)]
    rows = [row[np.argsort(node[row], kind="stable")] for row in rows]
    same = sum(len(row) for row in rows) == len(node) and all(np.array_equal(node[rows[0]], node[row]) for row in rows)
    if same:
        line = sp.csr_array(M[rows[0]][:, rows[0]])
        alike = ALIKE * abs(line).max()
        blocks = [(k, l, M[rows[k]][:, rows[l]]) for k in range(3) for l in range(3)]
        same = all(abs(block - line if k == l else block).max() <= alike for k, l, block in blocks)
    if not same:
        rigid = _as_slices(M, node, component, mesh["unknown_position"].values)
        if rigid is None:
            raise InputError(
                WHERE,
                "the mass matrix differs for motion along x, y and z and is not lumped at the nodes, so that it does "
                "not determine the volume integrals",
                "lump the mass, use nodes with three displacements, or give an npz with the integrals",
            )
        return partial(integrate, rigid)
    order = np.stack(rows, axis=1).ravel()
    spread = sp.csr_array(sp.eye_array(len(node), format="csr")[order])
    return partial(integrals, line, mesh["unknown_position"].values[rows[0]], spread)


def _from_moments(mesh: xr.Dataset, vectors: np.ndarray) -> Integrals:
    n, count = mesh.sizes["unknown"], vectors.shape[1]
    pair = np.empty((3, 3, count, count))
    axes, row, column, value = (mesh[f"pair_{name}"].values for name in ("axes", "row", "column", "value"))
    for k in range(3):
        for l in range(k, 3):
            at = axes == 3 * k + l
            matrix = sp.csr_array(sp.coo_array((value[at], (row[at], column[at])), shape=(n, n)))
            pair[k, l] = vectors.T @ (matrix @ vectors)
            pair[l, k] = pair[k, l].T
    return Integrals(
        mass=float(mesh["body_mass"]),
        first_moment=mesh["first_moment"].values,
        second_moment=mesh["second_moment"].values,
        modal_first_moment=mesh["unknown_first_moment"].values @ vectors,
        position_mode_moment=mesh["unknown_position_moment"].values @ vectors,
        mode_mode_moment=pair,
        second_order_moment=np.zeros_like(pair),
        untilted_inertia=np.zeros((3, 3)),
    )


def frame_motion(mesh: xr.Dataset, component: np.ndarray, k: int) -> sp.csr_array:
    """Return the motion of frame k, that of its node or the mean motion of its nodes, shape (6, ndof)."""
    tied, node = mesh["tie_node"].values[mesh["tie_frame"].values == k], mesh["unknown_node"].values
    count = 6 if len(tied) == 1 else 3
    rows = np.array([[np.flatnonzero((node == t) & (component == c))[0] for c in range(count)] for t in tied])
    pick = models.selection(rows.ravel(), len(component))
    if len(tied) == 1:
        return pick
    x = mesh["unknown_position"].values[rows[:, 0]]
    return sp.csr_array(mean_motion(x, np.ones(len(x)), np.arange(len(x)), x.mean(axis=0), len(x)) @ pick)


def nodal_loads(mesh: xr.Dataset) -> dict[str, list[tuple[str, int, np.ndarray]]]:
    """Return the nodes that carry the load on each frame: node, degree of freedom from 1 on, and what it carries.

    That is its force or moment per force and moment on the frame, shape (6,).  They do the same work as the wrench: a
    mean motion distributes it as tractions.
    """
    component = np.array([COMPONENTS.index(name) for name in mesh["unknown_component"].values])
    found = {}
    for k, name in enumerate(mesh["frame"].values):
        columns = frame_motion(mesh, component, k).tocsc()
        moved, node = np.unique(columns.nonzero()[1]), mesh["unknown_node"].values
        found[str(name)] = [(str(node[u]), int(component[u]) + 1, columns[:, [u]].toarray()[:, 0]) for u in moved]
    return found


def _points_to_draw(mesh: xr.Dataset, component: np.ndarray) -> Drawn:
    """Return the nodes as points to draw; components that a node lacks are drawn at rest."""
    numbers, first, index = np.unique(mesh["unknown_node"].values, return_index=True, return_inverse=True)
    count, position = len(numbers), mesh["unknown_position"].values[first]
    motion = models.node_motion(index.ravel(), component, count)
    return Drawn(position, np.arange(count)[:, None], np.zeros(count), motion)


def _as_slices(M: sp.csr_array, node: np.ndarray, component: np.ndarray, positions: np.ndarray) -> Slices | None:
    r"""Return the nodes as slices of mass, or None where the mass matrix is not that of rigid nodes.

    Most programs have every node of beams and shells as a small rigid body. A node's block of such a matrix, with the
    mass m, its centre c from the node and the inertia J about that centre, is

    .. math:: \begin{bmatrix} m 1 & -m\tilde c \\ m\tilde c & J - m\tilde c\tilde c \end{bmatrix},

    and every volume integral follows from it (`fe.slices`). A consistent mass of nodes that turn does not determine
    them: the matrix does not hold where in the element each fraction of the mass is.

    M: shape (n, n).  node: number, shape (n,).  component: index of ux uy uz rx ry rz, (n,).  positions: [m], (n, 3).
    """
    _, first, index = np.unique(node, return_index=True, return_inverse=True)
    index = index.ravel()
    blocks = _blocks(M, index, component, len(first))
    if blocks is None:
        return None
    mass, c = blocks[:, 0, 0], _axial(blocks[:, 3:, :3]) / blocks[:, :1, 0]
    lever = skew(c)
    J = blocks[:, 3:, 3:] + mass[:, None, None] * lever @ lever
    expected = np.zeros_like(blocks)
    expected[:, range(3), range(3)] = mass[:, None]
    expected[:, 3:, :3] = mass[:, None, None] * lever
    expected[:, :3, 3:] = -expected[:, 3:, :3]
    expected[:, 3:, 3:] = blocks[:, 3:, 3:]
    size = np.array([1.0] * 3 + [np.ptp(positions, axis=0).max()] * 3)
    if np.any(np.abs(expected - blocks) > ALIKE * mass[:, None, None] * np.outer(size, size)):
        return None
    motion, D = at_centres(models.node_motion(index, component, len(first)), c), second_moments(J)
    return Slices(mass, positions[first] + c, D, motion, D, c)


def _blocks(M: sp.csr_array, index: np.ndarray, component: np.ndarray, count: int) -> np.ndarray | None:
    """Return the mass of each node, (count, 6, 6), zero for missing unknowns; None where nodes couple or lack mass."""
    if component.max() >= 6:
        return None
    entries = sp.coo_array(M)
    scale = np.sqrt(M.diagonal())
    mask = np.abs(entries.data) > ALIKE * scale[entries.row] * scale[entries.col]
    row, column, value = entries.row[mask], entries.col[mask], entries.data[mask]
    if np.any(index[row] != index[column]):
        return None
    blocks = np.zeros((count, 6, 6))
    blocks[index[row], component[row], component[column]] = value
    return blocks if blocks[:, range(3), range(3)].all() else None


def _axial(matrices: np.ndarray) -> np.ndarray:
    """Return the axial vectors of the antisymmetric parts, shape (n, 3)."""
    a = 0.5 * (matrices - matrices.transpose(0, 2, 1))
    return np.stack([a[:, 2, 1], a[:, 0, 2], a[:, 1, 0]], axis=1)
