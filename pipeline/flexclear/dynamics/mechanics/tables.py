"""The topology of a mechanism as routines read it, and the places of its numbers in f, w and the state."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import cache
from math import prod
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.routines.calls import SCENE, WORK, Cell, cells
from flexclear.dynamics.specialise import topology as topologies


@cache
def _record(name: str) -> Any:
    make: Any = namedtuple
    return make(name, m.row_fields(name))


@dataclass(frozen=True)
class Tables:
    """Kinds of a mechanism's parts, and its topology. Places in f and w count from the start of their stretch.

    recorded: whether all is stored that the record has, not only what steps read.
    """

    parts: Parts
    topology: topologies.Topology
    recorded: bool = False

    def size(self, index: int) -> int:
        """Return a size from the header."""
        return self.topology[0][index]

    @property
    def nq(self) -> int:
        """Number of positions."""
        return self.size(m.NQ)

    @property
    def nv(self) -> int:
        """Number of speeds."""
        return self.size(m.NV)

    @property
    def ny(self) -> int:
        """Length of the state."""
        return self.size(m.NY)

    def table(self, table: Any) -> np.ndarray:
        """Return a table of h with named fields, shape (rows,)."""
        rows = self.topology[1 + m.TABLES["h"].index(table)]
        return m.named(table, np.array(rows, dtype=np.int64))

    def row(self, table: Any, k: int, count: int = 1) -> list[Cell]:
        """Return rows of a table of f or w from row k on."""
        array = SCENE if table in m.TABLES["f"] else WORK
        return cells(array, topologies.start(table.at) + table.size * int(k), table.size * count)

    def record(self, name: str, k: int) -> Any:
        """Return a row of the table `name` of f or w, by the names of its fields."""
        row, fields = self.row(m.NAMED[name], k), m.row_fields(name)
        return _record(name)(*(row[at : at + prod(shape)] if shape else row[at] for at, shape in fields.values()))

    def stretch(self, index: int, first: int, count: int) -> list[Cell]:
        """Return numbers of a stretch of w."""
        return cells(WORK, topologies.start(index) + int(first), count)
