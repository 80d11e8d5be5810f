"""Straight code: all calls of a list on one tape, of which nothing is stored but what is asked for.

It serves what is short, several states at once, and tangents. The tape names numbers by their stretch
(`specialise.program`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from flexclear.dynamics import memory as m
from flexclear.dynamics.routines.calls import (
    MODES,
    RATES,
    RESULTS,
    SCENE,
    STATE,
    CallList,
    Cell,
    Span,
    inline,
    separate_stored,
)
from flexclear.dynamics.specialise import symbols
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.symbols import Indexed, leaves, new_tape, rebuilt
from flexclear.dynamics.specialise.tape import FLOAT, INTEGER


class OneTape(CallList):
    """A list whose calls are recorded one after the other. longest: most operations."""

    number: ClassVar[type] = int

    def __init__(self, longest: int) -> None:
        super().__init__()
        self._tape, self._stored = new_tape(longest), dict[tuple[str, int], tuple[Cell, Any]]()

    def call(self, function: Callable, arguments: Any, into: Sequence[Cell] | None = None) -> Any:
        """Record a call and return its results; without the first of several, if cells are given to store that."""
        with inline():
            given = [self._loaded(one) if type(one) in (Cell, Span) else one for one in leaves(arguments)]
            first, rest = separate_stored(function(*rebuilt(arguments, iter(given))), into)
        self._stored |= {cell.key: (cell, value) for cell, value in zip(into or (), leaves(first), strict=True)}
        return rest

    @staticmethod
    def located(numbers: Sequence[Any], stride: int = 1) -> list[Any]:
        """Return the numbers."""
        return list(numbers)

    def repeat(self, turn: Callable[[Any], tuple[Any, Any]], state: Any) -> Any:
        """Record a loop, and return the state after it."""

        def again(state: Any) -> tuple[Any, Any]:
            goes_on, after = turn(state)
            return goes_on > 0.5, after

        return symbols.repeat(again, state)

    def _loaded(self, cell: Cell | Span) -> Any:
        if isinstance(cell, Span):
            array, first = _array_and_index(cell)
            return Indexed(lambda index: self._tape.write(FLOAT, "load", array, first + index))
        if cell.key in self._stored:
            return self._stored[cell.key][1]
        if cell.array == RESULTS:
            return 0.0
        if cell.array == MODES:
            return self._tape.write(INTEGER, "load", "n", self._tape.write(INTEGER, "load", "n", m.MODE) + cell.index)
        return self._tape.write(FLOAT, "load", *_array_and_index(cell))

    @property
    def program(self) -> Program:
        """The program of all calls."""
        kept = [one for one in self._stored.values() if one[0].array != RESULTS or one[0].index == 0]
        stores = [(*_array_and_index(cell), value) for cell, value in kept]
        return Program(self._tape.block, [*stores, ("n", m.ABRIDGED, 1)])


def _array_and_index(cell: Cell | Span) -> tuple[str, int]:
    """Return array and index of a number."""
    if cell.array == RESULTS:
        return "n", m.EVALUATION
    if cell.array in (STATE, RATES):
        return "w", topologies.start(topologies.STATE if cell.array == STATE else topologies.RATES) + cell.index
    return "f" if cell.array == SCENE else "w", cell.index
