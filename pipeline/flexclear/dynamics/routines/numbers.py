"""Calls done at once, on numbers in memory, which may carry their changes (`specialise.dual`): no compiler is needed.

An evaluation takes milliseconds, a thousand times as long as compiled code: enough for a start or a tangent, not for a
run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from flexclear.dynamics import memory as m
from flexclear.dynamics.routines.calls import (
    MODES,
    RATES,
    RESULTS,
    SCENE,
    STATE,
    WORK,
    CallList,
    Cell,
    Span,
    inline,
    separate_stored,
)
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.dual import product
from flexclear.dynamics.specialise.symbols import Indexed, leaves, rebuilt


class Numbers(CallList):
    """A list of calls that are not kept: each is done when it is appended.

    Its numbers are those of NumPy, which divide by zero as compiled code does.  report: the first result.
    """

    def __init__(self, h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, y: int, dy: int) -> None:
        super().__init__()
        self._h, self._report = h, np.zeros(1)
        self._arrays = {SCENE: f, WORK: w, STATE: w[y:], RATES: w[dy:], RESULTS: self._report, MODES: n[n[m.MODE] :]}

    def call(self, function: Callable, arguments: Any, into: Sequence[Cell] | None = None) -> Any:
        """Return the results of a call; without the first of several, if cells are given to store that."""
        given = [self._read(one) if type(one) in (Cell, Span) else one for one in leaves(arguments)]
        with inline():
            first, rest = separate_stored(function(*rebuilt(arguments, iter(given))), into)
        for cell, value in zip(into or (), leaves(first), strict=True):
            self._arrays[cell.array][self._place(cell)] = value
        return rest

    def products(
        self, first: Cell, stride: int, entries: Sequence[np.ndarray], vectors: Sequence[Sequence[Any]], count: int
    ) -> list[list[Any]]:
        """Return the products of vectors and a matrix."""
        (rows, columns, numbers), begin = entries, self._place(first)
        values = self._arrays[first.array][begin + stride * numbers]
        given = [[self._read(one) if isinstance(one, Cell) else one for one in vector] for vector in vectors]
        matrix = csr_array((values, (rows, columns)), shape=(count, len(given[0])))
        return [product(matrix, vector) for vector in given]

    def repeat(self, turn: Callable[[Any], tuple[Any, Any]], state: Any) -> Any:
        """Return the state after a loop."""
        goes_on: Any = 1.0
        while goes_on > 0.5:
            goes_on, state = turn(state)
        return state

    def _read(self, one: Cell | Span) -> Any:
        array, first = self._arrays[one.array], self._place(one)
        return Indexed(lambda index: array[first + index]) if isinstance(one, Span) else array[first]

    def _place(self, cell: Cell | Span) -> int:
        stretch, inside = topologies.stretch_and_offset(cell.index)
        return int(inside if stretch < 0 else self._h[stretch] + inside)

    @property
    def rates(self) -> np.ndarray:
        """Rates of the state, and what follows them in memory."""
        return self._arrays[RATES]

    @property
    def report(self) -> int:
        """Return what the list reports of its evaluation."""
        return int(self._report[0])
