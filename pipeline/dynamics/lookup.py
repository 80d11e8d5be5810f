"""Looking up a table in h, as code that is where it is called.

An evaluation looks up some seventy different fields. Compiled as functions, each of the length of a line, they took a
sixth of the compilation.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core.typing.templates import make_intrinsic_template


class Lookup:
    """h[index] + size i, or what is in h by `field` beyond that; h: a pointer to integers, or an array of them."""

    def __init__(self, name: str, place: int, size: int, field: int | None) -> None:
        def typed(typing_context: Any, h: Any, i: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                entries, row = values
                if isinstance(h, types.Array):
                    entries = context.make_array(h)(context, builder, entries).data

                def constant(value: int) -> Any:
                    return context.get_constant(types.int64, value)

                def load(index: Any) -> Any:
                    return builder.load(builder.gep(entries, [index]))

                loaded = builder.add(load(constant(place)), builder.mul(constant(size), row))
                return loaded if field is None else load(builder.add(loaded, constant(field)))

            return types.int64(h, types.int64), generate

        self._numba_type_ = types.Function(make_intrinsic_template(self, typed, name))
