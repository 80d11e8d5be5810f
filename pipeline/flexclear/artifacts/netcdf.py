"""NetCDF-4 files of labelled arrays, in the conventions of xarray: the only writer and the only reader.

Conventions that xarray adds to NetCDF are here, too: attributes `coordinates` list coordinates, Booleans are stored as
bytes with the attribute `dtype`, and unwritten floats are NaN.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from flexclear.artifacts.labelled import LabelledArray, LabelledArrays

#: size above which datasets are compressed, since disk space then counts more than time [bytes]
COMPRESSED = 1 << 26
#: types that the library requires for kinds of values that it does not accept as they are
_TAKEN = {"U": np.dtype("O"), "b": np.dtype("i1")}
_LOCK = Lock()
_COORDINATES, _BOOL, _FILL = "coordinates", {"dtype": "bool"}, "_FillValue"


def write(path: Path, data: LabelledArrays) -> None:
    """Write a file; OSError or RuntimeError of the library where it fails.

    Numeric arrays carry fletcher32 checksums, so that other programs notice damage, too, wherever the file goes;
    without them writing takes three quarters of the time. From `COMPRESSED` bytes on arrays are deflated. For smaller
    files deflating takes longer than computing the run, since recorded values have few spare digits. Values are written
    after all definitions: each change between the two makes the library flush, which took as long as the rest.
    """
    import netCDF4

    listed, whole = _coordinate_lists(data)
    compress = data.nbytes >= COMPRESSED
    with _lock_library(), netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        for name, value in {**data.attrs, **whole}.items():
            texts = isinstance(value, (list, tuple)) and len(value) and all(isinstance(one, str) for one in value)
            (file.setncattr_string if texts else file.setncattr)(name, value)
        for dim, length in data.sizes.items():
            file.createDimension(dim, length)
        every = [_define(file, name, one, listed.get(name, {}), compress) for name, one in data.variables.items()]
        for variable, array in zip(every, data.variables.values(), strict=True):
            dtype = array.values.dtype
            variable[...] = array.values.astype(_TAKEN.get(dtype.kind, dtype), copy=False)


@contextlib.contextmanager
def _lock_library() -> Iterator[None]:
    """Serialise the use of the library, which is not made for threads, also against its use by xarray."""
    backend = sys.modules.get("xarray.backends.netCDF4_")  # another thread may be importing it, so it may lack its lock
    with _LOCK, getattr(backend, "NETCDF4_PYTHON_LOCK", contextlib.nullcontext()):
        yield


def _define(file: Any, name: str, array: LabelledArray, listed: Mapping[str, str], compress: bool) -> Any:
    """Define a variable of the file, without its values."""
    values, kind = array.values, array.values.dtype.kind
    truth = _BOOL if kind == "b" else {}
    stored_type = str if kind in "OU" else values.dtype.newbyteorder("=") if not truth else np.dtype("i1")
    numeric = bool(values.ndim and values.size and kind in "fiu")
    variable = file.createVariable(
        name,
        stored_type,
        array.dims,
        zlib=numeric and compress,
        complevel=1 if numeric and compress else 4,
        shuffle=True,
        fletcher32=numeric,
        fill_value=values.dtype.type(np.nan) if kind == "f" else None,
    )
    variable.setncatts({**array.attrs, **listed, **truth})
    variable.set_auto_maskandscale(False)
    return variable


def _coordinate_lists(data: LabelledArrays) -> tuple[dict[str, dict[str, str]], dict[str, str]]:
    """Return attribute `coordinates` by array, and that of the file for coordinates that fit no array's dimensions."""
    additional = sorted(data.coords - data.sizes.keys())
    attributes, unlisted = dict[str, dict[str, str]](), set(additional)
    for name, array in data.variables.items():
        if name in additional or name in array.dims:
            continue
        own = [other for other in additional if set(data[other].dims) <= set(array.dims)]
        if own:
            attributes[name] = {_COORDINATES: " ".join(own)}
            unlisted -= set(own)
    return attributes, {_COORDINATES: " ".join(sorted(unlisted))} if unlisted else {}


def read(content: bytes) -> LabelledArrays:
    """Return the arrays in the bytes of a file.

    Raises OSError, ValueError, RuntimeError or TypeError for other bytes.
    """
    import netCDF4

    with _lock_library(), netCDF4.Dataset("in memory", memory=content) as file:
        file.set_auto_maskandscale(False)
        attrs = {name: file.getncattr(name) for name in file.ncattrs()}
        coords = {name for name in file.variables if name in file.dimensions} | set(_remove_coordinate_list(attrs))
        variables = {}
        for name, variable in file.variables.items():
            own = {key: variable.getncattr(key) for key in variable.ncattrs() if key != _FILL}
            coords |= set(_remove_coordinate_list(own))
            values = np.asarray(variable[...], dtype=str if variable.dtype is str else None)
            if own.get("dtype") == "bool":
                del own["dtype"]
                values = values.astype(bool)
            variables[name] = LabelledArray(variable.dimensions, values, own)
    return LabelledArrays(variables, frozenset(coords & variables.keys()), attrs)


def _remove_coordinate_list(attrs: dict[str, Any]) -> list[str]:
    """Remove the list of coordinates from the attributes and return it."""
    return str(attrs.pop(_COORDINATES, "")).split()
