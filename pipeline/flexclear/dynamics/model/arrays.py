"""Packing of tables and stretches into the flat arrays h, f, w and n that compiled functions take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import prod
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics import memory as m


class WorkSpace(NamedTuple):
    """Arrays that one run may change: topology h with the offsets in w; w, n: floats and integers.

    lengths: of the stretches of w, by their indices in the header.
    """

    h: np.ndarray
    w: np.ndarray
    n: np.ndarray
    lengths: Mapping[int, int]


@dataclass(frozen=True)
class Arrays:
    """Topology h and numbers f of a mechanism."""

    h: np.ndarray
    f: np.ndarray

    def size(self, index: int) -> int:
        """Return a size from the header."""
        return int(self.h[index])

    def table(self, table: Any, h: np.ndarray | None = None) -> np.ndarray:
        """Return a view of a table of h or f with named fields, shape (rows,); h: another copy of the topology."""
        topology, after = _neighbours()[table.at]
        array = (self.h if h is None else h) if topology else self.f
        end = len(array) if after is None else self.h[after]
        return m.named(table, array[self.h[table.at] : end])

    def rows(self, table: Any) -> np.ndarray:
        """Return a table of h or f as `pack` takes it, shape (rows, size)."""
        stretch = self.table(table)
        return stretch.view(np.int64 if _neighbours()[table.at][0] else np.float64).reshape(-1, table.size)

    def work_space(self, room: m.Room) -> WorkSpace:
        """Return a work space with a copy of h, in which the ground's frame is set and all else is zero.

        room: sizes that the integration method needs.
        """
        h, end = self.h.copy(), 0
        lengths = _work_lengths(h, room)
        for index, length in lengths.items():
            h[index] = end
            end += length
        laws, contacts = self.size(m.N_LAWS), self.size(m.N_CONTACTS)
        w, n = np.zeros(end), np.zeros(m.INTEGERS + laws + contacts, dtype=np.int64)
        axes = h[m.LINK_FRAMES.at] + m.FRAME.axes
        w[axes : axes + 9] = np.eye(3).ravel()
        n[m.ACTIVE], n[m.MODE] = m.INTEGERS, m.INTEGERS + laws
        return WorkSpace(h, w, n, lengths)


@cache
def _neighbours() -> dict[int, tuple[bool, int | None]]:
    """Return, for each table of h and f by its index: True for one of h, and the index of the next table."""
    neighbours: dict[int, tuple[bool, int | None]] = {}
    for array in ("h", "f"):
        places = [table.at for table in m.TABLES[array]]
        neighbours |= {index: (array == "h", after) for index, after in zip(places, [*places[1:], None], strict=True)}
    return neighbours


def rows(table: Any, entries: Any) -> np.ndarray:
    """Return rows of a table, shape (rows, size), from a sequence of rows or from an array with as many numbers."""
    number = np.int64 if table in m.TABLES["h"] else np.float64
    return np.asarray(entries, dtype=number).reshape(-1, table.size)


def named_rows(table: Any, entries: Any) -> np.ndarray:
    """Return rows of a table with named fields, shape (rows,), from the same arguments as `rows`."""
    return m.named(table, rows(table, entries).ravel())


def pack(sizes: Mapping[int, int], tables: Mapping[Any, Any]) -> Arrays:
    """Pack tables, each a sequence of rows, into h and f.

    sizes: those of the header that do not follow from the tables.
    """
    h = np.zeros(m.HEADER, dtype=np.int64)
    counts: dict[Any, int] = {}
    arrays: dict[str, list[np.ndarray]] = {"h": [h], "f": []}
    for array, start in (("h", m.HEADER), ("f", 0)):
        for table in m.TABLES[array]:
            filled = rows(table, tables[table])
            counts[table], h[table.at] = len(filled), start
            start += filled.size
            arrays[array].append(filled.ravel())
    for index, size in (_sizes(counts, tables) | dict(sizes)).items():
        h[index] = size
    return Arrays(np.concatenate(arrays["h"]), np.concatenate(arrays["f"]))


def _sizes(count: Mapping[Any, int], tables: Mapping[Any, Any]) -> dict[int, int]:
    """Return the sizes of the header that follow from the tables."""
    closures = named_rows(m.CLOSURES, tables[m.CLOSURES])
    counted = {name: table for name, table in m.NAMED.items() if table in count and f"n_{name}" in m.SIZES}
    return {m.SIZES[f"n_{name}"]: count[table] for name, table in counted.items()} | {
        m.N_FLEX: count[m.FLEXES],
        m.N_KEPT_ROWS: count[m.CLOSURE_ROWS],
        m.NY: count[m.GROUPS],
        m.N_GROUPS: count[m.FLOORS],
        m.N_COMPONENTS: count[m.BOOKS],
        m.JACOBIAN_SIZE: int(np.sum(closures["n_rows"] * closures["n_support"])),
    }


def _work_lengths(h: np.ndarray, room: m.Room) -> dict[int, int]:
    """Return the lengths of the stretches and tables of w, by their indices in the header, in ascending order."""
    known = {name: int(h[index]) for name, index in m.SIZES.items()} | vars(room)

    def factor(text: str) -> int:
        return int(text) if text.isdigit() else min(1, known[text[1:]]) if text[0] == "?" else known[text]

    def count(text: str) -> int:
        return sum(prod(map(factor, term.split("*"))) for term in text.split("+"))

    return {index: size * count(text) for index, (size, text) in sorted(m.LENGTHS.items())}
