"""A tape as machine code: straight lines of arithmetic, with a jump where a branch depends on the state."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from flexclear.pipeline.dynamics.specialise.tape import BIT, COMPARISONS, FLOAT, INTEGER, Branch, Symbol

#: as of all kernels (`dynamics.kernels`)
FLAGS = ("contract", "reassoc", "nsz")
TYPES = {FLOAT: ir.DoubleType(), INTEGER: ir.IntType(64), BIT: ir.IntType(1)}
ARITHMETIC = {"add": "fadd", "sub": "fsub", "iadd": "add", "imul": "mul", "and": "and_"}
#: functions of the processor, and of the mathematics library
INTRINSICS = {
    "sqrt": "llvm.sqrt",
    "fabs": "llvm.fabs",
    "round": "llvm.rint",
    "pow": "llvm.pow",
    "copysign": "llvm.copysign",
}
LIBRARY = {"sin": "sin", "cos": "cos", "exp": "exp", "tanh": "tanh", "arctan2": "atan2"}


@dataclass(frozen=True)
class Program:
    """block: what is computed.  stores: what is written at the end, (array, place, value)."""

    block: list[Any]
    stores: list[tuple[str, Any, Any]]


def loads(program: Program) -> list[tuple[str, Any]]:
    """Array and place of all that is loaded."""
    found, blocks = list[tuple[str, Any]](), [program.block]
    while blocks:
        for item in blocks.pop():
            if isinstance(item, Branch):
                blocks += item.blocks
            elif item.operation == "load":
                found.append(item.arguments)
    return found


def uses(program: Program) -> Counter[Symbol]:
    """How often each symbol is used by what the stores need."""
    found: Counter[Symbol] = Counter()
    for _, place, value in program.stores:
        found.update(s for s in (place, value) if isinstance(s, Symbol))
    _use(program.block, found)
    return found


def _use(block: list[Any], found: Counter[Symbol]) -> None:
    for item in reversed(block):
        if isinstance(item, Branch):
            for joined, *values in item.joins:
                if found[joined]:
                    found.update(value for value in values if isinstance(value, Symbol))
                    found[item.condition] += 1
            for inner in item.blocks:
                _use(inner, found)
        elif found[item]:
            found.update(a for a in item.arguments if isinstance(a, Symbol))


class Emitter:
    """Writes a program into a function under construction.

    where: the place of an array's element: where(array, place as a number or a value of the code) -> pointer.
    """

    def __init__(self, builder: ir.IRBuilder, program: Program, where: Any) -> None:
        self.builder, self.program, self.where = builder, program, where
        self.uses = uses(program)
        self.values: dict[Symbol, Any] = {}

    def emit(self) -> None:
        """Write everything."""
        self._block(self.program.block)
        for array, place, value in self.program.stores:
            kind = INTEGER if array in "hn" else FLOAT
            self.builder.store(self._value(value, kind), self.where(array, self._place(place)))

    def _value(self, value: Any, kind: str) -> Any:
        if isinstance(value, Symbol):
            return self.values[value]
        return ir.Constant(TYPES[kind], value)

    def _place(self, place: Any) -> Any:
        return self.values[place] if isinstance(place, Symbol) else place

    def _block(self, block: list[Any]) -> None:
        for item in block:
            if isinstance(item, Branch):
                self._branch(item)
            elif self.uses[item]:
                self.values[item] = self._operation(item)

    def _branch(self, branch: Branch) -> None:
        joins = [join for join in branch.joins if self.uses[join[0]]]
        if not joins:
            return
        builder, condition = self.builder, self.values[branch.condition]
        if not any(
            self.uses[item] for block in branch.blocks for item in block if isinstance(item, Symbol)
        ) and not any(isinstance(item, Branch) for block in branch.blocks for item in block):
            for joined, a, b in joins:
                self.values[joined] = builder.select(
                    condition, self._value(a, joined.kind), self._value(b, joined.kind)
                )
            return
        starts = [builder.append_basic_block() for _ in range(2)]
        after = builder.append_basic_block()
        builder.cbranch(condition, *starts)
        ends = []
        for start, block in zip(starts, branch.blocks, strict=True):
            builder.position_at_end(start)
            self._block(block)
            ends.append(builder.block)
            builder.branch(after)
        builder.position_at_end(after)
        for joined, *values in joins:
            phi = builder.phi(TYPES[joined.kind])
            for value, end in zip(values, ends, strict=True):
                phi.add_incoming(self._value(value, joined.kind), end)
            self.values[joined] = phi

    def _operation(self, s: Symbol) -> Any:
        builder, name = self.builder, s.operation
        if name == "load":
            array, place = s.arguments
            return builder.load(self.where(array, self._place(place)))
        if name == "select":
            condition, a, b = s.arguments
            return builder.select(self.values[condition], self._value(a, s.kind), self._value(b, s.kind))
        kind = next(a.kind for a in s.arguments if isinstance(a, Symbol))
        values = [self._value(a, kind) for a in s.arguments]
        if name in COMPARISONS:
            if kind == FLOAT:
                compare = builder.fcmp_unordered if name == "!=" else builder.fcmp_ordered
                return compare(name, *values)
            return builder.icmp_signed(name, *values)
        if name in ARITHMETIC:
            return getattr(builder, ARITHMETIC[name])(*values, **({"flags": FLAGS} if kind == FLOAT else {}))
        if name == "neg":
            return builder.fneg(*values, flags=FLAGS)
        if name == "reciprocal":
            return builder.fdiv(ir.Constant(TYPES[FLOAT], 1.0), *values, flags=FLAGS)
        if name == "mul":
            return self._product(s, values)
        return self._call(name, values)

    def _product(self, s: Symbol, values: list[Any]) -> Any:
        """A quotient where nothing else is divided by the same."""
        for inverse, other in (s.arguments, s.arguments[::-1]):
            if isinstance(inverse, Symbol) and inverse.operation == "reciprocal" and self.uses[inverse] == 1:
                below = self._value(inverse.arguments[0], FLOAT)
                return self.builder.fdiv(self._value(other, FLOAT), below, flags=FLAGS)
        return self.builder.fmul(*values, flags=FLAGS)

    def _call(self, name: str, values: list[Any]) -> Any:
        module, kind = self.builder.module, TYPES[FLOAT]
        if name in INTRINSICS:
            function = module.declare_intrinsic(INTRINSICS[name], [kind], ir.FunctionType(kind, [kind] * len(values)))
        else:
            function = module.globals.get(LIBRARY[name])
            if function is None:
                function = ir.Function(module, ir.FunctionType(kind, [kind] * len(values)), LIBRARY[name])
        return self.builder.call(function, values)
