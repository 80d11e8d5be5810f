"""Datasets of runs in Python, with the scene that was run, and any dataset as a table."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from itertools import product
from math import prod
from typing import Any

import pandas as pd
import xarray as xr


class Recorded(xr.Dataset):
    """The dataset of a run. Its table has a row per recorded time, not one per combination of all dimensions.

    `scene` is what was run, and `head` its HTML above the variables in a notebook; datasets made from this one have
    neither.
    """

    __slots__ = ("_head", "_scene")

    def _repr_html_(self) -> str:
        head = getattr(self, "_head", None)
        return f"{head(self) if head else ''}{super()._repr_html_()}"

    def to_dataframe(self, dim_order: Sequence[Hashable] | None = None) -> pd.DataFrame:
        """Return the variables over time as in `as_table`; with `dim_order`, xarray's table of all dimensions."""
        return as_table(self) if dim_order is None else super().to_dataframe(dim_order)


def with_dataframe(data: xr.Dataset, scene: Any = None, head: Callable[[Recorded], str] | None = None) -> Recorded:
    """Return the dataset of a run with its own `to_dataframe`; scene, head: see `Recorded`."""
    result = Recorded(data.data_vars, coords=data.coords, attrs=data.attrs)
    result._scene, result._head = scene, head
    return result


def scene_of(run: xr.Dataset) -> Any:
    """Return the scene that a dataset is the run of; None for one from a file, or made from another."""
    return getattr(run, "_scene", None)


def as_table(dataset: xr.Dataset, rows: Sequence[Hashable] = ("time",)) -> pd.DataFrame:
    """Tabulate every variable with the dimensions `rows`, one column per component: ``position platform x [m]``."""
    columns = {}
    for name, variable in dataset.data_vars.items():
        if not set(rows) <= set(variable.dims) or not variable.size:
            continue
        ordered = variable.transpose(*rows, ...)
        labels = product(*(dataset[dim].values.tolist() for dim in ordered.dims[len(rows) :]))
        values = ordered.values.reshape(-1, prod(ordered.shape[len(rows) :]))
        for column, label in zip(values.T, labels, strict=True):
            columns[" ".join(map(str, (name, *label))) + f" [{variable.attrs.get('units', '1')}]"] = column
    units = [dataset[dim].attrs.get("units", "") for dim in rows]
    names = [f"{dim} [{unit}]" if unit else str(dim) for dim, unit in zip(rows, units, strict=True)]
    values_of: list[Any] = [dataset[dim].values for dim in rows]
    if len(rows) == 1:
        return pd.DataFrame(columns, index=pd.Index(values_of[0], name=names[0]))
    return pd.DataFrame(columns, index=pd.MultiIndex.from_product(values_of, names=names))
