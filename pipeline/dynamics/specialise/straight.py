"""The right-hand side of one wiring as straight code: no tables, no loops, no work space but registers and the stack.

Of what an evaluation leaves in w there is only what the steps read (`KEPT`): the state's rates, what contacts do, how
far loops are open and how independent their rows are. n[ABRIDGED] says so to who needs more (`equations.projection`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import CellType, FunctionType
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import Kernel
from flexclear.pipeline.dynamics.specialise import wiring as wired
from flexclear.pipeline.dynamics.specialise.code import Emitter, Program, loads
from flexclear.pipeline.dynamics.specialise.tape import FLOAT, INTEGER, UnsuitedError
from flexclear.pipeline.dynamics.specialise.trace import Memory, Trace

#: operations beyond which straight code is no faster than loops: it no longer fits the processor's first caches
LONGEST = 80_000
#: stretches of w that the steps read after an evaluation; of ROW_SCALE and SCHUR see `_kept`
KEPT = {m.TOUCH.place, m.LOAD_BENDS.place, m.RESIDUAL, m.RESIDUAL_RATE, m.PIVOT, wired.RATES}
_INTEGER = ir.IntType(64)


def program(rates: Callable, wiring: wired.Wiring) -> Program:
    """What the kernel rates(h, f, w, n, y, dy) computes for a wiring; UnsuitedError when it is too long for that."""
    h, trace = wired.header(wiring), Trace(LONGEST)
    w, f, n = Memory(trace, "w", FLOAT), Memory(trace, "f", FLOAT), Memory(trace, "n", INTEGER)
    w.values.update(wired.ground(h))
    try:
        trace.plain(rates)(h, f, w, n, wired.start(wired.STATE), wired.start(wired.RATES))
    except ZeroDivisionError:
        raise UnsuitedError("rows are solved for of which the wiring says that they depend on each other") from None
    is_stored = _kept(h)
    stores = [("w", index, value) for index, value in w.values.items() if is_stored(*wired.split(index))]
    return Program(trace.tape.block, [*stores, ("n", m.EVALUATION, n.values[m.EVALUATION]), ("n", m.ABRIDGED, 1)])


def _kept(h: list[int]) -> Callable[[int, int], bool]:
    """Whether an index is read after an evaluation: of the factor of J M^-1 J^T its diagonal, of scales the last."""
    o = h[m.CLOSURE_ENVELOPE.place]
    rows = [(h[o + 2 * r], h[o + 2 * r + 1]) for r in range(h[m.N_KEPT_ROWS])]
    diagonal = {start - first + r for r, (first, start) in enumerate(rows)}

    def kept(stretch: int, index: int) -> bool:
        scale = stretch == m.ROW_SCALE and index >= h[m.N_CLOSURE_ROWS]
        return stretch in KEPT or scale or (stretch == m.SCHUR and index in diagonal)

    return kept


def straight(rates: Callable, wiring: wired.Wiring, *, exact: bool = False) -> Any:
    """The function straight(h, f, w, n, y, dy) of compiled code that does what `rates` does for a wiring.

    exact: it gives what each lane of `abreast` gives, to the last bit; sums in any order are faster by a sixth.
    """

    @intrinsic
    def run(typingctx: Any, h: Any, f: Any, w: Any, n: Any, y: Any, dy: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            tape = program(rates, wiring)
            Emitter(builder, tape, _places(builder, tape, [values]), exact=exact).emit()
            return context.get_dummy_value()

        return types.void(h, f, w, n, y, dy), generate

    return run


def abreast(rates: Callable, wiring: wired.Wiring, lanes: int) -> tuple[Any, Any]:
    """Functions of compiled code: note(h, f, numbers, lane) and abreast(places, numbers).

    The second does the same for several states, each of a mechanism with numbers of its own, which the first has put
    where they are adjacent: numbers has room for all of f in all lanes.
    places: addresses of all h, then of all f, w and n, then all addresses of y and dy, shape (6 lanes,).
    """
    made = cache(lambda: program(rates, wiring))  # both functions are typed and written, and the tape is long

    @intrinsic
    def note(typingctx: Any, h: Any, f: Any, numbers: Any, lane: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            h, f, numbers, lane = values
            begins = dict[int, Any]()
            for k, index in enumerate(_numbers(made())):
                stretch, inside = wired.split(index)
                if stretch not in begins:
                    begins[stretch] = builder.gep(f, [builder.load(builder.gep(h, [_INTEGER(stretch)]))])
                value = builder.load(builder.gep(begins[stretch], [_INTEGER(inside)]))
                builder.store(value, builder.gep(numbers, [builder.add(lane, _INTEGER(k * lanes))]))
            return context.get_dummy_value()

        return types.void(h, f, numbers, lane), generate

    @intrinsic
    def run(typingctx: Any, places: Any, numbers: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            tape, (places, numbers) = made(), values
            given = [_arguments(builder, places, lane, lanes) for lane in range(lanes)]
            side_by_side = builder.bitcast(numbers, ir.VectorType(ir.DoubleType(), lanes).as_pointer())
            row = {index: k for k, index in enumerate(_numbers(tape))}

            def number(index: int) -> Any:
                loaded = builder.load(builder.gep(side_by_side, [_INTEGER(row[index])]))
                loaded.align = 8
                return loaded

            Emitter(builder, tape, _places(builder, tape, given), lanes, exact=True, number=number).emit()
            return context.get_dummy_value()

        return types.void(places, numbers), generate

    return note, run


def _numbers(tape: Program) -> list[int]:
    """Places in f of all that a program loads from there."""
    return sorted({index for array, index in loads(tape) if array == "f" and isinstance(index, int)})


def exactly(kernel: Any) -> Any:
    """A kernel, and those in its closure, with every operation rounded as it is: equal bits wherever it is used."""
    function = kernel.py_func
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    exact = tuple(CellType(exactly(cell) if isinstance(cell, Kernel) else cell) for cell in cells)
    scope, name = function.__globals__, function.__name__
    return njit(error_model="numpy", _nrt=False)(FunctionType(function.__code__, scope, name, None, exact))


def _arguments(builder: ir.IRBuilder, places: Any, lane: int, lanes: int) -> list[Any]:
    """h, f, w, n, y and dy of a lane."""
    words = [builder.load(builder.gep(places, [_INTEGER(k * lanes + lane)])) for k in range(6)]
    kinds = [_INTEGER, ir.DoubleType(), ir.DoubleType(), _INTEGER]
    return [builder.inttoptr(word, kind.as_pointer()) for word, kind in zip(words, kinds, strict=False)] + words[4:]


def _places(builder: ir.IRBuilder, tape: Program, given: list[Any]) -> Callable:
    """Where the code finds an element of an array in a lane: in a stretch whose begin it has looked up first.

    given: h, f, w, n, y and dy of each lane.
    """
    begins = dict[Any, Any]()
    places = [(array, index) for array, index, _ in tape.stores] + loads(tape)
    stretches = sorted({(array, wired.split(index)[0]) for array, index in places if isinstance(index, int)})
    for lane, (h, f, w, n, y, dy) in enumerate(given):
        builder.store(y, builder.gep(n, [_INTEGER(m.STATE)]))
        for array, stretch in stretches:
            begin = {wired.STATE: y, wired.RATES: dy, -1: _INTEGER(0)}.get(stretch)
            if begin is None:
                begin = builder.load(builder.gep(h, [_INTEGER(stretch)]))
            begins[array, stretch, lane] = builder.gep({"f": f, "w": w, "n": n}[array], [begin])

    def where(array: str, index: Any, lane: int) -> Any:
        if not isinstance(index, int):
            return builder.gep(given[lane]["hfwn".index(array)], [index])
        stretch, inside = wired.split(index)
        return builder.gep(begins[array, stretch, lane], [_INTEGER(inside)])

    return where
