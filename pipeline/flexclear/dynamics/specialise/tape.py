"""Tape of a computation: arithmetic on symbols records its operations.

The tape is a tree of blocks: operations in their order, branches, each with two blocks and their joined results, and
loops, each with its repeated block.
Equal operations are recorded once, and those that the topology makes trivial (times zero, plus zero) not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

#: kinds of values: float64, int64, bit
FLOAT, INTEGER, BIT = "float", "integer", "bit"
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


class UnsuitedError(Exception):
    """Straight code for a topology is impossible or would not be faster."""


class Undecided(Exception):  # noqa: N818  (not an error: how a branch leaves the function that met it)
    """A branch that depends on a symbol."""

    def __init__(self, condition: Symbol) -> None:
        super().__init__()
        self.condition = condition


def _operator(name: str, *, reflected: bool = False) -> Callable[[Any, Any], Any]:
    """Return an operator of symbols, which their tape records; reflected: the symbol is the second operand."""

    def apply(self: Symbol, other: Any) -> Any:
        if isinstance(other, tuple):  # a vector, whose own operators multiply each entry
            return NotImplemented
        return getattr(self.tape, name)(other, self) if reflected else getattr(self.tape, name)(self, other)

    return apply


def _comparison(name: str) -> Callable[[Any, Any], Any]:
    def apply(self: Symbol, other: Any) -> Any:
        return self.tape.write(BIT, name, self, other)

    return apply


@dataclass(frozen=True, eq=False, slots=True)
class Symbol:
    """A value that is known only when the code runs: an operation with its arguments.

    number: in order of creation; it orders operands, so that equal topologies give equal code.
    """

    tape: Tape
    number: int
    kind: str
    operation: str
    arguments: tuple[Any, ...]

    __add__, __radd__ = _operator("add"), _operator("add", reflected=True)
    __sub__, __rsub__ = _operator("subtract"), _operator("subtract", reflected=True)
    __mul__, __rmul__ = _operator("multiply"), _operator("multiply", reflected=True)
    __truediv__, __rtruediv__ = _operator("divide"), _operator("divide", reflected=True)
    __and__ = __rand__ = _operator("both")
    __le__, __gt__, __ge__ = _comparison("<="), _comparison(">"), _comparison(">=")
    __eq__, __ne__ = _comparison("=="), _comparison("!=")
    __hash__ = object.__hash__

    def __pow__(self, other: Any) -> Any:
        square = not isinstance(other, Symbol) and other == 2
        return self.tape.multiply(self, self) if square else self.tape.write(FLOAT, "pow", self, other)

    def __neg__(self) -> Any:
        return self.tape.negate(self)

    def __abs__(self) -> Any:
        return self.tape.write(FLOAT, "fabs", self)

    def __lt__(self, other: Any) -> Any:
        never = self.operation == "fabs" and not isinstance(other, Symbol) and other == 0.0
        return False if never else self.tape.write(BIT, "<", self, other)

    def __bool__(self) -> bool:
        return self.tape.decide(self)


@dataclass
class Branch:
    """Two blocks of which one runs; joins: their results, (symbol afterwards, value of the first, of the second)."""

    condition: Symbol
    blocks: tuple[list[Any], list[Any]]
    joins: list[tuple[Symbol, Any, Any]] = field(default_factory=list)


@dataclass
class Carried:
    """A value that a loop updates: symbols in the block and after the loop, first value, and value of each turn."""

    inside: Symbol
    after: Symbol
    first: Any
    left: Any = None


@dataclass
class Loop:
    """A block that runs once, and again as long as the condition that it computes holds."""

    blocks: tuple[list[Any]]
    carried: list[Carried]
    condition: Any = False


class Tape:
    """Recorded operations; `block` receives the next operation."""

    def __init__(self, decide: Callable[[Symbol], bool], longest: int) -> None:
        self.decide, self.longest, self.count = decide, longest, 0
        self.block: list[Any] = []
        #: known: recorded operations by their key; scopes: keys that were added in each open block
        self._known: dict[Any, Symbol] = {}
        self._scopes: list[list[Any]] = [[]]

    def write(self, kind: str, operation: str, *arguments: Any) -> Symbol:
        """Return the symbol of an operation; record the operation if it is new."""
        key = (operation, *(id(a) if isinstance(a, Symbol) else (type(a), a) for a in arguments))
        symbol = self._known.get(key)
        if symbol is None:
            symbol = self._known[key] = self._symbol(kind, operation, arguments)
            self._scopes[-1].append(key)
            self.block.append(symbol)
            if self.count > self.longest:
                raise UnsuitedError("the computation is too long")
        return symbol

    def _symbol(self, kind: str, operation: str, arguments: tuple[Any, ...]) -> Symbol:
        self.count += 1
        return Symbol(self, self.count, kind, operation, arguments)

    def add(self, a: Any, b: Any) -> Any:
        """Return the sum."""
        if not isinstance(a, Symbol):
            a, b = b, a
        if not isinstance(b, Symbol) and b == 0:
            return a
        if INTEGER in (a.kind, getattr(b, "kind", FLOAT)):
            return self.write(INTEGER, "iadd", a, b)
        if _negative(b):
            return self.subtract(a, b.arguments[0])
        if _negative(a):
            return self.subtract(b, a.arguments[0])
        return self.write(FLOAT, "add", *_in_order(a, b))

    def subtract(self, a: Any, b: Any) -> Any:
        """Return the difference."""
        if not isinstance(a, Symbol) and a == 0:
            return self.negate(b)
        if not isinstance(b, Symbol) and b == 0:
            return a
        if a is b:
            return 0.0
        if _negative(b):
            return self.add(a, b.arguments[0])
        if _negative(a):
            return self.negate(self.add(a.arguments[0], b))
        return self.write(FLOAT, "sub", a, b)

    def negate(self, a: Any) -> Any:
        """Return minus a."""
        if not isinstance(a, Symbol):
            return -a
        if _negative(a):
            return a.arguments[0]
        if a.operation == "sub":
            return self.write(FLOAT, "sub", a.arguments[1], a.arguments[0])
        return self.write(FLOAT, "neg", a)

    def multiply(self, a: Any, b: Any) -> Any:
        """Return the product."""
        if not isinstance(a, Symbol):
            a, b = b, a
        if not isinstance(b, Symbol):
            if a.kind == INTEGER:
                return self.write(INTEGER, "imul", a, b)
            if b == 0:
                return 0.0
            if b == 1:
                return a
            if b == -1:
                return self.negate(a)
        if _negative(a):
            return self.negate(self.multiply(a.arguments[0], b))
        if _negative(b):
            return self.negate(self.multiply(a, b.arguments[0]))
        return self.write(FLOAT, "mul", *_in_order(a, b))

    def divide(self, a: Any, b: Any) -> Any:
        """Return the quotient, by a reciprocal that other quotients may reuse."""
        if not isinstance(b, Symbol):
            return self.multiply(a, 1.0 / b)
        if _negative(b):
            return self.negate(self.divide(a, b.arguments[0]))
        return self.multiply(self.write(FLOAT, "reciprocal", b), a)

    def both(self, a: Any, b: Any) -> Any:
        """Return True, or a symbol, when both conditions hold."""
        if not isinstance(a, Symbol):
            return b if a else False
        if not isinstance(b, Symbol):
            return a if b else False
        return self.write(BIT, "and", a, b)

    def select(self, condition: Any, a: Any, b: Any) -> Any:
        """Return the first value where the condition holds, else the second; both have been computed."""
        if not isinstance(condition, Symbol):
            return a if condition else b
        return a if same(a, b) else self.write(kind_of(a), "select", condition, a, b)

    # Branches ----------------------------------------------------------------------------------------------------

    @contextmanager
    def inside(self, block: list[Any]) -> Iterator[None]:
        """Record into a block; operations recorded there are unknown outside."""
        before, self.block = self.block, block
        self._scopes.append([])
        try:
            yield
        finally:
            self.block = before
            for key in self._scopes.pop():
                del self._known[key]

    def carry(self, first: Any) -> Carried:
        """Return the symbols for a loop's value that is `first` before the loop."""
        inside, after = (self._symbol(kind_of(first), "carried", ()) for _ in range(2))
        return Carried(inside, after, first)

    def join(self, branch: Branch, a: Any, b: Any) -> Any:
        """Return the value after a branch that is a after its first block and b after its second."""
        if same(a, b):
            return a
        joined = self._symbol(kind_of(a), "join", ())
        branch.joins.append((joined, a, b))
        return joined


def _negative(a: Any) -> bool:
    return isinstance(a, Symbol) and a.operation == "neg"


def _in_order(a: Any, b: Any) -> tuple[Any, Any]:
    return (a, b) if not isinstance(b, Symbol) or a.number <= b.number else (b, a)


def same(a: Any, b: Any) -> bool:
    """Return True for the same symbol or equal numbers."""
    if isinstance(a, Symbol) or isinstance(b, Symbol):
        return a is b
    return bool(a == b)


def kind_of(a: Any) -> str:
    """Return the kind of a symbol or number."""
    if isinstance(a, Symbol):
        return a.kind
    return BIT if isinstance(a, bool) else INTEGER if isinstance(a, int) else FLOAT
