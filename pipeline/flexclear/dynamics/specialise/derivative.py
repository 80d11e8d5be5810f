r"""Exact derivative of a tape along a direction: each operation is followed by its effect on small changes.

For an operation :math:`z = \varphi(x, y)` the tangent is :math:`\dot z = \varphi_x\dot x + \varphi_y\dot y`. Branches
differentiate the way that is taken; the root of zero, which has no derivative, gives zero. Loops repeat with their
changes: the last iteration of Newton's method, from a converged value, leaves
:math:`-F_x^{-1} F_p\dot p`, the derivative of the implicit function. A change of the state is in
w like the state; changes of the numbers f, of the laws of time and of impact rates are in `df` and `dw`, arranged as f
and w are. `dw` also receives the changes of values stored next to the rates.

Source: Griewank & Walther, *Evaluating Derivatives*, 2nd ed. (2008), sec. 3.1.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.rules import RULES
from flexclear.dynamics.specialise.tape import FLOAT, Branch, Loop, Symbol, Tape, Undecided

#: largest number of operations of a tangent per operation of its tape
LONGEST_TANGENT = 8
#: work arrays in w, besides the state, with given changes
GIVEN = {m.LAW.at, m.LATCHED}
#: work arrays in w, besides the rates, with stored changes
STORED = {m.TOUCH.at}


def tangent(program: Program, longest: int) -> Program:
    """Return the program that computes `program` and its tangent.

    longest: most operations of a program without tangent.  Raises UnsuitedError where the result is too long.
    """
    forward = _Forward(longest * LONGEST_TANGENT)
    forward.block(program.block)
    stores = [(array, forward.value(index), forward.value(value)) for array, index, value in program.stores]
    changes = list[tuple[str, Any, Any]]()
    for array, index, value in program.stores:
        stretch, inside = topologies.stretch_and_offset(index) if array == "w" else (-1, 0)
        if stretch == topologies.RATES:
            changes.append(("w", topologies.start(topologies.RATES_CHANGE) + inside, forward.change(value)))
        elif stretch in STORED:
            changes.append(("dw", index, forward.change(value)))
    return Program(forward.tape.block, [*stores, *changes])


def _seed(tape: Tape, array: str, index: Any) -> Any:
    """Return the change of a value loaded from an array."""
    if array == "f":
        return tape.write(FLOAT, "load", "df", index)
    if array == "w" and not isinstance(index, Symbol):
        stretch, inside = topologies.stretch_and_offset(index)
        if stretch == topologies.STATE:
            return tape.write(FLOAT, "load", "w", topologies.start(topologies.STATE_CHANGE) + inside)
        if stretch in GIVEN:
            return tape.write(FLOAT, "load", "dw", index)
    return 0.0


class _Forward:
    """Copies a tape with its tangents; `values` and `changes` are by symbols of the original tape."""

    def __init__(self, longest: int) -> None:
        self.tape = Tape(_undecided, longest)
        self.values, self.changes = dict[Symbol, Any](), dict[Symbol, Any]()

    def value(self, a: Any) -> Any:
        """Return an argument's symbol on the new tape."""
        return self.values[a] if isinstance(a, Symbol) else a

    def change(self, a: Any) -> Any:
        """Return the change of an argument, 0.0 for numbers."""
        return self.changes.get(a, 0.0) if isinstance(a, Symbol) else 0.0

    def block(self, items: list[Any]) -> None:
        """Write a block with its tangents."""
        for item in items:
            if isinstance(item, Branch):
                self._branch(item)
            elif isinstance(item, Loop):
                self._loop(item)
            else:
                self._operation(item)

    def _branch(self, old: Branch) -> None:
        new = Branch(self.value(old.condition), ([], []))
        for block, items in zip(new.blocks, old.blocks, strict=True):
            with self.tape.inside(block):
                self.block(items)
        self.tape.block.append(new)
        for joined, *ways in old.joins:
            self.values[joined] = self.tape.join(new, *map(self.value, ways))
            if joined.kind == FLOAT:
                self.changes[joined] = self.tape.join(new, *map(self.change, ways))

    def _loop(self, old: Loop) -> None:
        kept = [(one, self.values, self.value) for one in old.carried]
        kept += [(one, self.changes, self.change) for one in old.carried if one.inside.kind == FLOAT]
        new = Loop(([],), [self.tape.carry(of(one.first)) for one, _, of in kept])
        for (one, known, _), copy in zip(kept, new.carried, strict=True):
            known[one.inside], known[one.after] = copy.inside, copy.after
        with self.tape.inside(new.blocks[0]):
            self.block(old.blocks[0])
        for (one, _, of), copy in zip(kept, new.carried, strict=True):
            copy.left = of(one.left)
        new.condition = self.value(old.condition)
        self.tape.block.append(new)

    def _operation(self, s: Symbol) -> None:
        arguments = tuple(map(self.value, s.arguments))
        value = self.values[s] = self.tape.write(s.kind, s.operation, *arguments)
        if s.kind != FLOAT:
            return
        if s.operation == "load":
            self.changes[s] = _seed(self.tape, *arguments)
            return
        changes = tuple(map(self.change, s.arguments))
        nothing = all(not isinstance(change, Symbol) and change == 0.0 for change in changes)
        self.changes[s] = 0.0 if nothing else RULES[s.operation](self.tape, value, arguments, changes)


def _undecided(condition: Symbol) -> bool:
    raise Undecided(condition)  # no rule requests a decision
