"""The right-hand side of one wiring as straight code: no tables, no loops, no work space but registers and the stack.

Of what an evaluation leaves in w there is only what the steps read (`KEPT`): the state's rates, what contacts do, how
far loops are open and how independent their rows are. n[ABRIDGED] says so to who needs more (`equations.projection`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.specialise import wiring as wired
from flexclear.pipeline.dynamics.specialise.code import Emitter, Program, loads
from flexclear.pipeline.dynamics.specialise.tape import FLOAT, INTEGER, UnsuitedError
from flexclear.pipeline.dynamics.specialise.trace import Memory, Trace

#: operations beyond which straight code is no faster than loops: it no longer fits the caches near to the processor
LONGEST = 80_000
#: stretches of w that the steps read after an evaluation; of ROW_SCALE and SCHUR see `_kept`
KEPT = {m.TOUCH.place, m.RESIDUAL, m.RESIDUAL_RATE, m.PIVOT, wired.RATES}
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
    kept = _kept(h)
    stores = [("w", place, value) for place, value in w.values.items() if kept(*wired.split(place))]
    return Program(trace.tape.block, [*stores, ("n", m.EVALUATION, n.values[m.EVALUATION]), ("n", m.ABRIDGED, 1)])


def _kept(h: list[int]) -> Callable[[int, int], bool]:
    """Whether a place is read after an evaluation: of the factor of J M^-1 J^T its diagonal, of scales the last."""
    o = h[m.CLOSURE_ENVELOPE.place]
    rows = [(h[o + 2 * r], h[o + 2 * r + 1]) for r in range(h[m.N_KEPT_ROWS])]
    diagonal = {start - first + r for r, (first, start) in enumerate(rows)}

    def kept(stretch: int, place: int) -> bool:
        scale = stretch == m.ROW_SCALE and place >= h[m.N_CLOSURE_ROWS]
        return stretch in KEPT or scale or (stretch == m.SCHUR and place in diagonal)

    return kept


def straight(rates: Callable, wiring: wired.Wiring) -> Any:
    """The function straight(h, f, w, n, y, dy) of compiled code that does what `rates` does for a wiring."""

    @intrinsic
    def run(typingctx: Any, h: Any, f: Any, w: Any, n: Any, y: Any, dy: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
            found = program(rates, wiring)
            builder.store(values[4], builder.gep(values[3], [_INTEGER(m.STATE)]))
            Emitter(builder, found, _places(builder, found, *values)).emit()
            return context.get_dummy_value()

        return types.void(h, f, w, n, y, dy), generate

    return run


def _places(builder: ir.IRBuilder, found: Program, h: Any, f: Any, w: Any, n: Any, y: Any, dy: Any) -> Callable:
    """Where the code finds an element of an array: in a stretch whose begin it has looked up first."""
    arrays, begins = {"f": f, "w": w, "n": n}, dict[Any, Any]()
    places = [(array, place) for array, place, _ in found.stores] + loads(found)
    for array, stretch in sorted({(array, wired.split(place)[0]) for array, place in places if isinstance(place, int)}):
        begin = {wired.STATE: y, wired.RATES: dy, -1: _INTEGER(0)}.get(stretch)
        if begin is None:
            begin = builder.load(builder.gep(h, [_INTEGER(stretch)]))
        begins[array, stretch] = builder.gep(arrays[array], [begin])

    def where(array: str, place: Any) -> Any:
        if not isinstance(place, int):
            return builder.gep(arrays[array], [place])
        stretch, inside = wired.split(place)
        return builder.gep(begins[array, stretch], [_INTEGER(inside)])

    return where
