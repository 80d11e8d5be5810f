"""Machine code of a tape: straight lines of arithmetic, with jumps where branches depend on the state.

The code evaluates one state, or several in the lanes of the processor's vectors. Several states take both ways at a
branch where they disagree, and each keeps the values of its own way. Their results must not depend on how many states
are evaluated together, nor on which. So every operation is then rounded separately, and products and sums are fused
where the tape requires it, not where the compiler chooses.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.tape import BIT, COMPARISONS, FLOAT, INTEGER, Branch, Loop, Symbol

#: as for all kernels (`dynamics.kernels`)
FLAGS = ("contract", "reassoc", "nsz")
TYPES = {FLOAT: ir.DoubleType(), INTEGER: ir.IntType(64), BIT: ir.IntType(1)}
ARITHMETIC = {"add": "fadd", "sub": "fsub", "iadd": "add", "imul": "mul", "and": "and_"}
#: functions of the processor, and functions of the mathematics library
INTRINSICS = {
    "sqrt": "llvm.sqrt",
    "fabs": "llvm.fabs",
    "round": "llvm.rint",
    "pow": "llvm.pow",
    "copysign": "llvm.copysign",
}
#: largest way that several states compute even where none takes it, in operations; operations that a call counts as
SHORT_WAY, CALL = 12, 40
_NUMBER = ir.IntType(32)
LIBRARY = {"sin": "sin", "cos": "cos", "tan": "tan", "exp": "exp", "log": "log", "tanh": "tanh"}
LIBRARY |= {"arctan2": "atan2", "pow": "pow"}


@dataclass(frozen=True)
class Program:
    """A program. block: its operations.  stores: the values written at the end, (array, index, value)."""

    block: list[Any]
    stores: list[tuple[str, Any, Any]]


def loads(program: Program) -> list[tuple[str, Any]]:
    """Return array and index of all loads."""
    entries, blocks = list[tuple[str, Any]](), [program.block]
    while blocks:
        for item in blocks.pop():
            if not isinstance(item, Symbol):
                blocks += item.blocks
            elif item.operation == "load":
                entries.append(item.arguments)
    return entries


def uses(program: Program) -> Counter[Symbol]:
    """Return the number of uses of each symbol that the stores need."""
    counts: Counter[Symbol] = Counter()
    for _, index, value in program.stores:
        counts.update(s for s in (index, value) if isinstance(s, Symbol))
    _use(program.block, counts)
    return counts


def _use(block: list[Any], counts: Counter[Symbol]) -> None:
    for item in reversed(block):
        if isinstance(item, Branch):
            for joined, *values in item.joins:
                if counts[joined]:
                    counts.update(value for value in values if isinstance(value, Symbol))
                    counts[item.condition] += 1
            for inner in item.blocks:
                _use(inner, counts)
        elif isinstance(item, Loop):
            used = [item.condition, *(value for one in item.carried for value in (one.first, one.left))]
            counts.update(value for value in used if isinstance(value, Symbol))
            _use(item.blocks[0], counts)
        elif counts[item]:
            counts.update(a for a in item.arguments if isinstance(a, Symbol))


def size(block: list[Any], counts: Counter[Symbol]) -> int:
    """Return the number of operations of a block; each call counts as the number of operations of equal duration."""
    total = 0
    for item in block:
        if not isinstance(item, Symbol):
            total += 1 + sum(size(inner, counts) for inner in item.blocks)
        elif counts[item]:
            total += CALL if item.operation in LIBRARY else 1
    return total


def fused_sums(block: list[Any], counts: Counter[Symbol]) -> dict[Symbol, tuple[Symbol, Any]]:
    """Return, by sum, the product in it that has no other use, of the same block, and the other operand."""
    pairs, products = dict[Symbol, tuple[Symbol, Any]](), set[Symbol]()
    for item in block:
        if not isinstance(item, Symbol):
            for inner in item.blocks:
                pairs |= fused_sums(inner, counts)
        elif item.operation == "mul" and counts[item] == 1 and reciprocal_factor(item, counts) is None:
            products.add(item)
        elif counts[item] and item.operation in ("add", "sub"):
            a, b = item.arguments
            if b in products:
                pairs[item] = b, a
            elif a in products:
                pairs[item] = a, b
    return pairs


def reciprocal_factor(product: Symbol, counts: Counter[Symbol]) -> Symbol | None:
    """Return the factor of a product that is a reciprocal without other uses, or None."""
    for factor in product.arguments:
        if isinstance(factor, Symbol) and factor.operation == "reciprocal" and counts[factor] == 1:
            return factor
    return None


class Emitter:
    """Writes a program into a function under construction.

    where: where(array, index as a number or a value of the code, lane) -> pointer to an array's element.
    lanes: number of states evaluated together.  exact: True to round every operation separately.
    number: for several states, the vector of their numbers at an index of f.
    """

    def __init__(
        self,
        builder: ir.IRBuilder,
        program: Program,
        where: Any,
        lanes: int = 1,
        *,
        exact: bool = False,
        number: Callable[[int], Any] | None = None,
    ):
        self.builder, self.program, self.where, self.lanes, self.number = builder, program, where, lanes, number
        self.uses = uses(program)
        self.exact, self.flags = exact, () if exact else FLAGS
        self.fused = fused_sums(program.block, self.uses) if exact else {}
        self.inside_sums = {product for product, _ in self.fused.values()}
        self.types = {kind: one if lanes == 1 else ir.VectorType(one, lanes) for kind, one in TYPES.items()}
        self.values: dict[Symbol, Any] = {}

    def emit(self) -> None:
        """Write the whole program."""
        self._block(self.program.block)
        for array, index, value in self.program.stores:
            operand = self._value(value, INTEGER if array in "hn" else FLOAT)
            for lane in range(self.lanes):
                self.builder.store(self._of(operand, lane), self.where(array, self._place(index, lane), lane))

    def _value(self, value: Any, kind: str) -> Any:
        if isinstance(value, Symbol):
            return self.values[value]
        return ir.Constant(self.types[kind], value if self.lanes == 1 else [value] * self.lanes)

    def _place(self, index: Any, lane: int) -> Any:
        if found := topologies.base_and_offset(index):
            return found[0], self._of(self.values[found[1]], lane)
        return self._of(self.values[index], lane) if isinstance(index, Symbol) else index

    # Lanes -------------------------------------------------------------------------------------------------------

    def _of(self, value: Any, lane: int) -> Any:
        """Return the component of a value in a lane."""
        return value if self.lanes == 1 else self.builder.extract_element(value, _NUMBER(lane))

    def _together(self, values: list[Any]) -> Any:
        """Combine the values of all lanes into one."""
        if self.lanes == 1:
            return values[0]
        vector = ir.Constant(ir.VectorType(values[0].type, self.lanes), ir.Undefined)
        for lane, value in enumerate(values):
            vector = self.builder.insert_element(vector, value, _NUMBER(lane))
        return vector

    # Blocks ------------------------------------------------------------------------------------------------------

    def _block(self, block: list[Any]) -> None:
        for item in block:
            if isinstance(item, Branch):
                self._branch(item)
            elif isinstance(item, Loop):
                self._loop(item)
            elif self.uses[item] and item not in self.inside_sums:
                self.values[item] = self._operation(item)

    def _branch(self, branch: Branch) -> None:
        joins = [join for join in branch.joins if self.uses[join[0]]]
        if not joins:
            return
        if self.lanes > 1:
            self._both_ways(branch, joins)
        elif any(size(block, self.uses) for block in branch.blocks):
            self._one_way(branch, joins)
        else:
            self._joined(branch, joins, *([self._value(join[way], join[0].kind) for join in joins] for way in (1, 2)))

    def _joined(self, branch: Branch, joins: list[Any], first: list[Any], second: list[Any]) -> None:
        condition = self.values[branch.condition]
        for (joined, _, _), a, b in zip(joins, first, second, strict=True):
            self.values[joined] = self.builder.select(condition, a, b)

    def _one_way(self, branch: Branch, joins: list[Any]) -> None:
        builder = self.builder
        starts = [builder.append_basic_block() for _ in range(2)]
        after = builder.append_basic_block()
        builder.cbranch(self.values[branch.condition], *starts)
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

    def _both_ways(self, branch: Branch, joins: list[Any]) -> None:
        """Compute both ways, and select per lane; a long way that no lane takes is skipped."""
        ways = []
        for way, block in enumerate(branch.blocks, start=1):
            if size(block, self.uses) <= SHORT_WAY:
                self._block(block)
                ways.append([self._value(join[way], join[0].kind) for join in joins])
            else:
                ways.append(self._if_any(branch, way, joins))
        self._joined(branch, joins, *ways)

    def _if_any(self, branch: Branch, way: int, joins: list[Any]) -> list[Any]:
        """Compute a way if any lane takes it, and return its values."""
        builder, word = self.builder, ir.IntType(self.lanes)
        start, after, before = builder.append_basic_block(), builder.append_basic_block(), builder.block
        none = word(0 if way == 1 else -1)
        builder.cbranch(
            builder.icmp_unsigned("!=", builder.bitcast(self.values[branch.condition], word), none), start, after
        )
        builder.position_at_end(start)
        self._block(branch.blocks[way - 1])
        left, end = [self._value(join[way], join[0].kind) for join in joins], builder.block
        builder.branch(after)
        builder.position_at_end(after)
        merged = []
        for value in left:
            phi = builder.phi(value.type)
            phi.add_incoming(value, end)
            phi.add_incoming(ir.Constant(value.type, None), before)
            merged.append(phi)
        return merged

    def _loop(self, loop: Loop) -> None:
        """Repeat as long as a lane continues; the other lanes keep their values."""
        builder, before, word = self.builder, self.builder.block, ir.IntType(self.lanes)
        firsts = [self._value(one.first, one.inside.kind) for one in loop.carried]
        start, after = builder.append_basic_block(), builder.append_basic_block()
        builder.branch(start)
        builder.position_at_end(start)
        going = builder.phi(self.types[BIT])
        for one, first in zip(loop.carried, firsts, strict=True):
            phi = self.values[one.inside] = builder.phi(self.types[one.inside.kind])
            phi.add_incoming(first, before)
        self._block(loop.blocks[0])
        for one in loop.carried:
            phi, left = self.values[one.inside], self._value(one.left, one.inside.kind)
            self.values[one.after] = left if self.lanes == 1 else builder.select(going, left, phi)
            phi.add_incoming(self.values[one.after], builder.block)
        goes_on = builder.and_(going, self._value(loop.condition, BIT))
        going.add_incoming(self._value(True, BIT), before)
        going.add_incoming(goes_on, builder.block)
        builder.cbranch(builder.icmp_unsigned("!=", builder.bitcast(goes_on, word), word(0)), start, after)
        builder.position_at_end(after)

    # Operations --------------------------------------------------------------------------------------------------

    def _operation(self, s: Symbol) -> Any:
        builder, name = self.builder, s.operation
        if name == "load":
            return self._load(*s.arguments)
        if name == "select":
            condition, a, b = s.arguments
            return builder.select(self.values[condition], self._value(a, s.kind), self._value(b, s.kind))
        if s in self.fused:
            return self._sum_with_product(s, *self.fused[s])
        kind = next(a.kind for a in s.arguments if isinstance(a, Symbol))
        values = [self._value(a, kind) for a in s.arguments]
        if name in COMPARISONS:
            if kind == FLOAT:
                compare = builder.fcmp_unordered if name == "!=" else builder.fcmp_ordered
                return compare(name, *values)
            return builder.icmp_signed(name, *values)
        if name in ARITHMETIC:
            return getattr(builder, ARITHMETIC[name])(*values, **({"flags": self.flags} if kind == FLOAT else {}))
        if name == "neg":
            return builder.fneg(*values, flags=self.flags)
        if name == "reciprocal":
            return builder.fdiv(self._value(1.0, FLOAT), *values, flags=self.flags)
        if name == "mul":
            return self._product(s, values)
        if name in INTRINSICS and name != "pow":
            return self._instruction(INTRINSICS[name], values)
        return self._together([self._call(name, [self._of(v, lane) for v in values]) for lane in range(self.lanes)])

    def _load(self, array: str, index: Any) -> Any:
        builder = self.builder
        if array == "f" and self.number is not None and not isinstance(index, Symbol):
            return self.number(index)
        places = [self.where(array, self._place(index, lane), lane) for lane in range(self.lanes)]
        return self._together([builder.load(pointer) for pointer in places])

    def _product(self, s: Symbol, values: list[Any]) -> Any:
        """Return a product, as a quotient where its reciprocal has no other use."""
        inverse = reciprocal_factor(s, self.uses)
        if inverse is None:
            return self.builder.fmul(*values, flags=self.flags)
        other = s.arguments[1] if s.arguments[0] is inverse else s.arguments[0]
        below = self._value(inverse.arguments[0], FLOAT)
        return self.builder.fdiv(self._value(other, FLOAT), below, flags=self.flags)

    def _sum_with_product(self, s: Symbol, product: Symbol, other: Any) -> Any:
        """Return a sum or difference with a product, rounded once where the processor can."""
        a, b = (self._value(factor, FLOAT) for factor in product.arguments)
        rest = self._value(other, FLOAT)
        if s.operation == "sub" and s.arguments[1] is product:
            a = self.builder.fneg(a)
        elif s.operation == "sub":
            rest = self.builder.fneg(rest)
        return self._instruction("llvm.fmuladd", [a, b, rest])

    def _instruction(self, name: str, values: list[Any]) -> Any:
        """Call an instruction of the processor on all lanes."""
        kind, module = self.types[FLOAT], self.builder.module
        full = f"{name}.f64" if self.lanes == 1 else f"{name}.v{self.lanes}f64"
        function = module.globals.get(full) or ir.Function(module, ir.FunctionType(kind, [kind] * len(values)), full)
        return self.builder.call(function, values)

    def _call(self, name: str, values: list[Any]) -> Any:
        """Call a function of the mathematics library in one lane.

        Exact code must not use alternatives, such as vector functions, so it hides the function from the compiler.
        """
        module, kind = self.builder.module, TYPES[FLOAT]
        full = LIBRARY[name] if self.exact or name not in INTRINSICS else f"{INTRINSICS[name]}.f64"
        function = module.globals.get(full)
        if function is None:
            function = ir.Function(module, ir.FunctionType(kind, [kind] * len(values)), full)
            if self.exact:
                function.attributes.add("nobuiltin")
        return self.builder.call(function, values)
