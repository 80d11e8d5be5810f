"""C functions that Numba compiles, and their calls of others by address (`addresses`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import carray as carray
from numba import cfunc, types
from numba.extending import intrinsic

import flexclear.dynamics.field_types  # noqa: F401  (Numba knows named fields before kernels are compiled)
from flexclear.dynamics.compile.addresses import make_calls
from flexclear.dynamics.compile.files import SIGNATURES, compiles
from flexclear.dynamics.kernels import PLAIN

#: Numba's types of the arguments in `files.SIGNATURES`
TYPES = {"I": types.CPointer(types.int64), "F": types.CPointer(types.float64), "i": types.int64, "f": types.float64}


@intrinsic
def call(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Return the integer that the C function at `address` returns for a tuple; arrays are passed by address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        where, arrays = values
        given = []
        for k, kind in enumerate(arguments.types):
            value = builder.extract_value(arrays, k)
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value=value).data
            given.append(value)
        function = ir.FunctionType(ir.IntType(64), [value.type for value in given])
        return builder.call(builder.inttoptr(where, function.as_pointer()), given)

    return types.int64(address, arguments), generate


def exported(name: str) -> Callable[[Callable], int]:
    """Return the decorator that compiles a C function and returns its address."""
    options: dict[str, Any] = {"error_model": "numpy"}
    if not PLAIN:
        from flexclear.dynamics.lowering import WholeCompiler

        options["pipeline_class"] = WholeCompiler
    arguments = (TYPES[kind] for kind in SIGNATURES[name] if kind != " ")
    return compiles(cfunc(types.int64(*arguments), **options))


_calls = make_calls(call)
evaluate, laws, rates, awaited, project = _calls.evaluate, _calls.laws, _calls.rates, _calls.awaited, _calls.project
correct, retract, resolve = _calls.correct, _calls.retract, _calls.resolve
factor_springs, release_spring = _calls.factor_springs, _calls.release_spring
