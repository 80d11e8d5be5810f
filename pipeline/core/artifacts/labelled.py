"""Arrays with named dimensions: what a run, and what follows from it, is from the engine to the disk.

xarray's datasets are the same with many operations on top, and what users are given. Importing xarray takes 1.5 s of
the processor, NumPy and netCDF4 0.3 s, so what is only written, read back and derived from does without it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

#: what stages read, of which names, dimensions and values are asked alone
Labelled: TypeAlias = "xr.Dataset | LabelledArrays"


@dataclass(frozen=True)
class LabelledArray:
    """Values with a name for each dimension, and attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class LabelledArrays:
    """Arrays by name, in the order in which they are written; `coords` are those that name entries of dimensions.

    Arrays of the same dimension have the same length along it, or ValueError is raised.
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
        """Names of what is no coordinate."""
        return (name for name in self.variables if name not in self.coords)

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension, in the order in which arrays name them."""
        return {
            dim: length
            for array in self.variables.values()
            for dim, length in zip(array.dims, array.values.shape, strict=True)
        }

    @property
    def nbytes(self) -> int:
        """Bytes of all values."""
        return sum(array.values.nbytes for array in self.variables.values())

    def assign_attrs(self, **text: Any) -> LabelledArrays:
        """The same with more attributes."""
        return replace(self, attrs={**self.attrs, **text})

    def assign_coords(self, coordinates: Mapping[str, LabelledArray]) -> LabelledArrays:
        """The same with these coordinates last, instead of others of their names."""
        remaining = {name: array for name, array in self.variables.items() if name not in coordinates}
        return replace(self, variables=remaining | dict(coordinates), coords=self.coords | coordinates.keys())

    def to_xarray(self) -> xr.Dataset:
        """The same for users; values are shared."""
        import xarray as xr

        every = {name: xr.Variable(a.dims, a.values, dict(a.attrs)) for name, a in self.variables.items()}
        return xr.Dataset(every, attrs=dict(self.attrs)).set_coords(list(self.coords))


def labelled(
    variables: Mapping[str, tuple[tuple[str, ...], Any]], coords: Mapping[str, Any], **attrs: Any
) -> LabelledArrays:
    """Arrays from (dimensions, values) by name, coordinates last.

    coords: the same, or the entries of the dimension of that name alone, or arrays as they are.
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


def of(dataset: xr.Dataset | LabelledArrays) -> LabelledArrays:
    """Arrays of a dataset; values are shared."""
    if isinstance(dataset, LabelledArrays):
        return dataset
    variables = {
        str(name): LabelledArray(tuple(map(str, variable.dims)), variable.values, variable.attrs)
        for name, variable in dataset.variables.items()
    }
    return LabelledArrays(variables, frozenset(map(str, dataset.coords)), dataset.attrs)
