"""Named fields of the arrays h, f, w and n: kernels read and write the declarations of `memory` by name.

After ``d = data(h, f, w, n)``, ``d.nv`` is a size, ``d.bias[k]`` an entry of an array in w, ``d.links[i].parent`` a
field of a row of a table, ``d.rtol`` a float of w, ``d.evaluation`` an integer of n, and ``d.mode[c]`` an entry of an
stretch of n.  The names are those of `memory` in small letters.  ``d.at_y`` and ``d.at_links`` are the indices where
the array y and the table of links begin, for kernels that take indices.  A field of three numbers is a vector and one
of 3 x 3 numbers a matrix, both tuples that are read and assigned as a whole.  A field of any other shape is indexed
like an array.

Interpreted kernels and the tracer (`specialise`) use the classes here; compiled kernels get the same names from
`field_types`, as loads and stores.  The compiler assumes that no two pointers of a kernel refer to the same memory, so
a kernel that writes never receives `d` together with a row or array of `d`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m


class Stretch:
    """Entries of an array from an offset on."""

    __slots__ = ("array", "begin")

    def __init__(self, array: Any, begin: Any) -> None:
        self.array, self.begin = array, begin

    def __getitem__(self, k: Any) -> Any:
        return self.array[self.begin + k]

    def __setitem__(self, k: Any, value: Any) -> None:
        self.array[self.begin + k] = value


class Rows(Stretch):
    """Rows of a table; each table has a subclass."""

    __slots__ = ()
    size: int
    row: type[Stretch]

    def __getitem__(self, i: Any) -> Any:
        return self.row(self.array, self.begin + self.size * i)


class Data:
    """The four arrays, with their contents by name."""

    __slots__ = ("f", "h", "n", "w")

    def __init__(self, h: Any, f: Any, w: Any, n: Any) -> None:
        self.h, self.f, self.w, self.n = h, f, w, n


def _entry(where: Callable[[Any], tuple[Any, Any]]) -> property:
    """Return a property for the entry of an array; `where` returns array and index."""

    def read(of: Any) -> Any:
        array, index = where(of)
        return array[index]

    def write(of: Any, value: Any) -> None:
        array, index = where(of)
        array[index] = value

    return property(read, write)


def _tuple(offset: int, count: int) -> property:
    def read(row: Stretch) -> Any:
        return tuple(row.array[row.begin + offset + k] for k in range(count))

    def write(row: Stretch, values: Any) -> None:
        for k, value in zip(range(count), values, strict=True):
            row.array[row.begin + offset + k] = value

    return property(read, write)


def _field(offset: int, shape: tuple[int, ...]) -> property:
    if shape in m.TUPLES:
        return _tuple(offset, m.TUPLES[shape])
    if shape:
        return property(lambda row: Stretch(row.array, row.begin + offset))
    return _entry(lambda row: (row.array, row.begin + offset))


def _rows(name: str) -> property:
    fields = {field: _field(*where) for field, where in m.row_fields(name).items()}
    row = type(name, (Stretch,), {"__slots__": (), **fields})
    kind = type(name, (Rows,), {"__slots__": (), "size": m.NAMED[name].size, "row": row})
    array, index = m.ARRAYS[name], m.NAMED[name].at
    return property(lambda d: kind(getattr(d, array), d.h[index]))


def _size(index: int) -> property:
    return property(lambda d: d.h[index])


def _stretch(index: int) -> property:
    return property(lambda d: Stretch(d.w, d.h[index]))


def _list(index: int) -> property:
    return property(lambda d: Stretch(d.n, d.n[index]))


def _float(where: tuple[int, int]) -> property:
    stretch, offset = where
    return _entry(lambda d: (d.w, d.h[stretch] + offset))


def _integer(index: int) -> property:
    return _entry(lambda d: (d.n, index))


_MAKERS: tuple[tuple[Callable[[Any], property], dict[str, Any]], ...] = (
    (_size, m.SIZES | m.INDICES),
    (_stretch, m.STRETCHES),
    (_float, m.FLOATS),
    (_integer, m.REPORTS),
    (_list, m.LISTS),
)
for _made, _places in _MAKERS:
    for _name, _place in _places.items():
        setattr(Data, _name, _made(_place))
for _name in m.NAMED:
    setattr(Data, _name, _rows(_name))


def data(h: Any, f: Any, w: Any, n: Any) -> Any:
    """Return the four arrays with named fields; compiled code uses the version in `field_types`."""
    return Data(h, f, w, n)
