"""Right-hand side of one topology as specialised code: no tables, no loops, only registers and the stack as storage.

The steps call straight code of routines (`mechanics.of_topology`), which stores only what they read
(`mechanics.evaluation.evaluate`); n[ABRIDGED] reports that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from flexclear.dynamics import memory as m
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.code import Emitter, Program, loads

#: operations beyond which straight code with the same bits in each lane takes too long to build; beyond which lists of
#: calls are as fast, without time to build: straight code is 17 % faster for `far_csj_cb` (20 500), not for a chain of
#: 20 links (13 000); and the limit for tangents, which have no list
LONGEST, LONGEST_STRAIGHT, LONGEST_DIFFERENTIATED = 50_000, 24_000, 80_000
_INTEGER, _FLOAT = ir.IntType(64), ir.DoubleType()
#: name of the function
NAME = "specialised"


def llvm_text(tape: Program, *, exact: bool = False) -> str:
    """Return the LLVM text of a C function that runs a program.

    It is evaluate(h, f, w, n, t, y, dy), which first evaluates the laws at time t.  exact: True for the results of each
    lane of `batched`, bit by bit; sums in any order are faster by a sixth.
    """
    module = ir.Module(NAME)
    tables = [_INTEGER.as_pointer(), _FLOAT.as_pointer(), _FLOAT.as_pointer(), _INTEGER.as_pointer()]
    function = ir.Function(module, ir.FunctionType(_INTEGER, [*tables, _FLOAT, _INTEGER, _INTEGER]), NAME)
    arrays, given = function.args[:4], function.args[5:]
    for array in arrays:
        array.add_attribute("noalias")
    builder = ir.IRBuilder(function.append_basic_block())
    address = builder.load(builder.gep(arrays[0], [_INTEGER(m.PRESCRIBE)]))
    laws = ir.FunctionType(_INTEGER, [*tables, _FLOAT]).as_pointer()
    builder.call(builder.inttoptr(address, laws), function.args[:5])
    Emitter(builder, tape, places(builder, tape, [[*arrays, *given]]), exact=exact).emit()
    builder.ret(_INTEGER(0))
    return str(module)


def places(builder: ir.IRBuilder, tape: Program, given: list[Any]) -> Callable:
    """Return the function `where` that gives the address of an array's element in a lane, from offsets looked up once.

    given: h, f, w, n, y and dy of each lane; for a tangent also offsets of its changes (`batched.differentiated`).
    """
    begins, arrays = dict[Any, Any](), list[dict[str, Any]]()
    places = [(array, index) for array, index, _ in tape.stores] + loads(tape)
    places = [(array, found[0] if (found := topologies.base_and_offset(index)) else index) for array, index in places]
    stretches = sorted(
        {(array, topologies.stretch_and_offset(index)[0]) for array, index in places if isinstance(index, int)}
    )
    for lane, (h, f, w, n, *states) in enumerate(given):
        arrays.append({"h": h, "f": f, "w": w, "n": n})
        reported, changes = {-1: _INTEGER(0)}, states[2:]
        builder.store(states[0], builder.gep(n, [_INTEGER(m.STATE)]))
        reported |= {topologies.STATE: states[0], topologies.RATES: states[1]}
        if changes:
            arrays[lane] |= {"df": builder.gep(f, [changes[0]]), "dw": builder.gep(w, [changes[1]])}
            reported |= {topologies.STATE_CHANGE: changes[2], topologies.RATES_CHANGE: changes[3]}
        for array, stretch in stretches:
            begin = reported.get(stretch)
            if begin is None:
                begin = builder.load(builder.gep(h, [_INTEGER(stretch)]))
            begins[array, stretch, lane] = builder.gep(arrays[lane][array], [begin])

    def where(array: str, index: Any, lane: int) -> Any:
        if isinstance(index, tuple):
            stretch, inside = topologies.stretch_and_offset(index[0])
            return builder.gep(begins[array, stretch, lane], [builder.add(index[1], _INTEGER(inside))])
        if not isinstance(index, int):
            return builder.gep(arrays[lane][array], [index])
        stretch, inside = topologies.stretch_and_offset(index)
        return builder.gep(begins[array, stretch, lane], [_INTEGER(inside)])

    return where
