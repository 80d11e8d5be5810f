"""Results for other programs: files of the format that a name ends with (``run --out x.csv``), and JSON for scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Hashable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.artifacts.disk import publish
from flexclear.pipeline.core.artifacts.store import write_dataset
from flexclear.pipeline.core.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: by ending: library that writes it, where that is not installed with this program
NEEDS = {".nc": "", ".csv": "", ".mat": "", ".parquet": "pyarrow", ".xlsx": "openpyxl"}
KNOWN = ", ".join(NEEDS)


def check_format(target: Path, endings: Sequence[str] = tuple(NEEDS), option: str = "--out") -> None:
    """InputError for a name whose ending is no known format, or one whose library is missing; before the work."""
    if target.suffix not in endings:
        raise InputError(f"{option} {target}", f"'{target.suffix}' is no known format", f"known: {', '.join(endings)}")
    library = NEEDS.get(target.suffix, "")
    if library and find_spec(library) is None:
        raise InputError(f"{option} {target}", f"needs the library {library}", f"pip install {library}, or write .csv")


def write(dataset: xr.Dataset, target: Path, rows: Sequence[Hashable] = ("time",)) -> None:
    """Write a dataset: ``.nc`` and ``.mat`` hold all of it, tables what has the dimensions `rows`."""
    if target.suffix == ".nc":
        write_dataset(target, dataset)
        return
    from flexclear.pipeline.core.artifacts.table import table

    made: dict[str, Callable[[], bytes]] = {
        ".csv": lambda: table(dataset, rows).to_csv().encode(),
        ".parquet": lambda: _written(table(dataset, rows).to_parquet),
        ".xlsx": lambda: _written(table(dataset, rows).to_excel),
        ".mat": lambda: _matlab(dataset),
    }
    publish(target, made[target.suffix]())


def _matlab(dataset: xr.Dataset) -> bytes:
    """All variables and coordinates as arrays of a MATLAB file, words as cells."""
    from scipy.io import savemat

    arrays = {str(name): array.values for name, array in dataset.variables.items()}
    columns = {name: values.astype(object) if values.dtype.kind in "UO" else values for name, values in arrays.items()}
    return _written(lambda file: savemat(file, columns, long_field_names=True))


def _written(write_to: Callable[[Any], object]) -> bytes:
    from io import BytesIO

    file = BytesIO()
    write_to(file)
    return file.getvalue()


def as_json(value: object) -> str:
    """A result as JSON; datasets as their variables with dimensions, units and values, and their attributes."""
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
    """Numbers of an array as lists; those that JSON does not have are null."""
    plain = values.tolist() if hasattr(values, "tolist") else values
    if isinstance(plain, list):
        return [_finite(value) for value in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
