"""Topology of a mechanism as its specialised code depends on it, without all that the code does not depend on.

It has sizes and tables of h, without those that only laws of time and error norms read. Offsets in w and
f are excluded: code identifies work arrays by their index in the header, so that one code serves every integrator and
any number of pieces of laws.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m

if TYPE_CHECKING:
    from flexclear.dynamics.model.arrays import Arrays

#: sizes of the header, then the rows of each table of h
Topology = tuple[tuple[int, ...], ...]
#: tables that only laws of time and error norms read
LEFT_OUT = (m.LAWS, m.PIECE_HARMONICS, m.GROUPS)
SIZES = m.ADDRESSES[0]
#: bits of an index for the position in a work array; higher bits number the array, 0 for the array h, f, w or n itself
STRETCH = 40
#: arrays of w that arguments give: the state and its rates, and small changes of both
STATE, RATES, STATE_CHANGE, RATES_CHANGE = range(m.HEADER + 1, m.HEADER + 5)


def topology_of(arrays: Arrays, h: np.ndarray) -> Topology:
    """Return the topology in h, with the closure rows that its selection keeps."""
    sizes = h[:SIZES].copy()
    sizes[[m.N_GROUPS, m.N_CHANGES, m.F_CHANGE, m.W_CHANGE]] = 0
    sizes[m.NY] = sizes[m.NQ] + sizes[m.NV] + sizes[m.N_LEDGER]  # without changes
    tables = []
    for table in m.TABLES["h"]:
        rows = arrays.table(table, h).view(np.int64).reshape(-1, table.size)
        tables.append(() if table in LEFT_OUT else tuple(rows.ravel().tolist()))
    return (tuple(sizes.tolist()), *tables)


def stretch_and_offset(index: Any) -> tuple[Any, Any]:
    """Return the header index of a work array, -1 for h, f, w or n itself, and the position in the array.

    index: an integer or an array of such.
    """
    return (index >> STRETCH) - 1, index & ((1 << STRETCH) - 1)


def start(stretch: int) -> int:
    """Return the index of the first entry of a work array."""
    return (stretch + 1) << STRETCH


def base_and_offset(index: Any) -> tuple[int, Any] | None:
    """Return the first entry of a work array, and the symbol that is added, for an index that is known when code runs.

    None for an index that is a number, or counts from the begin of h, f, w or n itself.
    """
    if getattr(index, "operation", "") != "iadd":
        return None
    first, second = index.arguments
    return (second, first) if isinstance(second, int) and second >> STRETCH else None
