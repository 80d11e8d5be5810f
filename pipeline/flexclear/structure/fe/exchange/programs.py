"""Matrices as Abaqus, Ansys, CalculiX and Nastran write them, and the frequencies that their listings state.

Rows of a matrix are numbered from zero; where a file names node and component instead, a row is its key,
8 node + component, until `unknowns` of all files are known.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from flexclear.structure.fe.exchange import ansys, nodes
from flexclear.structure.fe.exchange.nodes import AGAIN
from flexclear.system import machine
from flexclear.system.errors import InputError
from flexclear.system.external_files import convert_reader_errors, require_file

#: memory while a text of entries is read, over the size of the file
COPIES = 6.0
SMALLER = "condense the body, or remove parts that no frame needs"
#: factor of the node number in a key
KEY = 8
#: the line of a listing that begins a table of frequencies, and the column of cycles per unit of time
TABLES = (
    (re.compile(r"E\s*I\s*G\s*E\s*N\s*V\s*A\s*L\s*U\s*E\s+O\s*U\s*T\s*P\s*U\s*T"), 3),
    (re.compile(r"R\s*E\s*A\s*L\s+E\s*I\s*G\s*E\s*N\s*V\s*A\s*L\s*U\s*E\s*S"), 4),
)
TOTAL = re.compile(r"TOTAL MASS OF MODEL|T O T A L   E F F E C T I V E   M A S S")


@dataclass(frozen=True)
class Entries:
    """Entries of a matrix; row and column are keys where `keyed`, else numbers from zero.

    shape: as the file announces it, if it does.
    """

    row: np.ndarray
    column: np.ndarray
    value: np.ndarray
    keyed: bool
    name: str
    shape: tuple[int, int] | None = None

    @property
    def size(self) -> int:
        """Number of rows."""
        if self.shape is not None:
            return max(self.shape)
        return len(np.unique(self.row)) if self.keyed else int(self.row.max()) + 1

    def matrix(self, keys: np.ndarray, count: int, where: str) -> sp.coo_array:
        """Return the matrix of `count` unknowns, which have these keys; one triangle stands for both."""
        row, column = (self._numbers(part, keys, where) for part in (self.row, self.column))
        if self.shape is None:
            self._require_rows(row, column, count, where)
        elif self.shape != (count, count):
            problem = f"'{self.name}' has the shape {self.shape}, which does not match the lines of `unknowns`"
            raise InputError(where, problem)
        matrix = sp.coo_array((self.value, (row, column)), shape=(count, count))
        lower, upper = sp.tril(matrix, -1), sp.triu(matrix, 1)
        both = self.shape is not None or (lower.nnz and upper.nnz)
        return matrix if both else sp.coo_array(matrix + lower.T + upper.T)

    def _numbers(self, part: np.ndarray, keys: np.ndarray, where: str) -> np.ndarray:
        if not self.keyed:
            return part
        order = np.argsort(keys)
        place = order[np.searchsorted(keys, part, sorter=order).clip(max=len(keys) - 1)]
        lacking = np.flatnonzero(keys[place] != part)
        if len(lacking):
            problem = f"node {part[lacking[0]] // KEY} of '{self.name}' lacks a row in `unknowns`"
            raise InputError(where, problem, "give the files of one model")
        return place

    def _require_rows(self, row: np.ndarray, column: np.ndarray, count: int, where: str) -> None:
        """Raise InputError for entries beyond the unknowns or given twice, and for rows without a diagonal entry."""
        first, last = min(row.min(), column.min()), max(row.max(), column.max())
        if first < 0 or last >= count:
            wrong = first if first < 0 else last
            problem = f"'{self.name}' has an entry in row or column {wrong + 1}, but there are {count} unknowns"
            raise InputError(where, problem, "give the files of one model")
        place, times = np.unique(row * count + column, return_counts=True)
        if times.max() > 1:
            i, j = np.divmod(place[times > 1][0], count)
            raise InputError(where, f"'{self.name}' has the entry of row {i + 1}, column {j + 1} twice", AGAIN)
        empty = np.flatnonzero(np.bincount(row[row == column], minlength=count) == 0)
        if len(empty):
            problem = f"'{self.name}' has no diagonal entry in row {empty[0] + 1} of {count}"
            raise InputError(where, problem, "write it again: it was cut, or that unknown has no stiffness or mass")


def read(path: Path, letter: str, where: str) -> Entries:
    """Read one matrix: text of rows, columns and entries, DMIG, or OUTPUT4; `letter` begins its name where it has one.

    Raises InputError for an unreadable file, ResourceError for a large one.
    """
    require_file(path, where)
    machine.require_memory(COPIES * path.stat().st_size, f"{where}: '{path.name}'", SMALLER)
    suffix = path.suffix.lower()
    with convert_reader_errors(path, where, f"'{path.name}' holds no matrix that is read here", AGAIN):
        if suffix == ".sub":
            raise InputError(where, f"'{path.name}': superelements are not read", "write the full matrices, as .full")
        if suffix == ".full":
            found = _ansys(path, letter, where)
        elif suffix in (".pch", ".bdf", ".dat", ".nas"):
            found = _dmig(path, letter, where)
        elif suffix == ".op4":
            found = _output4(path, letter, where)
        else:
            found = _columns(path)
        wrong = np.flatnonzero(~np.isfinite(found.value))
        if len(wrong):
            raise ValueError(f"entry {wrong[0] + 1} is {found.value[wrong[0]]}")
        if not len(found.value):
            raise ValueError("it has no entries")
    return found


def _columns(path: Path) -> Entries:
    """Read lines of node, component, node, component, entry (Abaqus) or row, column, entry (Abaqus, CalculiX)."""
    with path.open(encoding="utf-8") as file:
        first = next((line for line in file if line.strip() and not line.startswith("*")), "")
    if not first:
        raise ValueError("it has no entries")
    held = np.loadtxt(path, comments="*", delimiter="," if "," in first else None, ndmin=2, encoding="utf-8")
    if held.shape[1] not in (3, 5):
        raise ValueError(f"its lines have {held.shape[1]} columns, where 3 or 5 are known")
    index = held[:, :-1]
    wrong = np.flatnonzero(((index < 1) | (index > 2**52) | (index != np.floor(index))).any(axis=1))
    if len(wrong):
        shown = ", ".join(f"{number:.12g}" for number in index[wrong[0]])
        raise ValueError(f"line {wrong[0] + 1} of its entries begins with {shown}, which are no rows of a body")
    whole = index.astype(np.int64)
    if held.shape[1] == 3:
        return Entries(whole[:, 0] - 1, whole[:, 1] - 1, held[:, 2], False, path.name)
    return Entries(
        node_keys(whole[:, 0], whole[:, 1]), node_keys(whole[:, 2], whole[:, 3]), held[:, 4], True, path.name
    )


def node_keys(node: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return keys of nodes and directions 1 to 6; raise ValueError for others."""
    wrong = np.flatnonzero((direction < 1) | (direction > 6))
    if len(wrong):
        which = f"row {wrong[0] + 1}, direction {direction[wrong[0]]} of node {node[wrong[0]]}"
        raise ValueError(f"{which}, is no motion of a node; full matrices have no generalised coordinates")
    return KEY * node + direction - 1


def _dmig(path: Path, letter: str, where: str) -> Entries:
    """Read the one DMIG matrix of a punch file whose name begins with this letter."""
    names: set[str] = set()
    places: list[tuple[int, ...]] = []
    entries: list[float] = []
    for number, card, values in nodes.cards(path):
        if card != "DMIG" or not values[0].upper().startswith(letter):
            continue
        names.add(values[0].upper())
        with nodes.locate_unreadable_number(path, number, where):
            if values[1] != "0":
                at = int(values[1]), int(values[2])
                rows = [values[k : k + 3] for k in range(4, len(values) - 2, 4) if values[k]]
                places += [(*at, int(node), int(direction)) for node, direction, _ in rows]
                entries += [nodes.parse_real(value) for _, _, value in rows]
            elif values[2] not in ("1", "6") or values[3] not in ("1", "2"):
                problem = f"{values[0]} has form {values[2]} and type {values[3]}"
                nodes.refuse_line(path, number, where, problem, "write a square and real matrix")
    _require_one(names, letter)
    node, direction, row, of_row = np.array(places, dtype=np.int64).reshape(-1, 4).T
    return Entries(node_keys(row, of_row), node_keys(node, direction), np.array(entries), True, path.name)


def _require_one(names: Iterable[str], letter: str) -> None:
    """Raise ValueError unless there is one name."""
    found = sorted(names)
    if len(found) != 1:
        listed = f"the matrices {', '.join(found)}" if found else "none"
        raise ValueError(f"one matrix whose name begins with {letter} is needed, and it has {listed}")


def _output4(path: Path, letter: str, where: str) -> Entries:
    """Read the one matrix of a text file of OUTPUT4, dense or sparse, whose name begins with this letter."""
    found: dict[str, tuple[list[int], list[int], list[float]]] = {}
    with path.open(encoding="ascii") as opened:
        file = enumerate(opened, 1)
        for _, line in filter(lambda numbered: numbered[1].strip(), file):
            header = re.match(r"\s*(\d+)\s*(-?\d+)\s*\d\s+(\d)\s*(\w+)\s*\S*?\d+[ED](\d+)\.", line)
            if header is None:
                raise ValueError("it has no header of OUTPUT4 in text; write it FORMATTED")
            columns, rows, kind, name, width = header.groups()
            if kind not in "12" or abs(int(rows)) != int(columns):
                raise ValueError(f"{name} is {rows} by {columns} of type {kind}; known: square and real")
            content = _of_output4(file, int(columns), int(width), path, where)
            if name.upper().startswith(letter):
                found[name] = content
    _require_one(found, letter)
    (entries,) = found.values()
    row, column, value = (np.array(part) for part in entries)
    return Entries(row - 1, column - 1, value, False, path.name)


def _of_output4(
    file: Iterator[tuple[int, str]], columns: int, width: int, path: Path, where: str
) -> tuple[list[int], list[int], list[float]]:
    """Return rows, columns and values up to the end of a matrix, the column after its last."""
    rows: list[int] = []
    at: list[int] = []
    values: list[float] = []
    column = row = 0
    for number, line in file:
        with nodes.locate_unreadable_number(path, number, where):
            if "." in line and column > columns:
                return rows, at, values
            if "." in line:
                new = [nodes.parse_real(line[k : k + width]) for k in range(0, len(line.rstrip()), width)]
                values += new
                rows += range(row, row + len(new))
                at += [column] * len(new)
                row += len(new)
                continue
            numbers = [int(part) for part in line.split()]
            if len(numbers) == 3:
                column, row, _ = numbers
            else:  # the beginning of a string of rows: both in one number, or length and row
                row = numbers[0] % 65536 if len(numbers) == 1 else numbers[1]
    raise ValueError(f"it ends before column {columns + 1}, which closes the matrix")


def _ansys(path: Path, letter: str, where: str) -> Entries:
    data = ansys.arrays(path, where)
    if data["held"]:
        problem = f"constraints hold {data['held']} unknowns of '{path.name}', which its matrices lack"
        raise InputError(where, problem, "write the free body, without supports")
    keys = node_keys(data["node"].astype(np.int64), data["component"].astype(np.int64) + 1)
    name = {"K": "stiffness", "M": "mass"}[letter]
    row, column = (keys[data[f"{name}_{part}"]] for part in ("row", "column"))
    return Entries(row, column, data[f"{name}_value"], True, path.name)


def unknowns(path: Path, where: str) -> np.ndarray:
    """Return the keys of the rows of a `.dof` file of CalculiX, lines `node.direction`."""
    require_file(path, where)
    with convert_reader_errors(path, where, f"'{path.name}' is no list of node.direction", AGAIN):
        lines = path.read_text(encoding="ascii").split()
        if other := next((k for k, line in enumerate(lines, 1) if not re.fullmatch(r"\d{1,15}\.\d", line)), None):
            raise ValueError(f"line {other} is none")
        if wrong := [line for line, times in Counter(lines).most_common(1) if times > 1]:
            raise ValueError(f"it has {wrong[0]} more than once")
        return node_keys(*np.array([line.split(".") for line in lines], dtype=np.int64).reshape(-1, 2).T)


def read_listing(path: Path, where: str) -> tuple[np.ndarray, float | None]:
    """Return the frequencies per unit of time, and the mass, if any, that a listing states (`.dat`, `.f06`)."""
    require_file(path, where)
    frequency: list[float] = []
    mass: float | None = None
    waiting, column = False, 0
    with (
        convert_reader_errors(path, where, f"'{path.name}' is no listing"),
        path.open(encoding="utf-8", errors="replace") as file,
    ):
        for line in file:
            starts = [place for pattern, place in TABLES if pattern.search(line)]
            if starts:
                column = starts[0]
                continue
            words = line.split()
            if column and len(words) > column and words[0].isdigit():
                if int(words[0]) == len(frequency) + 1:
                    frequency.append(float(words[column]))
            elif column and frequency and words and words[0].isalpha():
                column = 0
            waiting = waiting or TOTAL.search(line) is not None
            if waiting and mass is None and words:
                with suppress(ValueError):
                    mass = float(words[0])
    if not frequency or not np.isfinite([*frequency, mass or 0.0]).all():
        problem = f"'{path.name}' has no table of finite frequencies"
        raise InputError(where, problem, "name the listing of a modal analysis")
    return np.array(frequency), mass
