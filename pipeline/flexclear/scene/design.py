"""The points of a sweep: values of all its parameters, and the key paths that take them."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexclear.scene.sweep import Sample, Sweep, number_and_unit

#: a value of a parameter in a scene: a number in SI, text with an SI unit, or anything else as written
Value = Any


@dataclass(frozen=True)
class Axis:
    """One parameter. values: for the scene, those of all points or of one dimension of the grid.

    unit: SI unit of the values where they were written with a unit; else empty.  written: that unit as written.
    """

    name: str
    places: tuple[str, ...]
    values: tuple[Value, ...]
    unit: str
    written: str = ""

    @property
    def coordinate(self) -> list[float] | list[str]:
        """Values as numbers in SI; as text where they are no numbers."""
        numeric = all(_is_number(value) for value in self.values)
        return (
            [number_and_unit(v)[0] for v in self.values]
            if numeric
            else [v if isinstance(v, str) else repr(v) for v in self.values]
        )


@dataclass(frozen=True)
class Design:
    """All parameters of a sweep; in a grid each is a dimension, and the last one varies fastest."""

    axes: tuple[Axis, ...]
    grid: bool

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along each dimension."""
        return tuple(len(axis.values) for axis in (self.axes if self.grid else self.axes[:1]))

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions: the parameters, or ``point``."""
        return tuple(axis.name for axis in self.axes) if self.grid else ("point",)

    def points(self) -> list[dict[str, Value]]:
        """Return the points in order, each as key path of the scene -> value."""
        combined = (itertools.product if self.grid else zip)(*(axis.values for axis in self.axes))
        return [
            {where: value for axis, value in zip(self.axes, values, strict=True) for where in axis.places}
            for values in combined
        ]


def design(sweep: Sweep) -> Design:
    """Return the points of a sweep; repeated calls give the same points."""
    if sweep.sample is not None:
        fractions = _unit_points(sweep.sample, len(sweep.vary)).T
        axes = [_axis_of_fractions(sweep, name, fraction) for name, fraction in zip(sweep.vary, fractions, strict=True)]
        return Design(tuple(axes), grid=False)
    return Design(tuple(_axis_of_values(sweep, name) for name in sweep.vary), grid=sweep.combine == "grid")


def _axis_of_values(sweep: Sweep, name: str) -> Axis:
    parameter = sweep.vary[name]
    if parameter.values is not None:
        units = {number_and_unit(v)[1] for v in parameter.values if _is_number(v)}
        unit = units.pop() if len(units) == 1 else ""
        return Axis(name, sweep.places(name), parameter.values, unit, unit and _unit_as_written(parameter.values[0]))
    a, b = parameter.numbers("first", "last")
    spaced = np.geomspace if parameter.spacing == "log" else np.linspace
    return _axis_of_numbers(sweep, name, spaced(a, b, parameter.count or 2))


def _axis_of_fractions(sweep: Sweep, name: str, fractions: np.ndarray) -> Axis:
    """Return a parameter with the values below which its distribution has these fractions, shape (points,)."""
    parameter = sweep.vary[name]
    if parameter.mean is not None:
        from scipy.special import ndtri

        mean, deviation = parameter.numbers("mean", "deviation")
        return _axis_of_numbers(sweep, name, mean + deviation * ndtri(fractions))
    a, b = parameter.numbers("first", "last")
    log = parameter.spacing == "log"
    return _axis_of_numbers(sweep, name, a * (b / a) ** fractions if log else a + (b - a) * fractions)


def _axis_of_numbers(sweep: Sweep, name: str, numbers: np.ndarray) -> Axis:
    unit = sweep.vary[name].unit
    values = tuple(f"{x!r} {unit}" if unit else x for x in numbers.tolist())
    given = sweep.vary[name]
    return Axis(name, sweep.places(name), values, unit, unit and _unit_as_written(given.first or given.mean))


def _unit_as_written(value: Value) -> str:
    """Return the unit with which a number was written."""
    return value.strip().partition(" ")[2].strip() if isinstance(value, str) else ""


def _unit_points(sample: Sample, parameters: int) -> np.ndarray:
    """Return points of the unit cube, shape (points, parameters), none on its faces."""
    from scipy.stats import qmc

    if sample.method == "random":
        return np.random.default_rng(sample.seed).uniform(np.finfo(float).tiny, 1.0, (sample.points, parameters))
    kind = qmc.Sobol if sample.method == "sobol" else qmc.LatinHypercube
    with warnings.catch_warnings():
        # the user may choose a number that is no power of two; docs/sweeps.md states the cost
        warnings.simplefilter("ignore", UserWarning)
        drawn = kind(parameters, rng=np.random.default_rng(sample.seed)).random(sample.points)
    return np.clip(drawn, np.finfo(float).eps, 1.0 - np.finfo(float).eps)


def _is_number(value: Value) -> bool:
    try:
        number_and_unit(value)
    except ValueError:
        return False
    return True
