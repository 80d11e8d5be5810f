"""A long program as many short functions, in whose order they are called: LLVM takes more than twice as long for one
that is twice as long. Values that one makes and another needs go through memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from flexclear.pipeline.dynamics.specialise.code import TYPES
from flexclear.pipeline.dynamics.specialise.tape import FLOAT, Symbol

_INDEX, _FLOAT = ir.IntType(64), ir.DoubleType()


class Parts:
    """The functions of a program, and where its values are.

    outer: builder of the function that calls the others.  arguments: its own that they need.  places: where the
    code finds an element of an array (`straight.places`).
    """

    def __init__(
        self, outer: ir.IRBuilder, arguments: list[Any], places: Callable[[ir.IRBuilder, list[Any]], Callable]
    ):
        self.outer, self.arguments, self.places = outer, arguments, places
        self._memory = outer.alloca(_FLOAT, _INDEX(1))
        self._slots = dict[Symbol, tuple[int, Any]]()
        self._made, self._loaded = dict[Any, ir.IRBuilder](), dict[tuple[Any, Symbol], Any]()

    def begin(self) -> tuple[ir.IRBuilder, Any]:
        """Builder of another function, which is called here, and where its code finds elements."""
        kinds = [*(a.type for a in self.arguments), self._memory.type]
        module, kind = self.outer.module, ir.FunctionType(ir.VoidType(), kinds)
        function = ir.Function(module, kind, f"part{len(self._made)}")
        function.linkage = "internal"
        for argument in function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        self.outer.call(function, [*self.arguments, self._memory])
        builder = self._made[function] = ir.IRBuilder(function.append_basic_block())
        return builder, self.places(builder, [function.args[:-1]])

    def value(self, builder: ir.IRBuilder, symbol: Symbol, value: Any) -> Any:
        """A symbol's value where it is needed, by that where it was made."""
        if value.function is builder.function:
            return value
        self._slots.setdefault(symbol, (len(self._slots), value))
        if builder is self.outer:
            return builder.load(self._place(builder, symbol))
        place = builder.function, symbol
        if place not in self._loaded:
            with builder.goto_entry_block():  # what needs it next may be in another block
                self._loaded[place] = builder.load(self._place(builder, symbol))
        return self._loaded[place]

    def keep(self, symbol: Symbol, value: Any) -> None:
        """Leave a value of the outer function to the others."""
        self._slots[symbol] = len(self._slots), value
        self.outer.store(value, self._place(self.outer, symbol))

    def end(self) -> None:
        """Let each function leave what others need, and return."""
        for symbol, (_, value) in self._slots.items():
            if value.function in self._made:
                builder = self._made[value.function]
                builder.store(value, self._place(builder, symbol))
        for builder in self._made.values():
            builder.ret_void()
        self._memory.operands[0] = _INDEX(max(1, len(self._slots)))

    def _place(self, builder: ir.IRBuilder, symbol: Symbol) -> Any:
        memory = self._memory if builder is self.outer else builder.function.args[-1]
        place, kind = builder.gep(memory, [_INDEX(self._slots[symbol][0])]), TYPES[symbol.kind]
        return place if symbol.kind == FLOAT else builder.bitcast(place, kind.as_pointer())
