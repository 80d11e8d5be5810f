"""Matrices in MatrixMarket files, read so that a damaged file is refused.

SciPy's reader takes the indices of a file as they are, and writes beyond its arrays where they lie outside of the
matrix (scipy 1.17): a flipped bit then ends the process.

Source: Boisvert, Pozo and Remington (1996), The Matrix Market exchange formats: initial design, NISTIR 5935.
"""

from __future__ import annotations

import bz2
import csv
import gzip
import warnings
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import scipy.sparse as sp

from flexclear.pipeline.core import machine
from flexclear.pipeline.core.external_files import isolated

#: what a file holds is in memory so many times while it is checked and brought into SI units
COPIES = 4.0
SMALLER = "condense the body, or leave out what no frame needs"
#: more rows than this are taken for damage
LARGEST = 10**9
#: characters of a line of the header, or of a comment, that are read at once
LONGEST = 10_000
OPENERS: dict[str, Callable[..., TextIO]] = {".gz": gzip.open, ".bz2": bz2.open}


def read(path: Path, where: str) -> sp.coo_array:
    """A real matrix, coordinates or array, general or symmetric; `isolated.UnreadableError` in words when it is not.

    Raises ResourceError when its header promises more than memory can hold, and as `isolated.read` does.
    """
    matrix = isolated.read(entries, path, where, isolated.allowed())
    return sp.coo_array((matrix["value"], (matrix["row"], matrix["column"])), shape=tuple(matrix["shape"]))


def entries(path: Path, where: str, allowed: float) -> dict[str, Any]:
    """What `read` says, in the child: shape, row, column and value. allowed: bytes of memory."""
    with OPENERS.get(path.suffix, open)(path, "rt", encoding="utf-8", errors="strict") as file:
        layout, symmetric = _kind(file.readline(LONGEST))
        rows, columns, *rest = _sizes(file)
        count = rest[0] if rest else rows * columns
        machine.require_memory(COPIES * 24.0 * count, f"{where}: '{path.name}'", SMALLER, allowed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without entries, which is reported below
            # one more than there should be: packed files have no end that follows from their size
            held = np.loadtxt(file, comments="%", ndmin=2, max_rows=count + 1)
    matrix = _sparse(held, rows, columns, count, symmetric) if layout else _dense(held, rows, columns, symmetric)
    return {"shape": list(matrix.shape), "row": matrix.row, "column": matrix.col, "value": matrix.data}


def read_unknowns(path: Path, count: int) -> dict[str, Any]:
    """A table of unknowns, of so many rows at most and one more, which shows that it is longer.

    node: numbers.  component: texts.  position: shape (rows, 3).  Raises `isolated.UnreadableError`.
    """
    table: dict[str, Any] = isolated.read(unknowns, path, count)
    return table


def unknowns(path: Path, count: int) -> dict[str, Any]:
    """What `read_unknowns` says, in the child."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(islice(csv.DictReader(file, skipinitialspace=True), count + 1))
    return {
        "node": np.array([int(row["node"]) for row in rows], dtype=np.int64),
        "component": [str(row["component"]) for row in rows],
        "position": np.array([[float(row[axis]) for axis in "xyz"] for row in rows]).reshape(-1, 3),
    }


def _kind(line: str) -> tuple[bool, bool]:
    """Whether entries have coordinates, and whether only one triangle is there."""
    words = line.lower().split()
    if len(words) != 5 or words[:2] != ["%%matrixmarket", "matrix"]:
        raise ValueError("it does not begin with '%%MatrixMarket matrix'")
    _, _, layout, field, symmetry = words
    if layout not in ("coordinate", "array") or field not in ("real", "integer", "double"):
        raise ValueError(f"its header says {layout} {field}; known: coordinate or array, real or integer")
    if symmetry not in ("general", "symmetric"):
        raise ValueError(f"its header says {symmetry}; known: general, symmetric")
    return layout == "coordinate", symmetry == "symmetric"


def _sizes(file: TextIO) -> list[int]:
    lines = iter(partial(file.readline, LONGEST), "")
    line = next((text for text in lines if text.strip() and not text.startswith("%")), "")
    sizes = [int(word) for word in line.split()]
    if len(sizes) not in (2, 3) or min(sizes) < 0 or max(sizes) > LARGEST:
        raise ValueError(f"its sizes are said to be {sizes}")
    return sizes


def _sparse(entries: np.ndarray, rows: int, columns: int, count: int, symmetric: bool) -> sp.coo_array:
    if len(entries) != count or (count and entries.shape[1] != 3):
        raise ValueError(f"it holds {len(entries)} entries where its header says {count}")
    index, value = entries[:, :2].T - 1.0, entries[:, 2]
    inside = (index >= 0.0) & (index < np.array([[rows], [columns]])) & (index == np.floor(index))
    if not inside.all():
        raise ValueError(f"an entry lies outside of its {rows} x {columns}")
    row, column = index.astype(np.int64)
    if symmetric:
        off = row != column
        row, column = np.concatenate([row, column[off]]), np.concatenate([column, row[off]])
        value = np.concatenate([value, value[off]])
    return sp.coo_array((value, (row, column)), shape=(rows, columns))


def _dense(entries: np.ndarray, rows: int, columns: int, symmetric: bool) -> sp.coo_array:
    """Columns one after the other; of a symmetric matrix their parts below the diagonal."""
    value = entries.ravel()
    if symmetric and rows == columns and len(value) == rows * (rows + 1) // 2:
        column, row = np.triu_indices(rows)
        whole = np.zeros((rows, columns))
        whole[row, column] = whole[column, row] = value
        return sp.coo_array(whole)
    if symmetric or len(value) != rows * columns:
        raise ValueError(f"it holds {len(value)} entries, which do not fill {rows} x {columns}")
    return sp.coo_array(value.reshape(columns, rows).T)
