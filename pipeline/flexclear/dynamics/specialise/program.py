"""Right-hand side of one topology as specialised code: no tables, no loops, only registers and the stack as storage.

The steps call straight code of routines (`mechanics.of_topology`), which stores only what they read
(`mechanics.evaluation.evaluated`); n[ABRIDGED] reports that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from flexclear.dynamics import memory as m
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.specialise.code import Emitter, Program, loads
from flexclear.dynamics.specialise.tape import FLOAT, INTEGER, same
from flexclear.dynamics.specialise.trace import Memory, Trace

#: operations beyond which specialised code takes longer to build than kernels and is hardly faster: it no longer fits
#: the processor's first caches; beyond which lists of calls are faster; and the limit for tangents, which have no list
LONGEST, LONGEST_STRAIGHT, LONGEST_DIFFERENTIATED = 50_000, 20_000, 80_000
#: integers of n that are stored
REPORTS = {m.EVALUATION, m.ABRIDGED}
_INTEGER, _FLOAT = ir.IntType(64), ir.DoubleType()
#: name of the function
NAME = "specialised"


def program(kernel: Callable, topology: topologies.Topology, longest: int = 0) -> Program:
    """Return the program of kernel rates(h, f, w, n, y, dy) for a topology, which stores all of w.

    Raises UnsuitedError when it has more than `longest` operations, or `LONGEST` for 0.
    """
    h, trace = topologies.header(topology), Trace(longest or LONGEST)
    w, f, n = Memory(trace, "w", FLOAT), Memory(trace, "f", FLOAT), Memory(trace, "n", INTEGER)
    ground = topologies.ground(h)
    w.values.update(ground)
    trace.plain(kernel)(h, f, w, n, topologies.start(topologies.STATE), topologies.start(topologies.RATES))
    changed = [(index, v) for index, v in w.values.items() if index not in ground or not same(v, ground[index])]
    reports = [("n", index, v) for index, v in n.values.items() if index in REPORTS]
    return Program(trace.tape.block, [*(("w", *one) for one in changed), *reports])


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
    places = [(array, found[0] if (found := topologies.based(index)) else index) for array, index in places]
    stretches = sorted({(array, topologies.split(index)[0]) for array, index in places if isinstance(index, int)})
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
            stretch, inside = topologies.split(index[0])
            return builder.gep(begins[array, stretch, lane], [builder.add(index[1], _INTEGER(inside))])
        if not isinstance(index, int):
            return builder.gep(arrays[lane][array], [index])
        stretch, inside = topologies.split(index)
        return builder.gep(begins[array, stretch, lane], [_INTEGER(inside)])

    return where
