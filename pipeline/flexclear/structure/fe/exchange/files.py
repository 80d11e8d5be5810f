"""Files of mass and stiffness matrices: npz and HDF5 (complete models), MatrixMarket, those of `exchange.programs`."""

from __future__ import annotations

import bz2
import csv
import gzip
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
import scipy.sparse as sp

from flexclear.structure.fe.exchange import nodes, programs
from flexclear.structure.fe.exchange.programs import KEY, SMALLER, Entries
from flexclear.structure.fe.model import DOFS, Model
from flexclear.system import machine
from flexclear.system.errors import InputError
from flexclear.system.external_files import convert_reader_errors, require_file, require_whole

if TYPE_CHECKING:
    from flexclear.structure.fe.recipe import Matrices

COMPONENTS = (*DOFS, "internal")
COLUMNS = ("node", "x", "y", "z", "component")
#: bodies with more unknowns are exported without integrals, which the import then takes from the mass matrix
MOMENTS_UP_TO = 1500
#: peak memory of reading a file, as a multiple of its content: checks and conversion to SI units make copies
COPIES = 4.0
HDF5 = (".h5", ".hdf5")
OPENERS: dict[str, Callable[..., TextIO]] = {".gz": gzip.open, ".bz2": bz2.open}


@dataclass(frozen=True)
class Table:
    """Meaning of the rows of the matrices, in units of the file.

    node: node number, shape (n,).  component: index into COMPONENTS, shape (n,).  position: shape (n, 3).
    """

    node: np.ndarray
    component: np.ndarray
    position: np.ndarray


@dataclass(frozen=True)
class Contents:
    """Matrices and table of a file; moments by their names in schema MATRICES, empty where the file has none.

    sets: node numbers by name.  basis: shapes given with the body, (n, shapes).
    """

    stiffness: sp.coo_array
    mass: sp.coo_array
    table: Table
    moments: dict[str, np.ndarray]
    sets: dict[str, np.ndarray] = field(default_factory=dict)
    basis: np.ndarray | None = None


def table(model: Model) -> Table:
    """Return the table of a model's unknowns, read from its rigid motions; nodes are numbered by position."""
    moved = np.abs(model.rigid) > 0.0
    component = np.where(moved[:, :3].any(axis=1), np.argmax(moved[:, :3], axis=1), 3 + np.argmax(moved[:, 3:], axis=1))
    component[~moved.any(axis=1)] = COMPONENTS.index("internal")
    _, node = np.unique(model.position, axis=0, return_inverse=True)
    return Table(node.ravel() + 1, component, model.position)


def write_npz(model: Model, path: Path) -> None:
    """Write all that `shape.type = "matrices"` needs of a body to an npz file, in SI units."""
    rows = table(model)
    content: dict[str, Any] = {}
    for name, matrix in (("stiffness", model.stiffness), ("mass", model.mass)):
        entries = sp.coo_array(matrix)
        content |= {f"{name}_row": entries.row, f"{name}_column": entries.col, f"{name}_value": entries.data}
    content |= {"node": rows.node, "component": rows.component, "position": rows.position}
    np.savez_compressed(path, **content, **(moments(model) if model.size <= MOMENTS_UP_TO else {}))


def write_matrix_market(model: Model, folder: Path) -> None:
    """Write stiffness.mtx, mass.mtx and unknowns.csv to a folder, in SI units."""
    import scipy.io  # here, since it takes as long as all other modules of bodies

    for name, matrix in (("stiffness", model.stiffness), ("mass", model.mass)):
        scipy.io.mmwrite(folder / f"{name}.mtx", sp.coo_array(matrix), symmetry="symmetric", precision=17)
    content = table(model)
    with (folder / "unknowns.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for node, position, component in zip(content.node, content.position, content.component, strict=True):
            writer.writerow([node, *map(repr, position.tolist()), COMPONENTS[component]])


def moments(model: Model) -> dict[str, Any]:
    """Return the volume integrals per unknown, those of unit vectors, by their names in schema MATRICES."""
    integrals = model.integrate(np.eye(model.size))
    entries = []
    for k in range(3):
        for l in range(k, 3):
            pair = sp.coo_array(integrals.mode_mode_moment[k, l])
            entries.append((np.full(pair.nnz, 3 * k + l), pair.row, pair.col, pair.data))
    axes, row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return {
        "body_mass": integrals.mass,
        "first_moment": integrals.first_moment,
        "second_moment": integrals.second_moment,
        "unknown_first_moment": integrals.modal_first_moment,
        "unknown_position_moment": integrals.position_mode_moment,
        "pair_axes": axes,
        "pair_row": row,
        "pair_column": column,
        "pair_value": value,
    }


def read(shape: Matrices, folder: Path, where: str) -> Contents:
    """Read the files that a recipe names; raise InputError unless they describe one body."""
    known = nodes.Nodes() if shape.nodes is None else nodes.read(folder / shape.nodes, where)
    if shape.file is not None and (folder / shape.file).suffix.lower() in (".npz", *HDF5):
        contents = read_npz(folder / shape.file, where)
    else:
        paths = [folder / str(name or shape.file) for name in (shape.stiffness, shape.mass)]
        parts = [_entries(path, letter, where) for path, letter in zip(paths, "KM", strict=True)]
        content = _rows(shape, folder, parts, known, where)
        keys = KEY * content.node + content.component
        K, M = (part.matrix(keys, len(content.node), where) for part in parts)
        contents = Contents(K, M, content, {})
    contents = replace(contents, sets=known.sets)
    if shape.basis is None:
        return contents
    basis, n = _matrix(folder / shape.basis, where), len(contents.table.node)
    if basis.shape[0] != n or basis.shape[1] > n or not np.isfinite(basis.data).all():
        problem = f"'{shape.basis}' with the shape {basis.shape} is no basis of finite numbers for {n} unknowns"
        raise InputError(where, problem, "write a column per shape, its rows in the order of the unknowns")
    return replace(contents, basis=basis.toarray())


def _entries(path: Path, letter: str, where: str) -> Entries:
    """Return the entries of a MatrixMarket file, or of a file of another program."""
    require_file(path, where)
    with convert_reader_errors(path, where, f"'{path.name}' cannot be read"), path.open("rb") as file:
        first = file.read(14)
    if not first.startswith(b"%%") and path.suffix not in OPENERS:
        return programs.read(path, letter, where)
    matrix = _matrix(path, where)
    return Entries(matrix.row, matrix.col, matrix.data, False, path.name, matrix.shape)


def _rows(shape: Matrices, folder: Path, parts: list[Entries], known: nodes.Nodes, where: str) -> Table:
    """Return the table of unknowns: of its own file, or of nodes and components that the matrices name."""
    if shape.unknowns is not None and not shape.unknowns.lower().endswith(".dof"):
        return _table(folder / shape.unknowns, where, max(part.size for part in parts))
    if shape.unknowns is not None:
        keys, source = programs.unknowns(folder / shape.unknowns, where), shape.unknowns
    elif all(part.keyed for part in parts):
        keys, source = np.unique(np.concatenate([part.row for part in parts])), parts[0].name
    else:
        name = next(part.name for part in parts if not part.keyed)
        problem = f"the rows of '{name}' have numbers only, which do not say their nodes and components"
        raise InputError(where, problem, "give `unknowns`: a CSV table, or the .dof file of CalculiX")
    if shape.nodes is None:
        raise InputError(where, f"'{source}' does not say where its nodes are", "give `nodes`, the deck of the model")
    node, component = np.divmod(keys, KEY)
    missing = [k for k, number in enumerate(node.tolist()) if number not in known.position]
    if missing:
        problem = f"node {node[missing[0]]}, row {missing[0] + 1} of '{source}', is none of the {len(known.position)}"
        remedy = "give the deck from which the matrices were made, without shells or beams that were expanded"
        raise InputError(where, f"{problem} nodes of '{shape.nodes}'", remedy)
    return Table(node, component, np.array([known.position[number] for number in node.tolist()]))


def read_npz(path: Path, where: str) -> Contents:
    """Read a file that `write_npz` wrote, or its arrays in HDF5; raise InputError when an array is missing."""
    require_file(path, where)
    with convert_reader_errors(path, where, f"'{path.name}' holds no matrices", "write it with exchange.files"):
        data = _read_arrays(path, where)
        content = Table(
            _array(data, "node", "iu"), _array(data, "component", "iu"), _array(data, "position", "iuf", (None, 3))
        )
        n = len(content.node)
        if not len(content.component) == len(content.position) == n or not np.isfinite(content.position).all():
            raise ValueError("node, component and position must have equally many rows of finite numbers")
        if n == 0 or content.component.min() < 0 or content.component.max() >= len(COMPONENTS):
            raise ValueError(f"components are numbers from 0 to {len(COMPONENTS) - 1}: {', '.join(COMPONENTS)}")
        matrices = []
        for name in ("stiffness", "mass"):
            row, column = (_array(data, f"{name}_{part}", "iu") for part in ("row", "column"))
            matrices.append(sp.coo_array((_array(data, f"{name}_value", "iuf"), (row, column)), shape=(n, n)))
        for name in list(data):
            data[name] = _array(data, name, "iuf", None)
    return Contents(matrices[0], matrices[1], content, data)


def _read_arrays(path: Path, where: str) -> dict[str, np.ndarray]:
    """Return all arrays of an npz or HDF5 file by name; refuse pickled objects, which could run code."""
    if path.suffix.lower() in HDF5:
        require_whole(path, where)
        import h5py

        with h5py.File(path, "r") as held:
            machine.require_memory(
                COPIES * sum(one.nbytes for one in held.values()), f"{where}: '{path.name}'", SMALLER
            )
            return {name: one[()] for name, one in held.items()}
    with zipfile.ZipFile(path) as packed:
        need = COPIES * sum(entry.file_size for entry in packed.infolist())
    machine.require_memory(need, f"{where}: '{path.name}' unpacked", SMALLER)
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def _array(
    data: dict[str, np.ndarray], name: str, kinds: str, shape: tuple[int | None, ...] | None = (None,)
) -> np.ndarray:
    """Remove an array from those of a file and return it; raise ValueError unless NumPy kind and shape are as given.

    shape: None for any length, or, as a whole, for any shape.
    """
    array = data.pop(name)
    fits = shape is None or (
        array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
    )
    if array.dtype.kind not in kinds or not fits:
        raise ValueError(f"'{name}' is an array of {array.dtype.name}, {array.shape}")
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _matrix(path: Path, where: str) -> sp.coo_array:
    """Return the real matrix of a MatrixMarket file: coordinate or array layout, general or symmetric.

    NumPy reads the numbers: `scipy.io.mmread` (1.17) ends the process where a file was cut or has a flipped bit.
    """
    import scipy.io

    require_file(path, where)
    with convert_reader_errors(path, where, f"'{path.name}' is not a MatrixMarket file"):
        rows, columns, count, layout, field, symmetry = scipy.io.mminfo(path)
        if field not in ("real", "integer", "double") or symmetry not in ("general", "symmetric"):
            raise ValueError(f"its header says {field} {symmetry}; known: real or integer, general or symmetric")
        machine.require_memory(COPIES * 24.0 * count, f"{where}: '{path.name}'", SMALLER)
        with OPENERS.get(path.suffix, open)(path, "rt", encoding="utf-8") as file:
            next(line for line in file if line.strip() and not line.startswith("%"))  # the line of sizes
            # one entry more than the header gives: the end of a compressed file does not follow from its size
            held = np.loadtxt(file, comments="%", ndmin=2, max_rows=count + 1)
        if layout == "array":
            return _dense(held.ravel(), rows, columns, symmetry == "symmetric")
        return _sparse(held, rows, columns, count, symmetry == "symmetric")


def _sparse(held: np.ndarray, rows: int, columns: int, count: int, symmetric: bool) -> sp.coo_array:
    """Return the matrix with these lines of row, column and value; symmetric files hold one triangle."""
    if len(held) != count or (count and held.shape[1] != 3):
        raise ValueError(f"it holds {len(held)} entries where its header says {count}")
    if symmetric and count < rows:
        raise ValueError(f"its header says {count} entries for {rows} rows, so that some are empty")
    index = held[:, :2].T - 1
    if not ((index >= 0) & (index < np.array([[rows], [columns]])) & (index == np.floor(index))).all():
        raise ValueError(f"an entry lies outside of its {rows} x {columns}")
    matrix = sp.coo_array((held[:, 2], index.astype(np.int64)), shape=(rows, columns))
    return sp.coo_array(matrix + sp.tril(matrix, -1).T + sp.triu(matrix, 1).T) if symmetric else matrix


def _dense(value: np.ndarray, rows: int, columns: int, symmetric: bool) -> sp.coo_array:
    """Return the matrix from its columns, one after the other; symmetric files hold the parts below the diagonal."""
    if symmetric and rows == columns and len(value) == rows * (rows + 1) // 2:
        column, row = np.triu_indices(rows)
        whole = np.zeros((rows, columns))
        whole[row, column] = whole[column, row] = value
        return sp.coo_array(whole)
    if symmetric or len(value) != rows * columns:
        raise ValueError(f"it holds {len(value)} entries, which do not fill {rows} x {columns}")
    return sp.coo_array(value.reshape(columns, rows).T)


def _component(text: str) -> int:
    name = text.strip().lower()
    if name not in COMPONENTS:
        raise ValueError(f"unknown component '{text}'")
    return COMPONENTS.index(name)


def _table(path: Path, where: str, count: int) -> Table:
    """Read a table of `count` rows; one more row is read, so that a longer table is noticed."""
    require_file(path, where)
    hint = f"a line `{','.join(COLUMNS)}`, then one per row of the matrices; components: {', '.join(COMPONENTS)}"
    with (
        convert_reader_errors(path, where, f"'{path.name}' is not a table of unknowns", hint),
        path.open(encoding="utf-8", newline="") as file,
    ):
        rows = list(islice(csv.DictReader(file, skipinitialspace=True), count + 1))
        if short := next((k for k, row in enumerate(rows, 2) if None in row.values()), None):
            raise ValueError(f"line {short} has too few fields")
        position = np.array([[float(row[axis]) for axis in "xyz"] for row in rows]).reshape(-1, 3)
        if not np.isfinite(position).all():
            raise ValueError(f"line {2 + np.argwhere(~np.isfinite(position))[0][0]} has a position that is not finite")
        component = np.array([_component(row["component"]) for row in rows])
        return Table(np.array([int(row["node"]) for row in rows], dtype=np.int64), component, position)
