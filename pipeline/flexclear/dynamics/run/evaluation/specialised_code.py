"""Specialised code for the topology of a mechanism: which parts exist, and their addresses.

It is compiled once for all scenes of a topology, and runs faster than a list of calls. Steps of short runs, and of
topologies for which it would be too long, run a list of calls of routines. All other evaluations are lists that store
what the record has. The topology and the number of evaluations decide, so that equal scenes give equal bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions, sources
from flexclear.dynamics.compile.files import PART
from flexclear.dynamics.compile.sources import SPECIALISED
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.specialise.tape import UnsuitedError
from flexclear.dynamics.specialise.topology import Topology, topology_of
from flexclear.system.progress import Progress, silent

if TYPE_CHECKING:
    from flexclear.dynamics.routines.store import ListInstance, LoadedList
    from flexclear.dynamics.run.evaluation.batched_evaluation import LaneGroup, Place

_making = Lock()
#: addresses by parts, topology, lanes, whether exact and whether with changes, for all engines of the process
_known: dict[tuple[Parts, Topology, int, bool, bool], int] = {}


@dataclass
class SpecialisedCode:
    """Code for one topology (`Engine.settle`), shared by the engines of one work array.

    exact: whether one state and several at once must give the same bits.
    worthwhile: whether the present integration is so long that specialised code saves more than it costs.
    place: for stepping together with others; by default each engine takes its own steps.
    group: the group at that place, for the closure rows of its code.
    addresses: of the code, by the closure rows that it solves for.
    lists: of calls of routines, by closure rows and their place in h.  running: these with their own results.
    rows: those for which the present integration has specialised steps.  They belong to one integration, since other
    integrations of this engine must not change a bit of this one.
    """

    exact: bool = False
    worthwhile: bool = False
    place: Place | None = None
    group: LaneGroup | None = None
    addresses: dict[bytes, int] = field(default_factory=dict)
    lists: dict[tuple[bytes, int], LoadedList] = field(default_factory=dict)
    running: dict[tuple[bytes, int], ListInstance] = field(default_factory=dict)
    rows: list[bytes] = field(default_factory=list)

    def begin(self) -> None:
        """Forget what earlier integrations have met."""
        self.rows.clear()
        self.worthwhile = False


def address_for_rows(
    model: Model, h: np.ndarray, code: SpecialisedCode, rows: bytes, progress: Progress = silent
) -> int:
    """Return the address of specialised code for closure rows; 0 when there is none."""
    if rows not in code.addresses:
        code.addresses[rows] = code_address(model, h, rows, progress, exact=code.exact)
    return code.addresses[rows]


def call_list(
    model: Model, h: np.ndarray, code: SpecialisedCode, rows: bytes, progress: Progress = silent, where: int = m.CALLS
) -> ListInstance:
    """Return the list of calls that evaluates a mechanism with closure rows (`mechanics`).

    where: the place in h of its address, of which another list has another one (`mechanics.of_topology`).
    """
    from flexclear.dynamics.mechanics.of_topology import list_of  # here: they import the compiler
    from flexclear.dynamics.routines.store import stored_list

    of = rows, where
    if of not in code.running:
        if of not in code.lists:
            given = model.parts, topology_of(model.arrays, with_selection(model, h, rows)), where
            with _making:
                key, place = repr(given).encode(), where if where in (m.CALLS, m.RECORD_CALLS) else None
                code.lists[of] = stored_list(key, lambda: list_of(*given), partial(progress, None), place)
        code.running[of] = code.lists[of].instance(h)
    return code.running[of]


def lists_in_python(model: Model) -> Callable:
    """Return a function that runs these lists in Python; `where` in h and the part of a list are its address there."""
    from flexclear.dynamics.mechanics.of_topology import mechanism_of
    from flexclear.dynamics.mechanics.responses import LISTS
    from flexclear.dynamics.mechanics.tables import Tables
    from flexclear.dynamics.routines.numbers import Numbers

    known = list[Any]()

    def run(
        h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, y: int, dy: int, address: int
    ) -> None:
        where, part = divmod(int(address), 2 * PART)
        calls = Numbers(h, f, w, n, y, dy)
        if part == 0:
            known[:] = [mechanism_of(Tables(model.parts, topology_of(model.arrays, h)))]
        with calls.building():
            found = LISTS[where][part // PART](known[0], calls, *known[1:])
        known.append(found)
        n[m.EVALUATION] = calls.report

    return run


def evaluated_in_python(model: Model, laws: Callable, where: int = m.RECORD_CALLS) -> Callable:
    """Return a function that Python evaluates in place of a list; laws: evaluates the laws of time."""
    from flexclear.dynamics.mechanics.of_topology import list_of
    from flexclear.dynamics.routines.numbers import Numbers

    def evaluate(h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, y: int, dy: int) -> None:
        laws(h, f, w, n, t)
        calls = Numbers(h, f, w, n, int(y), int(dy))
        list_of(model.parts, topology_of(model.arrays, h), where, calls)
        n[m.EVALUATION], n[m.ABRIDGED], n[m.STATE] = calls.report, int(where == m.CALLS), y

    return evaluate


def with_selection(model: Model, h: np.ndarray, rows: bytes) -> np.ndarray:
    """Return a copy of h with the selection of closure rows."""
    h = h.copy()
    selection.write(model, h, np.frombuffer(rows, dtype=bool))
    return h


def code_address(
    model: Model,
    h: np.ndarray,
    rows: bytes,
    progress: Progress,
    lanes: int = 1,
    *,
    exact: bool = False,
) -> int:
    """Return the address of code for closure rows, with the requested number of lanes; 0 when there is none."""
    parts, changes = model.parts, bool(h[m.N_CHANGES])
    with _making:  # engines may run concurrently
        topology = topology_of(model.arrays, with_selection(model, h, rows))
        key = (parts, topology, lanes, exact, changes)
        if key not in _known:
            if lanes > 1:
                source = sources.source_of_lanes(parts, topology, lanes)
            else:
                source = (
                    sources.source_of_tangents(parts, topology)
                    if changes
                    else sources.source_of_steps(parts, topology, exact=exact)
                )
            try:
                _known[key] = functions.address_of_specialised(SPECIALISED, source, partial(progress, None))
            except UnsuitedError:
                if changes:
                    raise
                _known[key] = 0
        return _known[key]
