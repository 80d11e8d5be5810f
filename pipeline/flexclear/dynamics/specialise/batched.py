"""Right-hand side of one topology for several states together, or for one with its tangent."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import CellType, FunctionType
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from flexclear.dynamics.kernels import Kernel
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.code import Emitter, Program, loads
from flexclear.dynamics.specialise.derivative import tangent
from flexclear.dynamics.specialise.program import LONGEST_DIFFERENTIATED, places

_INTEGER = ir.IntType(64)


def differentiated(made: Callable[[], Program]) -> Any:
    """Return run(h, f, w, n, y, dy, f0, w0, change, rates_change) of compiled code with its tangent.

    made: makes the program.
    f0, w0: offsets in f and w of the changes of the numbers, and of those of laws, impact rates and contacts.
    change, rates_change: indices in w of the changes of the state and of its rates.
    """

    @intrinsic
    def run(
        typingctx: Any, h: Any, f: Any, w: Any, n: Any, y: Any, dy: Any, f0: Any, w0: Any, change: Any, rates: Any
    ) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            tape = tangent(made(), LONGEST_DIFFERENTIATED)
            Emitter(builder, tape, places(builder, tape, [values])).emit()
            return context.get_dummy_value()

        return types.void(h, f, w, n, y, dy, f0, w0, change, rates), generate

    return run


def batched(made: Callable[[], Program], lanes: int) -> tuple[Any, Any]:
    """Build compiled functions note(h, f, numbers, lane) and run(addresses, numbers).

    `run` evaluates several states, each of a mechanism with its own numbers, which `note` has copied to
    adjacent positions: `numbers` has room for all of f in all lanes.  made: makes the program.
    addresses: of all h, then of all f, w and n, then all indices of y and dy, shape (6 lanes,).
    """
    traced = cache(made)  # both functions are typed and written, and the tape is long

    @intrinsic
    def note(typingctx: Any, h: Any, f: Any, numbers: Any, lane: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            h, f, numbers, lane = values
            begins = dict[int, Any]()
            for k, index in enumerate(_numbers(traced())):
                stretch, inside = topologies.stretch_and_offset(index)
                if stretch not in begins:
                    begins[stretch] = builder.gep(f, [builder.load(builder.gep(h, [_INTEGER(stretch)]))])
                value = builder.load(builder.gep(begins[stretch], [_INTEGER(inside)]))
                builder.store(value, builder.gep(numbers, [builder.add(lane, _INTEGER(k * lanes))]))
            return context.get_dummy_value()

        return types.void(h, f, numbers, lane), generate

    @intrinsic
    def run(typingctx: Any, addresses: Any, numbers: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            tape, (addresses, numbers) = traced(), values
            given = [_arguments(builder, addresses, lane, lanes) for lane in range(lanes)]
            side_by_side = builder.bitcast(numbers, ir.VectorType(ir.DoubleType(), lanes).as_pointer())
            row = {index: k for k, index in enumerate(_numbers(tape))}

            def number(index: int) -> Any:
                loaded = builder.load(builder.gep(side_by_side, [_INTEGER(row[index])]))
                loaded.align = 8
                return loaded

            Emitter(builder, tape, places(builder, tape, given), lanes, exact=True, number=number).emit()
            return context.get_dummy_value()

        return types.void(addresses, numbers), generate

    return note, run


def _numbers(tape: Program) -> list[int]:
    """Return the indices in f of all numbers that a program loads."""
    return sorted({index for array, index in loads(tape) if array == "f" and isinstance(index, int)})


def exactly(kernel: Any) -> Any:
    """Return a kernel, with those in its closure, that rounds every operation: equal bits wherever it is used."""
    function = kernel.py_func
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    exact = tuple(CellType(exactly(cell) if isinstance(cell, Kernel) else cell) for cell in cells)
    scope, name = function.__globals__, function.__name__
    return njit(error_model="numpy", _nrt=False)(FunctionType(function.__code__, scope, name, None, exact))


def _arguments(builder: ir.IRBuilder, addresses: Any, lane: int, lanes: int) -> list[Any]:
    """Return h, f, w, n, y and dy of a lane."""
    words = [builder.load(builder.gep(addresses, [_INTEGER(k * lanes + lane)])) for k in range(6)]
    kinds = [_INTEGER, ir.DoubleType(), ir.DoubleType(), _INTEGER]
    return [builder.inttoptr(word, kind.as_pointer()) for word, kind in zip(words, kinds, strict=False)] + words[4:]
