"""Results for other programs: files in the format of a name's ending (``run --out x.csv``), and JSON for scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Hashable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.artifacts.disk import publish
from flexclear.artifacts.store import write_dataset
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: library that writes a format, by ending; empty where it is installed with this program
NEEDS = {".nc": "", ".csv": "", ".mat": "", ".npz": "", ".parquet": "pyarrow", ".xlsx": "openpyxl"}
KNOWN = ", ".join(NEEDS)


def check_format(target: Path, endings: Sequence[str] = tuple(NEEDS), option: str = "--out") -> None:
    """Raise InputError when a name's ending is no known format or its library is missing; called before the work."""
    if target.suffix not in endings:
        raise InputError(f"{option} {target}", f"unknown format '{target.suffix}'", f"known: {', '.join(endings)}")
    library = NEEDS.get(target.suffix, "")
    if library and find_spec(library) is None:
        raise InputError(f"{option} {target}", f"needs the library {library}", f"pip install {library}, or write .csv")


def write(dataset: xr.Dataset, target: Path, rows: Sequence[Hashable] = ("time",)) -> None:
    """Write a dataset: tables hold the variables with the dimensions `rows`, other formats everything."""
    if target.suffix == ".nc":
        write_dataset(target, dataset)
        return
    from flexclear.artifacts.recorded import as_table

    made: dict[str, Callable[[], bytes]] = {
        ".csv": lambda: as_table(dataset, rows).to_csv().encode(),
        ".parquet": lambda: _file_bytes(as_table(dataset, rows).to_parquet),
        ".xlsx": lambda: _file_bytes(as_table(dataset, rows).to_excel),
        ".mat": lambda: _matlab(dataset),
        ".npz": lambda: _numpy(dataset),
    }
    publish(target, made[target.suffix]())


def _numpy(dataset: xr.Dataset) -> bytes:
    """Return all variables and coordinates as arrays that ``numpy.load`` reads, text without pickles."""
    from numpy import savez

    arrays = {str(name): array.values for name, array in dataset.variables.items()}
    plain = {name: values.astype(str) if values.dtype.kind in "UO" else values for name, values in arrays.items()}
    return _file_bytes(lambda file: savez(file, allow_pickle=False, **plain))


def _matlab(dataset: xr.Dataset) -> bytes:
    """Return all variables and coordinates as arrays of a MATLAB file, text as cells."""
    from scipy.io import savemat

    arrays = {str(name): array.values for name, array in dataset.variables.items()}
    columns = {name: values.astype(object) if values.dtype.kind in "UO" else values for name, values in arrays.items()}
    return _file_bytes(lambda file: savemat(file, columns, long_field_names=True))


def _file_bytes(write_to: Callable[[Any], object]) -> bytes:
    from io import BytesIO

    file = BytesIO()
    write_to(file)
    return file.getvalue()


def as_json(value: object) -> str:
    """Return a result as JSON; datasets with variables (dimensions, units, values) and attributes."""
    return json.dumps(value, indent=2, default=_plain, allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "data_vars"):
        variables = {
            str(name): {"dims": list(data.dims), "units": data.attrs.get("units", ""), "values": _finite(data.values)}
            for name, data in value.variables.items()
        }
        return {"attributes": dict(value.attrs), "variables": variables}
    return _finite(value) if hasattr(value, "tolist") else str(value)


def _finite(values: Any) -> Any:
    """Return an array's numbers as lists, with null for those that JSON does not have."""
    plain = values.tolist() if hasattr(values, "tolist") else values
    if isinstance(plain, list):
        return [_finite(value) for value in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
