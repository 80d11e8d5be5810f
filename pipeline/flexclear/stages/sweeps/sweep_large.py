"""Sweeps whose dataset is larger than memory: points stay in the store, and the dataset is a folder in Zarr format.

The dataset is written in slabs along the first dimension, so that at most one slab is in memory.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.util import find_spec
from math import ceil, prod
from pathlib import Path

import xarray as xr

from flexclear.artifacts.disk import disk_limits
from flexclear.artifacts.points import Point, dimensions, unpack_points
from flexclear.artifacts.store import Record, Store
from flexclear.stages.sweeps.sweep_plan import Plan
from flexclear.system import machine
from flexclear.system.errors import InputError

SUFFIX = ".zarr"
#: copies of a dataset in memory while it is written as one file: points, arrays, bytes of the file, bytes read back
TIMES_IN_MEMORY = 4.0
#: bytes of a slab; batches of points in memory while slabs are assembled
SLAB, BATCHES = 1 << 26, 8
INSTALL = "pip install 'flexclear[zarr]'"


def require_zarr(where: str) -> None:
    """Raise InputError when Zarr is not installed."""
    if find_spec("zarr") is None:
        raise InputError(where, "Zarr is not installed", INSTALL)


def is_large(plan: Plan) -> bool:
    """Return True when the dataset exceeds the memory that `[limits]` allow, by default a fraction of all memory.

    Raises ResourceError when the dataset cannot be written in slabs either.
    """
    allowed = plan.scene.limits.memory or machine.ALLOWED_FRACTION * machine.available_memory()
    need = TIMES_IN_MEMORY * plan_size(plan)
    if need > allowed and find_spec("zarr") is None:
        machine.require_memory(need, "the sweep's dataset", f"record less, or, to store on disk, {INSTALL}", allowed)
    return need > allowed


def require_small(plan: Plan) -> None:
    """Raise ResourceError when a dataset that is to be returned does not fit into memory."""
    remedy = "record fewer quantities, or use `flexclear sweep FILE`, which leaves the dataset on disk"
    machine.require_memory(TIMES_IN_MEMORY * plan_size(plan), "the sweep's dataset", remedy, plan.scene.limits.memory)


def plan_size(plan: Plan) -> float:
    """Return the size of all recorded values [bytes]."""
    lengths = dimensions(plan.time, plan.sections)
    each = sum(prod(lengths[dim] for dim in one.dims) for one in plan.recorded) * len(plan.statistics)
    return 8.0 * each * prod(plan.design.shape)


def write(path: Path, slabs: Iterator[xr.Dataset], along: str) -> None:
    """Write a dataset as a Zarr folder, in full or not at all. slabs: its parts in order; along: their dimension."""
    unfinished = path.with_name(f".{path.stem}.part{SUFFIX}")
    with disk_limits(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)
        for k, slab in enumerate(slabs):
            # NumPy's texts have a fixed length, which the next slab may exceed; texts as objects have any length
            texts = {name: v.astype(object) for name, v in slab.variables.items() if v.dtype.kind == "U"}
            whole = slab.assign({n: v for n, v in texts.items() if n in slab.data_vars})
            whole = whole.assign_coords({n: v for n, v in texts.items() if n in slab.coords})
            if k == 0:
                whole.to_zarr(unfinished, mode="w", consolidated=False)
            else:
                whole.to_zarr(unfinished, append_dim=along, consolidated=False)
        shutil.rmtree(path, ignore_errors=True)
        os.replace(unfinished, path)


def write_points(plan: Plan, store: Store, done: Mapping[str, Point], path: Path) -> xr.Dataset:
    """Write the dataset of the points in the store to `path` and open it there; values are read on access.

    done: the finished points, without their values.
    """
    write(path, _slabs(plan, store, done), plan.design.dims[0])
    return xr.open_zarr(path, chunks=None, consolidated=False)


def _slabs(plan: Plan, store: Store, done: Mapping[str, Point]) -> Iterator[xr.Dataset]:
    records_by_key = dict(_batch_records(plan, store))
    opened = lru_cache(BATCHES)(lambda k: unpack_points(store.load(records[k]), plan.recorded))
    records = {record.key: record for record in records_by_key.values()}
    complete = int(all(job.key in done for job in plan.jobs))
    count = plan.design.shape[0]
    rows = ceil(count / max(1, ceil(plan_size(plan) / SLAB)))
    for first in range(0, count, rows):
        part = plan.rows(first, first + rows)
        here = {job.key: opened(records_by_key[job.key].key)[job.key] for job in part.jobs if job.key in records_by_key}
        yield part.dataset(here).assign_attrs(complete=complete)


def _batch_records(plan: Plan, store: Store) -> Iterator[tuple[str, Record]]:
    """Yield the key of each stored point with the record of its batch."""
    for family in plan.families:
        for record, batch in family.batches(store):
            yield from ((str(key), record) for key in batch["key"].values)


def write_copy(path: Path, dataset: xr.Dataset) -> None:
    """Write a dataset, in memory or lazily opened, in Zarr format."""
    along = str(dataset["status"].dims[0])
    count = dataset.sizes[along]
    rows = ceil(count / max(1, ceil(dataset.nbytes / SLAB)))
    write(path, (dataset.isel({along: slice(k, k + rows)}).load() for k in range(0, count, rows)), along)


def without_values(point: Point) -> Point:
    """Return a point without its values, which are in the store."""
    return Point({}, {}, {}, point.evaluations, point.refused)
