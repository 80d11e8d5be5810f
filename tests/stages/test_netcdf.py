"""Files of labelled arrays hold what xarray writes into its own and reads, since users meet them with xarray."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import netCDF4
import numpy as np
import pytest
import xarray as xr

from flexclear.commands.new import write
from flexclear.pipeline.core.artifacts import netcdf, store
from flexclear.pipeline.core.artifacts.labelled import LabelledArray, LabelledArrays, labelled, of
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import open_workplace


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
    netcdf.write(tmp_path / "ours.nc", of(everything()))
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
    name = "xarray.backends.netCDF4_"
    monkeypatch.setitem(sys.modules, name, ModuleType(name))
    netcdf.write(tmp_path / "a.nc", of(everything()))
    assert_same(netcdf.read((tmp_path / "a.nc").read_bytes()), netcdf.as_read(of(everything())))


def assert_same(one: LabelledArrays, other: LabelledArrays) -> None:
    """The same names in the same order, dimensions, attributes of the same types, and values to the last bit.

    Also how values lie in memory: what is summed up in another order is rounded otherwise.
    """
    assert list(one.variables) == list(other.variables)
    assert one.coords == other.coords
    for name in one.variables:
        a, b = one[name].values, other[name].values
        assert (name, one[name].dims, a.dtype, a.shape) == (name, other[name].dims, b.dtype, b.shape)
        assert (a.flags.c_contiguous, a.flags.writeable) == (b.flags.c_contiguous, b.flags.writeable), name
        # not a number is what it was, signs of zero as well
        assert a.tolist() == b.tolist() if a.dtype.kind == "U" else a.tobytes() == b.tobytes(), name
    for a, b in zip((one, *one.variables.values()), (other, *other.variables.values()), strict=True):
        assert repr(dict(a.attrs)) == repr(dict(b.attrs))  # NumPy's numbers tell their type


def odd() -> LabelledArrays:
    """Values that do not lie in memory as those of a file: in other orders, in pieces, of others, for reading alone."""
    frozen = np.arange(20_000.0)
    frozen.setflags(write=False)
    every = {
        "across": (("row", "column"), np.arange(40_000.0).reshape(200, 200).T),
        "every_second": (("row",), np.arange(400)[::2]),
        "big_endian": (("row",), np.arange(200, dtype=">f8")),
        "spread": (("row", "column"), np.broadcast_to(1.5, (200, 200))),
        "frozen": (("many",), frozen),
        "wide_text": (("two",), np.array(["a", "bc"], dtype="U40")),
        "objects": (("two",), np.array(["a", "µ"], dtype=object)),
        "word": ((), np.array("loose", dtype=object)),
        "true": ((), np.array(True)),
        "none": (("never", "column"), np.zeros((0, 200))),
    }
    odd_attributes = {"one": ["a"], "tuple": ("a", "b"), "single": np.ones(1), "whole": np.int32(3), "few": [1, 2]}
    data = labelled(every, {"row": np.arange(200) * 0.5, "name": (("two",), np.array(["x", "y"]))}, **odd_attributes)
    return data.assign_coords({"column": LabelledArray(("column",), np.arange(200), {"empty": "", "half": 0.5})})


@pytest.mark.parametrize("data", [of(everything()), odd()], ids=["everything", "odd"])
def test_what_is_kept_of_what_was_written_is_what_would_be_read(data: LabelledArrays, tmp_path: Path) -> None:
    netcdf.write(tmp_path / "a.nc", data)
    assert_same(netcdf.as_read(data), netcdf.read((tmp_path / "a.nc").read_bytes()))


def test_what_is_kept_holds_no_more_than_itself() -> None:
    """A part of a larger array would keep all of it, and change with what else lies there."""
    whole = np.zeros((3, 20_000))
    data = labelled(
        {"part": (("many",), whole[0]), "same": (("many",), whole[0]), "own": (("many",), np.ones(20_000))}, {}
    )
    kept = netcdf.as_read(data)
    kept["part"].values[:] = 1.0
    assert not whole.any()
    assert not kept["same"].values.any()
    assert all(array.values.base is None for array in kept.variables.values())
    assert kept["own"].values is data["own"].values


def test_what_all_stages_write_is_kept_as_it_would_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes, modes, bodies, a run with contacts and its twin, its series: at the moment at which they are written."""
    seen: dict[str, LabelledArrays] = {}
    keep = store._store

    def checked(path: Path, dataset: xr.Dataset | LabelledArrays) -> str:
        digest = keep(path, dataset)
        _, kept = store._STORED[digest]
        assert_same(kept, netcdf.read(path.read_bytes()))
        seen[path.parent.name] = kept
        return digest

    monkeypatch.setattr(store, "_store", checked)
    monkeypatch.setattr(netcdf, "_LARGE", 0)  # nothing is copied that need not be
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    scene, _ = write("slider-crank", tmp_path)
    for end in ("2 ms", "3 ms"):
        before = {name: {n: a.values.copy() for n, a in data.variables.items()} for name, data in seen.items()}
        held = dict(seen)
        graph = Graph(load_scene(scene, {"time.end": end}))
        outcome = open_workplace().bring([graph.post], jobs=1)
        assert not outcome.failures
        # nothing of the engine lies in what it has returned: another run in the same process changes none of it
        for name, values in before.items():
            assert all(
                np.array_equal(held[name][n].values, v, equal_nan=v.dtype.kind == "f") for n, v in values.items()
            )
    assert {"mesh", "modes", "bundle", "simulate", "post"} <= seen.keys()


def test_arrays_of_one_dimension_are_of_one_length() -> None:
    with pytest.raises(ValueError, match="x has the shape"):
        labelled({"x": (("t",), np.zeros(2)), "y": (("t",), np.zeros(3))}, {})
