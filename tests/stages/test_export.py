"""Datasets written as the file's name says."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts.recorded import as_table
from flexclear.stages import export
from flexclear.system.errors import InputError


@pytest.fixture
def dataset() -> xr.Dataset:
    position = np.arange(12.0).reshape(2, 2, 3)
    return xr.Dataset(
        {
            "position": (("time", "body", "axis"), position, {"units": "m"}),
            "kinetic": ("time", [1.0, 2.0], {"units": "J"}),
            "event_kind": ("event", np.array([], dtype=str)),
            "horizon": ((), 0.1, {"units": "s"}),
        },
        {"time": [0.0, 0.5], "body": ["crank", "rod"], "axis": ["x", "y", "z"]},
    )


def test_a_table_has_a_column_for_each_component(dataset: xr.Dataset) -> None:
    found = as_table(dataset)
    assert list(found.columns[:3]) == ["position crank x [m]", "position crank y [m]", "position crank z [m]"]
    assert found.shape == (2, 7)
    assert found["position rod z [m]"].tolist() == [5.0, 11.0]
    assert found.index.tolist() == [0.0, 0.5]


def test_a_sweep_has_a_row_for_each_point() -> None:
    """Rows are the combinations of all parameters, the last of which varies fastest; coordinates have units."""
    c = ("c", [1e-4, 2e-4], {"units": "m"})
    data = xr.Dataset(
        {"v": (("c", "mu", "axis"), np.arange(12.0).reshape(2, 3, 2), {"units": "m/s"}), "grid": ("mu", [1, 2, 3])},
        {"c": c, "mu": [0.0, 0.1, 0.2], "axis": ["x", "y"]},
    )
    found = as_table(data, ("c", "mu"))
    assert found.index.names == ["c [m]", "mu"]
    assert found.index.tolist()[:4] == [(1e-4, 0.0), (1e-4, 0.1), (1e-4, 0.2), (2e-4, 0.0)]
    assert found["v y [m/s]"].tolist() == [1.0, 3.0, 5.0, 7.0, 9.0, 11.0]
    assert list(found.columns) == ["v x [m/s]", "v y [m/s]"]


def test_what_is_written_can_be_read(dataset: xr.Dataset, tmp_path: Path) -> None:
    import pandas as pd
    from scipy.io import loadmat

    for name in ("run.csv", "run.mat"):
        export.check_format(tmp_path / name)
        export.write(dataset, tmp_path / name)
    table = pd.read_csv(tmp_path / "run.csv", index_col=0)
    assert table["kinetic [J]"].tolist() == [1.0, 2.0]
    matlab = loadmat(tmp_path / "run.mat", squeeze_me=True)
    assert np.array_equal(matlab["position"], dataset.position.values)
    assert matlab["body"].tolist() == ["crank", "rod"]


@pytest.mark.parametrize("name", ["run", "run.hdf", "run.nc4", "run.zarr"])
def test_a_name_that_says_no_known_format_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown format .*\n  hint: known: \.nc, \.csv"):
        export.check_format(tmp_path / name)


def test_a_format_whose_library_is_missing_says_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="needs the library openpyxl"):
        export.check_format(tmp_path / "run.xlsx")
