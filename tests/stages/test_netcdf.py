"""Files of labelled arrays hold what xarray writes into its own and reads, since users meet them with xarray."""

import sys
from pathlib import Path
from types import ModuleType

import netCDF4
import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts import netcdf
from flexclear.artifacts.labelled import label_arrays, label_dataset


def everything() -> xr.Dataset:
    """All types of values, texts that are no ASCII, empty dimensions, and coordinates of every kind."""
    return xr.Dataset(
        {
            "position": (("time", "body"), np.arange(12.0).reshape(4, 3), {"units": "m", "long_name": "place"}),
            "closed": (("time",), np.array([True, False, True, True]), {"long_name": "whether closed"}),
            "any_closed": ((), np.array(True)),
            "speed": (("time",), np.array([1.0, np.nan, -0.0, np.inf])),
            "rank": (("time",), np.arange(4, dtype=np.int32)),
            "count": (("body",), np.arange(3)),
            "single": (("time",), np.ones(4, dtype=np.float32)),
            "small": (("time",), np.arange(4, dtype=np.uint8)),
            "word": ((), "loose"),
            "law": (("body",), ["Hertz", "Flores é µ", ""]),
            "event_kind": (("event",), np.zeros(0, dtype="U1")),
            "event_time": (("event",), np.zeros(0)),
        },
        coords={
            "time": ("time", np.arange(4) * 1e-4, {"units": "s"}),
            "body": ["ball", "rod", "platform"],
            "body_kind": ("body", ["rigid", "flexible", "rigid"]),
            "alone": ("nowhere_else", np.arange(2)),
            "start": 1.5,
        },
        attrs={"title": "µ", "evaluations": 12, "share": 0.25, "list": ["a", "b"], "numbers": np.arange(3)},
    )


def by_xarray(path: Path, data: xr.Dataset) -> bytes:
    """The file that xarray writes when it is asked for sums and, when large, for deflated arrays."""
    packed: dict[str, object] = {"fletcher32": True}
    if data.nbytes >= netcdf.COMPRESSED:
        packed |= {"zlib": True, "complevel": 1}
    encoding = {str(n): packed for n, v in data.variables.items() if v.ndim and v.size and v.dtype.kind in "fiu"}
    data.to_netcdf(path, engine="netcdf4", encoding=encoding)
    return path.read_bytes()


def content(path: Path) -> dict[str, object]:
    """All that the NetCDF library tells of a file, in the order in which it stands there."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {
            "format": file.data_model,
            "attributes": [(name, np.asarray(file.getncattr(name)).tolist()) for name in file.ncattrs()],
            "dimensions": [(name, len(dim), dim.isunlimited()) for name, dim in file.dimensions.items()],
            "variables": [
                (
                    name,
                    one.dimensions,
                    str(one.dtype),
                    one.endian(),
                    one.chunking(),
                    one.filters(),
                    [(key, str(np.asarray(one.getncattr(key)).dtype), one.getncattr(key)) for key in one.ncattrs()],
                    np.asarray(one[...]).tolist() if one.dtype is str else np.asarray(one[...]).tobytes(),
                )
                for name, one in file.variables.items()
            ],
        }


@pytest.mark.parametrize("bound", [netcdf.COMPRESSED, 0], ids=["plain", "compressed"])
def test_files_hold_what_those_of_xarray_do(bound: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every name, attribute, dimension, filter, chunk and value, in the same order; only their places differ."""
    monkeypatch.setattr(netcdf, "COMPRESSED", bound)
    netcdf.write(tmp_path / "ours.nc", label_dataset(everything()))
    by_xarray(tmp_path / "theirs.nc", everything())
    # as texts: not a number, which fills what was not written, equals nothing
    assert repr(content(tmp_path / "ours.nc")) == repr(content(tmp_path / "theirs.nc"))


def test_what_is_read_is_what_xarray_reads(tmp_path: Path) -> None:
    content = by_xarray(tmp_path / "theirs.nc", everything())
    found, theirs = netcdf.read(content), xr.load_dataset(content, engine="netcdf4", decode_times=False)
    assert found.to_xarray().identical(theirs)
    assert list(found.variables) == list(theirs.variables)
    assert [array.values.dtype for array in found.variables.values()] == [v.dtype for v in theirs.variables.values()]


def test_files_are_written_while_another_thread_imports_xarray(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By then there is a module, but without its lock."""
    theirs, name = by_xarray(tmp_path / "theirs.nc", everything()), "xarray.backends.netCDF4_"
    monkeypatch.setitem(sys.modules, name, ModuleType(name))
    netcdf.write(tmp_path / "a.nc", label_dataset(everything()))
    assert repr(netcdf.read((tmp_path / "a.nc").read_bytes())) == repr(netcdf.read(theirs))


def test_arrays_of_one_dimension_are_of_one_length() -> None:
    with pytest.raises(ValueError, match="x has the shape"):
        label_arrays({"x": (("t",), np.zeros(2)), "y": (("t",), np.zeros(3))}, {})
