"""Named fields (`fields`) as Numba types: one pointer each, with loads and stores where a kernel names a field.

The module uses only Numba's documented extension interface.
"""

from __future__ import annotations

import operator
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    type_callable,
)

from flexclear.dynamics import memory as m
from flexclear.dynamics.fields import data

POINTERS = {
    "h": types.CPointer(types.int64),
    "f": types.CPointer(types.float64),
    "w": types.CPointer(types.float64),
    "n": types.CPointer(types.int64),
}


class Named(types.Type):
    """An object with named fields, or rows of such objects."""


class DataType(Named):
    """The four arrays h, f, w and n."""


class Table(Named):
    """A table, as a pointer to its first row."""

    def __init__(self, table: str) -> None:
        super().__init__(f"Table({table})")
        self.table, self.pointer = table, POINTERS[m.ARRAYS[table]]


class Row(Named):
    """A row of a table, as a pointer to its first field."""

    def __init__(self, table: str) -> None:
        super().__init__(f"Row({table})")
        self.pointer, self.fields = POINTERS[m.ARRAYS[table]], m.row_fields(table)

    def kind(self, field: str) -> Any:
        """Return the type of a field."""
        shape = self.fields[field][1]
        if shape in m.TUPLES:
            return types.UniTuple(self.pointer.dtype, m.TUPLES[shape])
        return self.pointer if shape else self.pointer.dtype


DATA = DataType("Data")


@register_model(DataType)
class _DataModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, list(POINTERS.items()))


@register_model(Table)
@register_model(Row)
class _PointerModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("begin", kind.pointer)])


@type_callable(data)
def _of_arrays(context: Any) -> Any:
    def typed(h: Any, f: Any, w: Any, n: Any) -> Any:
        return DATA

    return typed


@lower_builtin(data, types.Any, types.Any, types.Any, types.Any)
def _construct(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    proxy = cgutils.create_struct_proxy(DATA)(context, builder)
    for (name, _), kind, value in zip(POINTERS.items(), signature.args, values, strict=True):
        if isinstance(kind, types.Array):
            value = context.make_array(kind)(context, builder, value).data
        setattr(proxy, name, value)
    return proxy._getvalue()


@infer_getattr
class _DataFields(AttributeTemplate):
    key = DataType

    def generic_resolve(self, kind: Any, name: str) -> Any:
        if name in m.SIZES or name in m.INDICES or name in m.REPORTS:
            return types.int64
        if name in m.FLOATS:
            return types.float64
        if name in m.STRETCHES or name in m.LISTS:
            return POINTERS["w" if name in m.STRETCHES else "n"]
        return Table(name) if name in m.NAMED else POINTERS.get(name)


@infer_getattr
class _RowFields(AttributeTemplate):
    key = Row

    def generic_resolve(self, kind: Any, name: str) -> Any:
        return kind.kind(name) if name in kind.fields else None


@type_callable(operator.getitem)
def _row(context: Any) -> Any:
    def typed(rows: Any, i: Any) -> Any:
        return Row(rows.table) if isinstance(rows, Table) and isinstance(i, types.Integer) else None

    return typed


def _at(context: Any, builder: Any, pointer: Any, offset: int) -> Any:
    return builder.gep(pointer, [context.get_constant(types.int64, offset)])


def _wrapped(context: Any, builder: Any, kind: Any, pointer: Any) -> Any:
    proxy = cgutils.create_struct_proxy(kind)(context, builder)
    proxy.begin = pointer
    return proxy._getvalue()


def _single(context: Any, builder: Any, d: Any, name: str) -> Any:
    """Return the pointer to a single integer of n or float of w."""
    if name in m.REPORTS:
        return _at(context, builder, d.n, m.REPORTS[name])
    stretch, offset = m.FLOATS[name]
    entry = builder.load(_at(context, builder, d.h, stretch))
    return _at(context, builder, builder.gep(d.w, [entry]), offset)


@lower_getattr_generic(DataType)
def _read_data(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    d = cgutils.create_struct_proxy(kind)(context, builder, value=value)
    if name in POINTERS:
        return getattr(d, name)
    if name in m.REPORTS or name in m.FLOATS:
        return builder.load(_single(context, builder, d, name))
    if name in m.LISTS:
        return builder.gep(d.n, [builder.load(_at(context, builder, d.n, m.LISTS[name]))])
    index = m.NAMED[name].at if name in m.NAMED else {**m.SIZES, **m.INDICES, **m.STRETCHES}[name]
    entry = builder.load(_at(context, builder, d.h, index))
    if name in m.SIZES or name in m.INDICES:
        return entry
    if name in m.STRETCHES:
        return builder.gep(d.w, [entry])
    return _wrapped(context, builder, Table(name), builder.gep(getattr(d, m.ARRAYS[name]), [entry]))


@lower_setattr_generic(DataType)
def _write_data(context: Any, builder: Any, signature: Any, values: Any, name: str) -> None:
    d = cgutils.create_struct_proxy(signature.args[0])(context, builder, value=values[0])
    if name not in m.REPORTS and name not in m.FLOATS:
        raise TypeError(f"kernels cannot assign {name}: only single numbers and fields of rows are assigned by name")
    kind = types.int64 if name in m.REPORTS else types.float64
    value = context.cast(builder, values[1], signature.args[1], kind)
    builder.store(value, _single(context, builder, d, name))


@lower_builtin(operator.getitem, Table, types.Integer)
def _read_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    kind = signature.args[0]
    begin = cgutils.create_struct_proxy(kind)(context, builder, value=values[0]).begin
    row = context.cast(builder, values[1], signature.args[1], types.int64)
    offset = builder.mul(row, context.get_constant(types.int64, m.NAMED[kind.table].size))
    return _wrapped(context, builder, signature.return_type, builder.gep(begin, [offset]))


@lower_getattr_generic(Row)
def _read_field(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    begin = cgutils.create_struct_proxy(kind)(context, builder, value=value).begin
    (offset, shape), result = kind.fields[name], kind.kind(name)
    if shape in m.TUPLES:
        entries = [builder.load(_at(context, builder, begin, offset + k)) for k in range(result.count)]
        return context.make_tuple(builder, result, entries)
    entry = _at(context, builder, begin, offset)
    return entry if shape else builder.load(entry)


@lower_setattr_generic(Row)
def _write_field(context: Any, builder: Any, signature: Any, values: Any, name: str) -> None:
    kind = signature.args[0]
    begin = cgutils.create_struct_proxy(kind)(context, builder, value=values[0]).begin
    offset, shape = kind.fields[name]
    if shape and shape not in m.TUPLES:
        raise TypeError(f"kernels cannot assign {kind}.{name} as a whole: assign its entries")
    entries = cgutils.unpack_tuple(builder, values[1]) if shape else [values[1]]
    for k, entry in enumerate(entries):
        builder.store(entry, _at(context, builder, begin, offset + k))
