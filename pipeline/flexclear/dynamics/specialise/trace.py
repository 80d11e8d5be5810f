"""Tracing: kernels run in Python on symbols, so that a tape holds their operations for one topology.

Sizes, offsets and tables of h are numbers, so loop counts and indices are known while the tape is written; w and f
hold symbols. A branch that depends on a symbol is run both ways, up to the end of its kernel, and
the results of both ways are joined. Kernels called before the branch are not run again; their stores are
repeated. A kernel that is called until it has converged (`choice.repeat`) is run on symbols for all values that it
passes to its next call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics.choice import repeat
from flexclear.dynamics.specialise.plain import Plain
from flexclear.dynamics.specialise.tape import FLOAT, Branch, Carried, Loop, Symbol, Tape, Undecided

#: identifies the kernel that becomes a loop on the tape
REPEAT = getattr(repeat, "py_func", repeat).__code__


class Number(float):
    """A number of the topology that divides like compiled kernels."""

    def __rtruediv__(self, other: float) -> float:
        with np.errstate(all="ignore"):
            return float(np.divide(other, self))


class Memory:
    """An array that is read and written by index; entries not yet written are loaded when the code runs."""

    def __init__(self, trace: Trace, name: str, kind: str) -> None:
        self.trace, self.name, self.kind = trace, name, kind
        self.values: dict[int, Any] = {}

    def __getitem__(self, index: Any) -> Any:
        if not isinstance(index, Symbol) and index in self.values:
            return self.values[index]
        return self.trace.tape.write(self.kind, "load", self.name, index)

    def __setitem__(self, index: int, value: Any) -> None:
        self.trace.journal.append((self, index, self.values.get(index), value))
        self.values[index] = value

    def put_back(self, index: int, value: Any) -> None:
        """Undo a store."""
        if value is None:
            del self.values[index]
        else:
            self.values[index] = value


class Run:
    """A run of a kernel: its decisions at branches, and the results of the kernels that it calls."""

    def __init__(self, decisions: list[bool], done: list[Any]) -> None:
        self.decisions, self.done, self.position, self.decided = decisions, done, 0, 0


class Trace:
    """Records a tape, a new one of limited length by default; `journal` lists stores in their order."""

    def __init__(self, longest: int = 0, tape: Tape | None = None) -> None:
        self.tape = tape or Tape(self.decide, longest)
        self.journal: list[Any] = []
        self.runs = [Run([], [])]
        self.plain = Plain(self._function, self._largest, self._smallest, self.call)

    def decide(self, condition: Symbol) -> bool:
        """Return the decision at a branch in the current run; raise Undecided when both ways are needed."""
        run = self.runs[-1]
        if run.decided == len(run.decisions):
            raise Undecided(condition)
        run.decided += 1
        return run.decisions[run.decided - 1]

    def call(self, function: Callable, arguments: tuple[Any, ...]) -> Any:
        """Return the result of a kernel."""
        function = self._repeated if function.__code__ is REPEAT else function
        caller = self.runs[-1]
        if caller.position == len(caller.done):
            start = len(self.journal)
            result = self._explored(function, arguments, [], [])
            caller.done.append((result, self.journal[start:]))
        else:
            result, stores = caller.done[caller.position]
            for memory, index, _, value in stores:
                memory[index] = value
        caller.position += 1
        return result

    def _explored(self, function: Callable, arguments: tuple[Any, ...], decisions: list[bool], done: list[Any]) -> Any:
        """Return the result of a kernel with given decisions at its first branches; further branches go both ways."""
        start, run = len(self.journal), Run(decisions, done)
        self.runs.append(run)
        try:
            return function(*arguments)
        except Undecided as met:
            branch = Branch(met.condition, ([], []))
        finally:
            self.runs.pop()
        self._go_back(start)
        ways = []
        for block, choice in zip(branch.blocks, (True, False), strict=True):
            with self.tape.inside(block):
                result = self._explored(function, arguments, [*decisions, choice], list(run.done))
            ways.append((result, {(memory, index): value for memory, index, _, value in self.journal[start:]}))
            self._go_back(start)
        return self._joined(branch, *ways)

    def _go_back(self, start: int) -> None:
        while len(self.journal) > start:
            memory, index, before, _ = self.journal.pop()
            memory.put_back(index, before)

    def _joined(self, branch: Branch, first: Any, second: Any) -> Any:
        """Join the results of a branch: stores in memory, and return values."""
        self.tape.block.append(branch)
        for memory, index in dict.fromkeys([*first[1], *second[1]]):
            values = []
            for block, (_, stores) in zip(branch.blocks, (first, second), strict=True):
                with self.tape.inside(block):
                    values.append(stores[memory, index] if (memory, index) in stores else memory[index])
            memory[index] = self.tape.join(branch, *values)
        return self._joined_results(branch, first[0], second[0])

    def _joined_results(self, branch: Branch, a: Any, b: Any) -> Any:
        if isinstance(a, tuple):
            return tuple(self._joined_results(branch, x, y) for x, y in zip(a, b, strict=True))
        return None if a is None else self.tape.join(branch, a, b)

    def _repeated(self, turn: Callable, *arguments: Any) -> None:
        """Record calls of a kernel as a loop, or one after the other where numbers alone decide."""
        start, carried = len(self.journal), dict[tuple[Memory, int], Carried]()
        while True:
            loop = Loop(([],), list(carried.values()))
            with self.tape.inside(loop.blocks[0]):
                for (memory, index), one in carried.items():
                    memory[index] = one.inside
                loop.condition = turn(*arguments)
            if not carried and not isinstance(loop.condition, Symbol):
                self.tape.block += loop.blocks[0]
                start = len(self.journal)
                if not loop.condition:
                    return
                continue
            left = {(memory, index): value for memory, index, _, value in self.journal[start:]}
            self._go_back(start)
            if left.keys() == carried.keys():
                break
            carried = {(memory, index): self.tape.carry(memory[index]) for memory, index in left}
        self.tape.block.append(loop)
        for (memory, index), one in carried.items():
            memory[index], one.left = one.after, left[memory, index]

    def _function(self, name: str) -> Callable:
        def apply(*arguments: Any) -> Any:
            if any(isinstance(a, Symbol) for a in arguments):
                return self.tape.write(FLOAT, name, *arguments)
            with np.errstate(all="ignore"):
                return Number(getattr(np, name)(*arguments))

        return apply

    def _largest(self, a: Any, b: Any) -> Any:
        return self.tape.select(b > a, b, a)

    def _smallest(self, a: Any, b: Any) -> Any:
        return self.tape.select(b < a, b, a)
