"""Points of a sweep: the data stored of each, batches of points as artifacts, and the dataset of all points."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import AXES, CONVENTIONS, QUATERNION
from flexclear.scene.quantity import Recorded
from flexclear.scene.sweep import Design
from flexclear.scene.units import udunits

Values = dict[str, np.ndarray]
#: states of a point
STATUS = ("done", "refused", "not_run")
DONE, REFUSED, NOT_RUN = range(3)
#: statistics of a recorded quantity: its value, and on request the difference from a run at a tighter tolerance or the
#: standard deviation over members; with the text appended to the quantity's long name
MEANINGS = {
    "values": "",
    "error": "; distance from the value at a hundredth of the tolerance",
    "deviation": "; standard deviation over the members",
}
STATISTICS = tuple(MEANINGS)


@dataclass(frozen=True)
class Point:
    """Recorded data of one point.

    values: by the names of the recorded quantities, in SI; with members their mean. error: distance from the values at
    a tighter tolerance. deviation: standard deviation over the members. Both are empty unless requested. evaluations:
    of the right-hand side, in all runs of the point. refused: why there are no values; else empty. members: values of
    each start; artifacts lack them.
    """

    values: Values
    error: Values
    deviation: Values
    evaluations: int
    refused: str = ""
    members: Sequence[Values] = ()


def dataset_of_batch(points: Mapping[str, Point], recorded: Sequence[Recorded]) -> xr.Dataset:
    """Return finished points, with their keys, as a dataset."""
    done = list(points.values())
    variables: dict[str, Any] = {}
    for statistic, one in itertools.product(STATISTICS, recorded):
        values = [getattr(point, statistic)[one.name] for point in done if one.name in getattr(point, statistic)]
        if values:
            rows = _stack_values(done, one.name, statistic, np.shape(values[0]))
            variables[variable_name(one, statistic)] = (("point", *one.dims), rows)
    variables["evaluations"] = (("point",), np.array([point.evaluations for point in done], dtype=np.int64))
    variables["refused"] = (("point",), np.array([point.refused for point in done], dtype=object))
    return xr.Dataset(variables, coords={"key": ("point", np.array(list(points), dtype=object))})


def join_points(parts: Sequence[tuple[Point, int]]) -> Point:
    """Return the point of all members of several points of one scene, each with its number of members (at least 1)."""
    if len(parts) == 1:
        return parts[0][0]
    refused = next((point.refused for point, _ in parts if point.refused), "")
    evaluations, total = sum(point.evaluations for point, _ in parts), sum(n for _, n in parts)
    if refused:
        return Point({}, {}, {}, evaluations, refused)
    values = {
        name: np.asarray(np.sum([n * p.values[name] for p, n in parts], axis=0) / total) for name in parts[0][0].values
    }
    deviation = {}
    for name, mean in values.items():
        squares = [
            (n - 1) * np.square(p.deviation.get(name, 0.0)) + n * np.square(p.values[name] - mean) for p, n in parts
        ]
        deviation[name] = np.asarray(np.sqrt(np.sum(squares, axis=0) / (total - 1)))
    return Point(values, {}, deviation, evaluations)


def unpack_points(stored: xr.Dataset, recorded: Sequence[Recorded]) -> dict[str, Point]:
    """Return the points of a batch by their keys."""
    arrays = {str(name): stored[name].values for name in stored.variables}
    points = {}
    for k, key in enumerate(arrays["key"]):
        refused = str(arrays["refused"][k])
        values, error, deviation = (
            {}
            if refused
            else {q.name: arrays[name][k] for q in recorded if (name := variable_name(q, statistic)) in arrays}
            for statistic in STATISTICS
        )
        points[str(key)] = Point(values, error, deviation, int(arrays["evaluations"][k]), refused)
    return points


def variable_name(one: Recorded, statistic: str) -> str:
    """Return the name of a variable, as files allow it: with "÷" for "/", and "_" before a sign or a bracket."""
    name = (one.name if statistic == "values" else f"{one.name}.{statistic}").replace("/", "÷")
    return name if name[0].isalnum() else f"_{name}"


def dataset(
    design: Design,
    recorded: Sequence[Recorded],
    keys: Sequence[str],
    points: Mapping[str, Point],
    time: np.ndarray,
    sections: int,
    attributes: Mapping[str, str | int],
    statistics: Sequence[str] = STATISTICS[:1],
) -> xr.Dataset:
    """Return all points of a sweep on its own dimensions; NaN where a value is missing.

    keys: of the points, in their order. points: the finished ones. time: of the recorded series [s]. sections: number
    per point. statistics: the requested ones of `STATISTICS`.
    """
    dims, shape = design.dims, design.shape
    every = [points.get(key) for key in keys]
    lengths = dimensions(time, sections)
    variables: dict[str, Any] = {}
    for one, statistic in itertools.product(recorded, statistics):
        inner = tuple(lengths[dim] for dim in one.dims)
        rows = _stack_values(every, one.name, statistic, inner).reshape((*shape, *inner))
        described = {"units": udunits(one.unit), "long_name": f"{one.meaning}{MEANINGS[statistic]}"}
        variables[variable_name(one, statistic)] = ((*dims, *one.dims), rows, described)
    status = [NOT_RUN if p is None else REFUSED if p.refused else DONE for p in every]
    plain = {
        "status": (np.array(status, dtype=np.int8), "state of the point"),
        "reason": (np.array(["" if p is None else p.refused for p in every], dtype=object), "reason of the refusal"),
        "evaluations": (
            np.array([0 if p is None else p.evaluations for p in every], dtype=np.int64),
            "evaluations of the equations of motion, all runs of the point together",
        ),
        "key": (np.array(keys, dtype=object), "digest of all inputs of the point"),
    }
    for name, (values, meaning) in plain.items():
        variables[name] = (dims, values.reshape(shape), {"long_name": meaning})
    sizes = {dim for names, *_ in variables.values() for dim in names}
    coordinates: dict[str, Any] = {}
    for axis in design.axes:
        described = {"long_name": ", ".join(axis.places)} | ({"units": u} if (u := udunits(axis.unit)) else {})
        described |= {"written_units": axis.written} if axis.written else {}
        coordinates[axis.name] = (axis.name if design.grid else "point", np.array(axis.coordinate), described)
    coordinates |= {"axis": list(AXES)} if "axis" in sizes else {}
    coordinates |= {"quat": list(QUATERNION)} if "quat" in sizes else {}
    coordinates |= {"time": ("time", time, {"units": "s", "long_name": "time"})} if "time" in sizes else {}
    result = xr.Dataset(variables, coords=coordinates)
    result["status"].attrs |= {"flag_values": np.arange(3, dtype=np.int8), "flag_meanings": " ".join(STATUS)}
    finished = int(NOT_RUN not in status)
    return result.assign_attrs({"Conventions": CONVENTIONS, "complete": finished, **attributes})


def dimensions(time: np.ndarray, sections: int) -> dict[str, int]:
    """Return the lengths of all dimensions that recorded quantities of a point may have."""
    return {"axis": len(AXES), "quat": len(QUATERNION), "time": len(time), "section": sections}


def _stack_values(points: Sequence[Point | None], name: str, statistic: str, inner: tuple[int, ...]) -> np.ndarray:
    """Return values of points, shape (points, *inner); NaN where they are missing."""
    rows = np.full((len(points), *inner), np.nan)
    for k, point in enumerate(points):
        if point is not None and name in getattr(point, statistic):
            rows[k] = getattr(point, statistic)[name]
    return rows
