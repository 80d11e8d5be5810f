"""Functions and conditions for numbers that may be symbols: on numbers they calculate, on symbols they are recorded.

A condition on symbols is known only when the code runs. It is written `branch`, of which one side is computed, or
`select`, of which both are; Python's own `if`, `and`, `max` ... on a symbol raise an error that names the line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

from flexclear.dynamics.specialise.dual import function_of
from flexclear.dynamics.specialise.tape import FLOAT, Branch, Loop, Symbol, Tape


class UndecidableError(TypeError):
    """Python was to decide by a number that is known only when the code runs."""


def _undecidable(condition: Symbol) -> bool:
    frame = sys._getframe(2)  # of the statement that asked for the truth of the condition
    raise UndecidableError(
        f"{frame.f_code.co_filename}:{frame.f_lineno}: '{condition.operation}' compares numbers that are known only "
        f"when the code runs, so Python cannot decide here; write `branch` or `select` (specialise.symbols)"
    )


def new_tape(longest: int = sys.maxsize) -> Tape:
    """Return an empty tape; longest: most operations."""
    return Tape(_undecidable, longest)


def _function(name: str) -> Callable[..., Any]:
    def apply(*arguments: Any) -> Any:
        one = next((a for a in arguments if isinstance(a, Symbol)), None)
        return function_of(name, *arguments) if one is None else one.tape.write(FLOAT, name, *arguments)

    return apply


sqrt, sin, cos, tan, exp, log, tanh = map(_function, ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh"))
arctan2, nearest, copysign = map(_function, ("arctan2", "round", "copysign"))


def select(condition: Any, a: Any, b: Any) -> Any:
    """Return the number a where the condition holds, else b."""
    return condition.tape.select(condition, a, b) if isinstance(condition, Symbol) else a if condition else b


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two numbers."""
    return select(b > a, b, a)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two numbers."""
    return select(b < a, b, a)


def branch(condition: Any, first: Callable[[], Any], second: Callable[[], Any]) -> Any:
    """Return first() where the condition holds, else second(): nested tuples of numbers of the same shape."""
    if not isinstance(condition, Symbol):
        return first() if condition else second()
    tape, made, ways = condition.tape, Branch(condition, ([], [])), []
    for block, way in zip(made.blocks, (first, second), strict=True):
        with tape.inside(block):
            ways.append(way())
    tape.block.append(made)
    a, b = map(leaves, ways)
    return rebuilt(ways[0], iter([tape.join(made, *both) for both in zip(a, b, strict=True)]))


def repeat(turn: Callable[[Any], tuple[Any, Any]], state: Any) -> Any:
    """Return the state, nested tuples of numbers, after turn(state) -> (condition, state) as long as that holds."""
    symbol = next((one for one in leaves(state) if isinstance(one, Symbol)), None)
    if symbol is None:
        going = True
        while going:
            going, state = turn(state)
        return state
    tape = symbol.tape
    carried = [tape.carry(first) for first in leaves(state)]
    made = Loop(([],), carried)
    with tape.inside(made.blocks[0]):
        made.condition, after = turn(rebuilt(state, iter([one.inside for one in carried])))
    for one, left in zip(carried, leaves(after), strict=True):
        one.left = left
    tape.block.append(made)
    return rebuilt(state, iter([one.after for one in carried]))


def leaves(tree: Any) -> list[Any]:
    """Return what nested tuples and lists hold, in order."""
    if isinstance(tree, (tuple, list)):
        return [leaf for one in tree for leaf in leaves(one)]
    return [tree]


def rebuilt(tree: Any, given: Iterator[Any]) -> Any:
    """Return nested tuples and lists like `tree`, which hold the next values of `given`."""
    if not isinstance(tree, (tuple, list)):
        return next(given)
    parts = [rebuilt(one, given) for one in tree]
    return type(tree)(*parts) if hasattr(tree, "_fields") else type(tree)(parts)


class Indexed:
    """A span in a routine: numbers by their index, an integer or a symbol. load: of the number at an index."""

    __slots__ = ("load",)

    def __init__(self, load: Callable[[Any], Any]) -> None:
        self.load = load

    def __getitem__(self, index: Any) -> Any:
        return self.load(index)
