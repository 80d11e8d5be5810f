"""LLVM code of routines, and of the function that runs a list of their calls.

The function is ``evaluate(h, f, w, n, t, y, dy)`` as steps call it: it evaluates the laws of time at t, then calls
each code of the list whose address is at a place in h (`memory`), and reports in n the status that is the list's first
result. The list is four words: number of calls, addresses of their codes and of their offsets, address of the results.
For lists that do not evaluate, that address is a last argument.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from flexclear.dynamics import memory as m
from flexclear.dynamics.routines.calls import ARRAYS, MODES, Code
from flexclear.dynamics.specialise.code import Emitter

#: name of the function in each text
NAME = "routine"
_WORD, _OFFSET, _FLOAT = ir.IntType(64), ir.IntType(32), ir.DoubleType()
#: of routines, which return how many entries of the list to go on: the arrays, and the offsets of the call's runs
_ROUTINE = ir.FunctionType(
    _WORD, [*((_WORD if array == MODES else _FLOAT).as_pointer() for array in ARRAYS), _OFFSET.as_pointer()]
)
_EVALUATE = ir.FunctionType(
    _WORD,
    [*(kind.as_pointer() for kind in (_WORD, _FLOAT, _FLOAT, _WORD)), _FLOAT, _WORD, _WORD],
)


def routine_text(code: Code) -> str:
    """Return the LLVM text of a traced routine."""
    function, builder = _begin_function(_ROUTINE)
    arrays, offsets = dict(zip(ARRAYS, function.args, strict=False)), function.args[-1]
    begins = {}
    for k, array in enumerate(code.runs):
        offset = builder.load(builder.gep(offsets, [_OFFSET(k)]))
        begins[str(k)] = builder.gep(arrays[array], [offset])

    def where(run: str, k: Any, lane: int) -> Any:
        return builder.gep(begins[run], [_OFFSET(k) if isinstance(k, int) else k])

    Emitter(builder, code.program, where).emit()
    onward: Any = _WORD(1)
    if not code.program.stores:  # `calls.BACK`
        again = builder.fcmp_ordered(">", builder.load(begins["0"]), _FLOAT(0.5))
        entries = builder.sext(builder.load(builder.gep(offsets, [_OFFSET(1)])), _WORD)
        onward = builder.select(again, builder.neg(entries), onward)
    builder.ret(onward)
    return str(builder.module)


def interpreter_text(place: int | None) -> str:
    """Return the LLVM text of the function that runs the list of calls at a place of h, or one that it is given."""
    function, builder = _begin_function(_EVALUATE if place else ir.FunctionType(_WORD, [*_EVALUATE.args, _WORD]))
    h, f, w, n, t, y, dy, *given = function.args
    if place:
        laws = ir.FunctionType(_WORD, _EVALUATE.args[:5]).as_pointer()
        builder.call(builder.inttoptr(_load_word(builder, h, m.PRESCRIBE), laws), [h, f, w, n, t])
    head = builder.inttoptr(given[0] if given else _load_word(builder, h, place), _WORD.as_pointer())
    count, codes, offsets, results = (_load_word(builder, head, k) for k in range(4))
    codes, offsets = (builder.inttoptr(one, _WORD.as_pointer()) for one in (codes, offsets))
    results = builder.inttoptr(results, _FLOAT.as_pointer())
    arrays = [
        f,
        builder.gep(w, [y]),
        builder.gep(w, [dy]),
        w,
        results,
        builder.gep(n, [_load_word(builder, n, m.MODE)]),
    ]
    before, loop, after = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.branch(loop)
    builder.position_at_end(loop)
    k = builder.phi(_WORD)
    code, where = (_load_word(builder, table, k) for table in (codes, offsets))
    routine, where = builder.inttoptr(code, _ROUTINE.as_pointer()), builder.inttoptr(where, _OFFSET.as_pointer())
    following = builder.add(k, builder.call(routine, [*arrays, where]))
    k.add_incoming(_WORD(0), before)
    k.add_incoming(following, loop)
    builder.cbranch(builder.icmp_signed("<", following, count), loop, after)
    builder.position_at_end(after)
    status = builder.fptosi(builder.load(results), _WORD)
    reports = {m.EVALUATION: status} | ({m.STATE: y, m.ABRIDGED: _WORD(int(place == m.CALLS))} if place else {})
    for index, value in reports.items():
        builder.store(value, builder.gep(n, [_WORD(index)]))
    builder.ret(_WORD(0))
    return str(builder.module)


def _begin_function(kind: ir.FunctionType) -> tuple[ir.Function, ir.IRBuilder]:
    function = ir.Function(ir.Module(NAME), kind, NAME)
    return function, ir.IRBuilder(function.append_basic_block())


def _load_word(builder: ir.IRBuilder, words: Any, index: Any) -> Any:
    return builder.load(builder.gep(words, [index if isinstance(index, ir.Value) else _WORD(index)]))
