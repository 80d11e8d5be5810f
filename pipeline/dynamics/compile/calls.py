"""Calls between functions that are compiled apart, each once, through addresses in the header of h.

A right-hand side that is composed into its integrator is optimised again in every function between
the two, and every mechanism needs an integrator of its own. Called by its address it is compiled
once, and so is the integrator, for all mechanisms. A call costs some nanoseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from llvmlite import ir
from numba import cfunc, config, njit, types
from numba.extending import intrinsic

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel

_INTEGERS, _FLOATS, _PLACE = types.CPointer(types.int64), types.CPointer(types.float64), types.int64
_TABLES = (_INTEGERS, _FLOATS, _FLOATS, _INTEGERS)
#: C signatures of what is called: (h, f, w, n, t, y, dy), with tolerance; (h, w, y, retractment, out, total)
SIGNATURES = {
    "evaluate": types.int64(*_TABLES, types.float64, _PLACE, _PLACE),
    "project": types.int64(*_TABLES, types.float64, _PLACE, _PLACE, types.float64),
    "retract": types.int64(_INTEGERS, _FLOATS, _PLACE, _PLACE, _PLACE, _PLACE),
}
_ARRAYS = (types.int64[::1], types.float64[::1], types.float64[::1], types.int64[::1])
_TABLE = types.float64[:, ::1]
#: signatures of what Python calls: (h, f, w, n, rows, pieces, tolerance, out); (h, f, w, n, t, repeat, outputs, rows,
#: events)
OBSERVE = types.void(*_ARRAYS, _TABLE, types.int64[:, ::1], types.float64, _TABLE)
ADVANCE = types.void(*_ARRAYS, types.float64, types.int64, types.float64[::1], _TABLE, _TABLE)


@intrinsic
def flat(typingctx: Any, array: Any) -> Any:
    """Where the entries of an array are."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, values[0]).data

    return types.CPointer(array.dtype)(array), generate


@intrinsic
def call(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Integer that the C function at `address` returns for a tuple; of its arrays it gets the first entries' places."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        where, arrays = values
        given = []
        for k in range(len(arguments.types)):
            value = builder.extract_value(arrays, k)
            given.append(value)
        function = ir.FunctionType(ir.IntType(64), [value.type for value in given])
        return builder.call(builder.inttoptr(where, function.as_pointer()), given)

    return types.int64(address, arguments), generate


def exported(name: str) -> Callable[[Callable], Any]:
    """Decorator: a C function with an `address`, fetched from disk or compiled at once."""
    return cfunc(SIGNATURES[name], cache=True, error_model="numpy")


def called(signature: Any) -> Callable[[Callable], Any]:
    """Decorator: a function that Python calls, fetched from disk or compiled at once."""
    return njit(signature, cache=True, nogil=True)


if config.DISABLE_JIT:  # for debugging: the same calls between functions of Python
    interpreted: dict[int, Callable] = {}

    def call(address, arguments):
        """What the function known by this number returns."""
        return interpreted[int(address)](*arguments)

    def exported(name: str) -> Callable[[Callable], Any]:
        """Decorator: the function itself, under a number."""

        def number(function: Callable) -> Any:
            interpreted[id(function)] = function
            return SimpleNamespace(address=id(function))

        return number

    def flat(array):
        """Itself."""
        return array


@kernel
def evaluate(h, f, w, n, t, y, dy):
    """The right-hand side: `equations.right_hand_side`."""
    call(h[m.EVALUATE], (h, f, w, n, float(t), y, dy))


@kernel
def rates(h, f, w, n, t, y, dy):
    """The right-hand side of which steps need only the rates."""
    call(h[m.RATES], (h, f, w, n, float(t), y, dy))


@kernel
def project(h, f, w, n, t, y, dy, tolerance):
    """Back onto the closures: `equations.projection`."""
    return call(h[m.PROJECT], (h, f, w, n, float(t), y, dy, tolerance))


@kernel
def retract(h, w, y, retractment, out, total):
    """Positions after a retractment: `equations.retraction`."""
    call(h[m.RETRACT], (h, w, y, retractment, out, total))
