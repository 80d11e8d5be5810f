"""Datasets in NetCDF files that somebody names by their path, read in the child process."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.external_files import isolated
from flexclear.pipeline.core.external_files.checks import require_file
from flexclear.pipeline.core.version import DISTRIBUTION

if TYPE_CHECKING:
    import xarray as xr


def read(path: Path) -> xr.Dataset:
    """The dataset in a file.

    Raises InputError for what is no scene's (a sweep's, another program's), and as `isolated.read` does.
    """
    import xarray as xr

    require_file(path, str(path))
    try:
        dataset = isolated.read(parsed, path)
    except isolated.UnreadableError as error:
        raise InputError(str(path), f"cannot be read as a NetCDF dataset: {error}", _REMEDY) from None
    if not str(dataset["attributes"].get("source")).startswith(f"{DISTRIBUTION} "):
        why = "is a dataset, but no scene's: it has no attribute `source` that names flexclear"
        raise InputError(str(path), why, _REMEDY)
    made = xr.Dataset({name: tuple(variable) for name, variable in dataset["variables"].items()})
    return made.set_coords(dataset["coordinates"]).assign_attrs(dataset["attributes"])


_REMEDY = "name a scene, or a file below results/runs such as run.nc; xarray.open_dataset opens any other"


def parsed(path: Path) -> dict[str, Any]:
    """What `read` says, in the child: dimensions, values and attributes of each variable."""
    import xarray as xr

    data = xr.load_dataset(path, engine="netcdf4")
    return {
        "attributes": data.attrs,
        "coordinates": [str(name) for name in data.coords],
        "variables": {
            str(name): [list(variable.dims), variable.values, variable.attrs]
            for name, variable in data.variables.items()
        },
    }
