"""Arrays with named dimensions: the form of runs and of derived data from the engine to the disk.

xarray's datasets contain the same with many operations on top; users get these. Importing xarray takes 1.5 s of
processor time, NumPy and netCDF4 0.3 s, so data that is only written, read back and processed does without xarray.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

#: inputs of stages that use only names, dimensions and values
Labelled: TypeAlias = "xr.Dataset | LabelledArrays"


@dataclass(frozen=True)
class LabelledArray:
    """Values with a name for each dimension, and attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class LabelledArrays:
    """Arrays by name, in the order in which they are written; `coords` names the arrays that label dimensions.

    Raises ValueError when arrays have different lengths along the same dimension.
    """

    variables: Mapping[str, LabelledArray]
    coords: frozenset[str]
    attrs: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, array in self.variables.items():
            if array.values.shape != tuple(self.sizes[dim] for dim in array.dims):
                raise ValueError(f"{name} has the shape {array.values.shape}, its dimensions are {self.sizes}")

    def __getitem__(self, name: str) -> LabelledArray:
        return self.variables[name]

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the arrays that are not coordinates."""
        return (name for name in self.variables if name not in self.coords)

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension, in the order of the arrays."""
        return {
            dim: length
            for array in self.variables.values()
            for dim, length in zip(array.dims, array.values.shape, strict=True)
        }

    @property
    def nbytes(self) -> int:
        """Size of all values [bytes]."""
        return sum(array.values.nbytes for array in self.variables.values())

    def assign_attrs(self, **text: Any) -> LabelledArrays:
        """Return a copy with more attributes."""
        return replace(self, attrs={**self.attrs, **text})

    def assign_coords(self, coordinates: Mapping[str, LabelledArray]) -> LabelledArrays:
        """Return a copy with these coordinates last; they replace arrays of the same names."""
        remaining = {name: array for name, array in self.variables.items() if name not in coordinates}
        return replace(self, variables=remaining | dict(coordinates), coords=self.coords | coordinates.keys())

    def to_xarray(self) -> xr.Dataset:
        """Return an xarray dataset that shares the values."""
        import xarray as xr

        every = {name: xr.Variable(a.dims, a.values, dict(a.attrs)) for name, a in self.variables.items()}
        return xr.Dataset(every, attrs=dict(self.attrs)).set_coords(list(self.coords))


def label_arrays(
    variables: Mapping[str, tuple[tuple[str, ...], Any]], coords: Mapping[str, Any], **attrs: Any
) -> LabelledArrays:
    """Return arrays from (dimensions, values) by name, coordinates last.

    coords: pairs likewise, or only the entries of the dimension of that name, or labelled arrays.
    """
    named = {name: _array(name, value) for name, value in {**variables, **coords}.items()}
    return LabelledArrays(named, frozenset(coords), attrs)


def _array(name: str, value: Any) -> LabelledArray:
    if isinstance(value, LabelledArray):
        return value
    if not isinstance(value, tuple):
        return LabelledArray((name,), np.asarray(value))
    dims, values, *attrs = value
    return LabelledArray((dims,) if isinstance(dims, str) else tuple(dims), np.asarray(values), *attrs)


def label_dataset(dataset: xr.Dataset | LabelledArrays) -> LabelledArrays:
    """Return the labelled arrays of a dataset; values are shared."""
    if isinstance(dataset, LabelledArrays):
        return dataset
    variables = {
        str(name): LabelledArray(tuple(map(str, variable.dims)), variable.values, variable.attrs)
        for name, variable in dataset.variables.items()
    }
    return LabelledArrays(variables, frozenset(map(str, dataset.coords)), dataset.attrs)
