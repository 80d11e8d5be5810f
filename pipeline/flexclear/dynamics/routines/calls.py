"""Routines, and lists of their calls.

A *routine* is a Python function of numbers in nested tuples (vectors, matrices, objects with named fields) and of
strings or integers, on which its code depends. Called with numbers it calculates; called by another routine it is a
part of that one. Called while a `CallList` is built, on numbers in memory, it is traced on a tape, once per *kind* of
its arguments: which of them are constant, and which are adjacent in memory. The call becomes an entry of the list: the
code with the offset of each run of adjacent numbers. So a list is data, however long; equal kinds share one code, and
numbers of the scene are read when the list runs. Results are numbers in memory, each of a place of its own; a result
that is the same constant for each call of a kind stays a constant, and one that is an argument stays where it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cached_property, wraps
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.symbols import Indexed, leaves, new_tape, rebuilt
from flexclear.dynamics.specialise.tape import FLOAT, INTEGER, Branch, Loop, Symbol

#: numbers of the scene, the state, its rates, the work space of the engine, the results of the list's own calls, and
#: the modes of the contacts, which are integers
SCENE, STATE, RATES, WORK, RESULTS, MODES = ARRAYS = "f", "y", "dy", "w", "v", "modes"


class Cell:
    """A number in memory; it has no operators, so only routines calculate with it."""

    __slots__ = ("array", "index", "key")

    def __init__(self, array: str, index: int) -> None:
        self.array, self.index, self.key = array, index, (array, index)


class Span:
    """Adjacent numbers in memory, of which a routine reads some at indices that are known only when the code runs."""

    __slots__ = ("array", "index")

    def __init__(self, array: str, index: int) -> None:
        self.array, self.index = array, index


class Code(NamedTuple):
    """A traced routine: name, operations, and the array of each run of adjacent numbers that a call locates.

    Loads and stores name the run by its number, as text, with the offset in it.
    """

    name: str
    program: Program
    runs: tuple[str, ...]

    @property
    def digest(self) -> bytes:
        """Digest of all that the machine code depends on."""
        return hashlib.sha256(repr((self.runs, *_describe(self.program))).encode()).digest()


class _Kind(NamedTuple):
    """A routine traced for a kind of arguments: its results, and where each is: given, constant or stored."""

    code: Code
    result: Any
    places: list[tuple[str, Any]]
    stored: int


class Call(NamedTuple):
    """An entry of a list: a code, and the offset of each of its runs."""

    code: Code
    offsets: tuple[int, ...]


#: goes back by as many entries as its second offset says, if the number at its first one exceeds one half
BACK = Code("back", Program([], []), (RESULTS,))

#: most products of a row, and most rows, of a call
MOST, TOGETHER = 16, 4

_building: ContextVar[CallList | None] = ContextVar("building", default=None)


@contextmanager
def inline() -> Iterator[None]:
    """Let routines be parts of what calls them during the context; numbers may be infinite, as in compiled code."""
    token = _building.set(None)
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        _building.reset(token)


def routine(function: Callable) -> Callable:
    """Make a function a routine."""

    @wraps(function)
    def called(*arguments: Any) -> Any:
        calls = _building.get()
        return function(*arguments) if calls is None else calls.call(function, arguments)

    return called


@dataclass
class CallList:
    """A list of calls under construction.

    size: number of results in memory; the first one is kept free, for what the list reports, as a `number`.  ends: of
    parts, which run one by one, with the results of those before.
    """

    number: ClassVar[type] = float
    calls: list[Call] = field(default_factory=list)
    size: int = 1
    ends: list[int] = field(default_factory=list)
    _kinds: dict[Any, _Kind] = field(default_factory=dict)
    _known: dict[Any, Any] = field(default_factory=dict)

    @contextmanager
    def building(self) -> Iterator[CallList]:
        """Append the calls of routines to the list during the context."""
        token = _building.set(self)
        try:
            yield self
        finally:
            _building.reset(token)

    def divide(self) -> None:
        """End a part of the list."""
        self.ends.append(len(self.calls))

    @cached_property
    def codes(self) -> list[Code]:
        """Codes that the finished list calls, in the order of their first calls."""
        return list({id(call.code): call.code for call in self.calls}.values())

    def call(self, function: Callable, arguments: Any, into: Sequence[Cell] | None = None) -> Any:
        """Append a call and return its results; without the first of several, if cells are given to store that."""
        runs = _Runs()
        given = leaves(arguments)
        places: dict[type, Callable[[Any], Any]] = {Cell: runs.at, Span: runs.span}
        inside = [places[type(one)](one) if type(one) in places else one for one in given]
        targets = None if into is None else tuple(runs.at(cell) for cell in into)
        kind = (function, _shape(arguments), tuple(inside), targets, tuple(runs.arrays))
        if kind not in self._kinds:
            self._kinds[kind] = _trace(function, arguments, inside, targets, tuple(runs.arrays))
        made, where = self._kinds[kind], tuple(runs.begins)
        known = self._known.get((id(made), where))
        if known is not None:
            return known
        if made.stored or into:
            self.calls.append(Call(made.code, (*where, self.size)))
        base = self.size
        self.size += made.stored
        ways = {"given": given.__getitem__, "constant": lambda a: a, "stored": lambda k: Cell(RESULTS, base + k)}
        result = rebuilt(made.result, iter([ways[way](value) for way, value in made.places]))
        self._known[id(made), where] = result
        return result

    def store(self, cells: Sequence[Cell], function: Callable, *arguments: Any) -> Any:
        """Append a call of a routine, the first of whose results is stored in cells, and return the others."""
        return self.call(function.__wrapped__, arguments, cells)  # type: ignore[attr-defined]

    def write(self, cells: Sequence[Cell], values: Sequence[Any]) -> None:
        """Append a call that stores values in cells."""
        if cells:
            self.call(_same, (list(values),), cells)

    @staticmethod
    def located(numbers: Sequence[Any], stride: int = 1) -> list[Any]:
        """Return numbers as what locates each alone, whatever is adjacent, so that calls are of few kinds; only the
        first one, where the others follow it at a stride."""
        alone = [Span(one.array, one.index) if isinstance(one, Cell) else one for one in numbers]
        follow = (
            isinstance(b, Span) and b.index - a.index == stride for a, b in pairwise(alone) if isinstance(a, Span)
        )
        return alone[:1] if sum(follow) == len(alone) - 1 else alone

    def products(
        self, first: Cell, stride: int, entries: Sequence[np.ndarray], vectors: Sequence[Sequence[Any]], count: int
    ) -> list[list[Any]]:
        """Append calls that multiply vectors by a sparse matrix of `count` rows, whose numbers are in memory.

        first, stride: place of its first number, and from one to the next.  entries: row, ascending, column, and which
        number it is, of each.
        """
        sums = [cells(RESULTS, self.size + k * count, count) for k in range(len(vectors))]
        self.size += len(vectors) * count  # they are zero as long as nothing is stored
        ends, alike = np.flatnonzero(np.diff(entries[0], append=-1)) + 1, dict[tuple[int, ...], list[Any]]()
        for begin, end in pairwise([0, *ends.tolist()]):
            row, columns, numbers = (one[begin:end].tolist() for one in entries)
            values = [Cell(first.array, first.index + stride * number) for number in numbers]
            alike.setdefault(tuple(columns), []).append(([one[row[0]] for one in sums], values))
        for columns, rows in alike.items():
            full = len(rows) - len(rows) % TOGETHER
            groups = [rows[k : k + TOGETHER] for k in range(0, full, TOGETHER)] + [[one] for one in rows[full:]]
            for k in range(0, len(columns), MOST):
                part = slice(k, min(k + MOST, len(columns)))
                given = [self.located([vector[one] for one in columns[part]]) for vector in vectors]
                for group in groups:
                    factors = [self.located(numbers[part], stride) for _, numbers in group]
                    places = [place for place, _ in group]
                    before = places if k else [[0.0] * len(sums)] * len(group)
                    self.call(_add_products, (part.stop - k, stride, before, factors, given), leaves(places))
        return sums

    def repeat(self, turn: Callable[[Any], tuple[Any, Any]], state: Any) -> Any:
        """Append calls of a loop, and return the state after it: nested tuples of numbers.

        turn(state) -> (number, state) has one more turn where the number exceeds one half.
        """
        places = cells(RESULTS, self.size, len(leaves(state)))
        self.size += len(places)
        self.write(places, leaves(state))
        present, begin, known = rebuilt(state, iter(places)), len(self.calls), self._known.copy()
        goes_on, after = turn(present)
        self.write(places, leaves(after))
        self.calls.append(Call(BACK, (goes_on.index, len(self.calls) - begin)))
        self._known = known  # what the loop has computed is of an earlier state
        return present


def products(*given: Any) -> list[list[Any]]:
    """Append calls to the list that is under construction; see `CallList.products`."""
    calls = _building.get()
    assert calls is not None
    return calls.products(*given)


def _same(values: Any) -> Any:
    return (values,)


def _add_products(
    count: int,
    stride: int,
    sums: Sequence[Sequence[Any]],
    rows: Sequence[Sequence[Any]],
    vectors: Sequence[Sequence[Any]],
) -> tuple[Any]:
    """Return sums, of each row for each vector, with the products of numbers; see `CallList.products`."""
    entries = [[_number_at(vector, k, 1) for k in range(count)] for vector in vectors]
    made = list[Any]()
    for before, row in zip(sums, rows, strict=True):
        numbers = [_number_at(row, k, stride) for k in range(count)]
        for one, vector in zip(before, entries, strict=True):
            made.append(sum((a * x for a, x in zip(numbers, vector, strict=True)), one))
    return (made,)


def _number_at(numbers: Sequence[Any], k: int, stride: int) -> Any:
    """Return a number that is located alone, or by the first one."""
    one = numbers[min(k, len(numbers) - 1)]
    return one[stride * k if len(numbers) == 1 else 0] if isinstance(one, Indexed) else one


def cells(array: str, begin: int, count: int) -> list[Cell]:
    """Return adjacent numbers of an array."""
    return [Cell(array, begin + k) for k in range(count)]


class _Runs:
    """Runs of adjacent numbers among the arguments of a call, each with its array, first index and length."""

    def __init__(self) -> None:
        self.arrays, self.begins, self._ends = list[str](), list[int](), list[int]()
        self._seen: dict[tuple[str, int], Argument] = {}

    def at(self, cell: Cell) -> Argument:
        """Return a number's run, as text, and its offset there."""
        if cell.key not in self._seen:
            if not self.arrays or (self.arrays[-1], self._ends[-1]) != (cell.array, cell.index):
                self.arrays.append(cell.array)
                self.begins.append(cell.index)
                self._ends.append(cell.index)
            self._ends[-1] += 1
            self._seen[cell.key] = Argument(str(len(self.arrays) - 1), cell.index - self.begins[-1])
        return self._seen[cell.key]

    def span(self, span: Span) -> Run:
        """Return the run of a span, which no other number joins."""
        self.arrays.append(span.array)
        self.begins.append(span.index)
        self._ends.append(-1)
        return Run(str(len(self.arrays) - 1))


class Run(NamedTuple):
    """An argument that is a span: its run."""

    run: str


class Argument(NamedTuple):
    """An argument that is a symbol on the tape of a routine: its run and the offset there."""

    run: str
    offset: int


def _trace(
    function: Callable, arguments: Any, inside: list[Any], into: Sequence[Argument] | None, runs: tuple[str, ...]
) -> _Kind:
    """Trace a routine; inside: its numbers, symbolic ones by their run."""
    tape = new_tape()

    def read(one: Any) -> Any:
        if isinstance(one, Run):
            return Indexed(lambda index: tape.write(FLOAT, "load", one.run, index))
        kind = INTEGER if isinstance(one, Argument) and runs[int(one.run)] == MODES else FLOAT
        return tape.write(kind, "load", *one) if isinstance(one, Argument) else one

    symbols = [read(one) for one in inside]
    with inline():
        result = function(*rebuilt(arguments, iter(symbols)))
    first, rest = separate_stored(result, into)
    stores = [(one.run, one.offset, value) for one, value in zip(into or (), leaves(first), strict=True)]
    given = {id(one): k for k, one in enumerate(symbols) if isinstance(one, Symbol)}
    places, slots = list[tuple[str, Any]](), dict[Symbol, int]()
    for value in leaves(rest):
        if not isinstance(value, Symbol):
            places.append(("constant", value))
        elif id(value) in given:
            places.append(("given", given[id(value)]))
        else:
            places.append(("stored", slots.setdefault(value, len(slots))))
    stores += [(str(len(runs)), slot, value) for value, slot in slots.items()]
    code = Code(function.__name__.lstrip("_"), Program(tape.block, stores), (*runs, RESULTS))
    return _Kind(code, rest, places, len(slots))


def separate_stored(result: Any, into: Sequence[Any] | None) -> tuple[Any, Any]:
    """Return what is stored in given places, the first of several results, if there are such places, and the others."""
    if into is None:
        return (), result
    return result[0], result[1] if len(result) == 2 else result[1:]


def _shape(tree: Any) -> Any:
    """Return the nesting of arguments without their numbers."""
    if isinstance(tree, (tuple, list)):
        return (type(tree), *map(_shape, tree))
    return None


def _describe(program: Program) -> Iterator[Any]:
    """Yield operations and stores of a program, with symbols by their order."""
    numbers: dict[Symbol, int] = {}

    def name(a: Any) -> Any:
        return f"%{numbers[a]}" if isinstance(a, Symbol) else a

    def block(items: list[Any]) -> Iterator[Any]:
        for item in items:
            if isinstance(item, Branch):
                yield "branch", name(item.condition)
                for inner in item.blocks:
                    yield from block(inner)
                    yield "end"
                for joined, *both in item.joins:
                    numbers[joined] = len(numbers)
                    yield "join", joined.kind, *map(name, both)
            elif isinstance(item, Loop):
                yield "loop", *(name(one.first) for one in item.carried)
                for one in item.carried:
                    numbers[one.inside] = len(numbers)
                yield from block(item.blocks[0])
                yield "left", name(item.condition), *(name(one.left) for one in item.carried)
                for one in item.carried:
                    numbers[one.after] = len(numbers)
            else:
                numbers[item] = len(numbers)
                yield item.kind, item.operation, *map(name, item.arguments)

    yield from block(program.block)
    yield from ((run, offset, name(value)) for run, offset, value in program.stores)
