"""A sweep: one scene, the parameters varied in it, its points, and what is recorded of each. See docs/sweeps.md."""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from flexclear.scene.fields import Part
from flexclear.scene.load import SWEEP, require_kind
from flexclear.scene.toml_files import read_toml
from flexclear.scene.units import any_quantity
from flexclear.scene.validation_errors import input_errors

#: largest number of points of one sweep
MOST_POINTS = 1_000_000
#: largest number of parameters of one sweep, and of values of all parameters at all points of a sample
MOST_PARAMETERS, MOST_VALUES = 1000, 10_000_000

Value = float | str
#: dimensions and variables that results have besides the parameters
RESERVED = ("point", "time", "section", "axis", "quat", "status", "reason", "evaluations", "key")
#: names of dimensions that NetCDF takes, and their largest length [bytes]
DIMENSION, LONGEST_DIMENSION = re.compile(r"[A-Za-z0-9_\x80-\U0010ffff]([^/]*[^/ ])?"), 256
#: ways to give the values of a parameter, each by its keys
WAYS = (("values",), ("from", "to"), ("mean", "deviation"))


class Parameter(Part):
    """Values of a parameter: a list, a range, or a normal distribution."""

    model_config = ConfigDict(populate_by_name=True)

    values: Annotated[tuple[Any, ...], Field(min_length=1)] | None = None
    """the values, one by one"""
    first: Value | None = Field(default=None, alias="from")
    """begin of a range; in a grid the range has `count` points, in samples it is a uniform distribution"""
    last: Value | None = Field(default=None, alias="to")
    """end of the range"""
    count: Annotated[int, Field(ge=2, le=MOST_POINTS)] | None = None
    """points of a range in a grid"""
    spacing: Literal["linear", "log"] = "linear"
    """spacing of a range; `log` needs ends of one sign"""
    mean: Value | None = None
    """mean and standard deviation of a normal distribution, in samples"""
    deviation: Value | None = None
    """mean and standard deviation of a normal distribution, in samples"""
    places: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """the key paths in the scene that all take the value; default: the parameter's name"""

    @model_validator(mode="before")
    @classmethod
    def _list_as_values(cls, given: Any) -> Any:
        return {"values": given} if isinstance(given, (list, tuple)) else given

    @model_validator(mode="after")
    def _one_way(self) -> Parameter:
        given = {"values": self.values, "from": self.first, "to": self.last, "mean": self.mean}
        named = [key for key, value in {**given, "deviation": self.deviation}.items() if value is not None]
        if tuple(named) not in WAYS:
            ways = ", or ".join(" and ".join(way) for way in WAYS)
            raise ValueError(f"its values are given by {ways}, not by {' and '.join(named) or 'nothing'}")
        if self.count is not None and self.first is None:
            raise ValueError("count belongs to a range, from .. to")
        if self.first is not None:
            self._check_range()
        if self.deviation is not None and not self.numbers("mean", "deviation")[1] > 0.0:
            raise ValueError(f"deviation must be greater than 0, not {self.deviation!r}")
        return self

    def _check_range(self) -> None:
        a, b = self.numbers("first", "last")
        if a == b:
            raise ValueError(f"from and to are both {self.first!r}, but the ends of a range must differ")
        if self.spacing == "log" and not a * b > 0.0:
            raise ValueError(f"a logarithmic range needs ends of one sign, not {self.first!r} and {self.last!r}")

    def numbers(self, *fields: str) -> tuple[float, ...]:
        """Return fields as numbers in one SI unit, that of `unit`."""
        return tuple(number_and_unit(getattr(self, name))[0] for name in fields)

    @property
    def unit(self) -> str:
        """SI unit of the ends, or of mean and deviation; empty for bare numbers."""
        fields = ("first", "last") if self.first is not None else ("mean", "deviation")
        units = {number_and_unit(getattr(self, name))[1] for name in fields}
        if len(units) > 1:
            one, other = (getattr(self, name) for name in fields)
            raise ValueError(f"{one!r} and {other!r} differ in unit")
        return units.pop()

    @model_validator(mode="after")
    def _of_one_unit(self) -> Parameter:
        if self.values is None:
            _ = self.unit
        return self


def number_and_unit(value: Any) -> tuple[float, str]:
    """Return SI value and SI unit of a number, or of text with a unit; raise ValueError in words."""
    quantity = any_quantity(value)
    if isinstance(quantity, str):
        number, _, unit = quantity.partition(" ")
        return float(number), unit
    return quantity, ""


class Sample(Part):
    """Points spread over all parameters together, instead of a grid."""

    method: Literal["sobol", "latin-hypercube", "random"]
    """scrambled Sobol sequence (best with a power of two), Latin hypercube, or independent random numbers"""
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)]
    """number of points"""
    seed: Annotated[int, Field(ge=0)] = 1
    """seed of the random numbers"""


class Sweep(Part):
    """The content of a sweep file."""

    title: str = ""
    """description in one line"""
    description: str = ""
    """longer description"""
    scene: str
    """a scene file, or the name of one below scenes/"""
    set: dict[str, Any] = Field(default_factory=dict)
    """changes of the scene that hold at all points"""
    vary: Annotated[dict[str, Parameter], Field(min_length=1, max_length=MOST_PARAMETERS)]
    """parameters by name; the name is a key path in the scene unless `places` gives others"""
    combine: Literal["grid", "list"] = "grid"
    """every value with every other (grid), or the first values, the second ones and so on (list)"""
    sample: Sample | None = None
    """points spread over all parameters, instead of a grid"""
    keep: Annotated[tuple[str, ...], Field(min_length=1)]
    """quantities recorded of each point, as ``slider.velocity.largest``"""
    members: Annotated[int, Field(ge=2)] | None = None
    """number of starts of each point with tiny offsets (`[ensemble]` of the scene); mean and deviation are recorded"""
    error: bool = False
    """run each point at a hundredth of its tolerance as well, and record the differences"""

    _name: str = PrivateAttr(default="sweep")

    @property
    def name(self) -> str:
        """Stem of the file."""
        return self._name

    @model_validator(mode="after")
    def _fits_together(self) -> Sweep:
        if self.sample is not None:
            self._check_sample()
            return self
        for name, parameter in self.vary.items():
            if parameter.mean is not None:
                raise ValueError(f"vary.{name}: a normal distribution needs a [sample]")
            if parameter.first is not None and parameter.count is None:
                raise ValueError(f"vary.{name}: a range without [sample] needs a count")
        lengths = {name: self.length(name) for name in self.vary}
        if self.combine == "list" and len(set(lengths.values())) > 1:
            text = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise ValueError(f"combine: parameters of one list must have equally many values, not {text}")
        points = 1
        for n in lengths.values() if self.combine == "grid" else list(lengths.values())[:1]:
            points *= n
        if points > MOST_POINTS:
            raise ValueError(
                f"vary: the sweep has {points} points, more than {MOST_POINTS}; split it into several sweeps"
            )
        return self

    @model_validator(mode="after")
    def _each_place_once(self) -> Sweep:
        varied_by: dict[str, str] = {}
        for name in self.vary:
            if name in RESERVED or name.startswith(self.keep):
                raise ValueError(f"vary.{name}: results have a dimension '{name}' already; choose another name")
            if not DIMENSION.fullmatch(name) or not name.isprintable() or len(name.encode()) > LONGEST_DIMENSION:
                raise ValueError(
                    f"vary.{name}: cannot name a dimension in a file; choose a name of at most {LONGEST_DIMENSION} "
                    "bytes that begins with a letter, a digit or _, and has no slash"
                )
            for where in self.places(name):
                if where in varied_by:
                    raise ValueError(f"vary.{name}: '{where}' is varied by '{varied_by[where]}' already")
                varied_by[where] = name
        return self

    def _check_sample(self) -> None:
        if self.combine == "list":
            raise ValueError('combine: a [sample] chooses its own points; remove combine = "list"')
        if self.sample is not None and self.sample.points * len(self.vary) > MOST_VALUES:
            raise ValueError(f"sample.points: all points together have more than {MOST_VALUES} values; request fewer")
        for name, parameter in self.vary.items():
            if parameter.values is not None or parameter.count is not None:
                raise ValueError(f"vary.{name}: in a [sample] write from and to without count, or mean and deviation")

    def places(self, name: str) -> tuple[str, ...]:
        """Return the key paths in the scene that a parameter sets."""
        return self.vary[name].places or (name,)

    def length(self, name: str) -> int:
        """Return the number of values of a parameter in a grid or list."""
        parameter = self.vary[name]
        return parameter.count or len(parameter.values or ())


def read_sweep(table: Mapping[str, Any], where: str | Path) -> Sweep:
    """Return the sweep in a table; raise InputErrors with all errors, placed at `where`."""
    try:
        return Sweep.model_validate(dict(table))
    except ValidationError as error:
        raise input_errors(where, error, Sweep) from None


def load_sweep(path: Path) -> Sweep:
    """Load the sweep in a TOML file; raise InputError for a file that cannot be read, or is a scene."""
    table = read_toml(path)
    require_kind(table, path, SWEEP)
    sweep = read_sweep(table, path)
    sweep._name = path.stem
    return sweep


#: a value of a parameter in a scene: a number in SI, text with an SI unit, or anything else as written
AnyValue = Any


@dataclass(frozen=True)
class Axis:
    """One parameter. values: for the scene, those of all points or of one dimension of the grid.

    unit: SI unit of the values where they were written with a unit; else empty.  written: that unit as written.
    """

    name: str
    places: tuple[str, ...]
    values: tuple[AnyValue, ...]
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

    def points(self) -> list[dict[str, AnyValue]]:
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


def _unit_as_written(value: AnyValue) -> str:
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


def _is_number(value: AnyValue) -> bool:
    try:
        number_and_unit(value)
    except ValueError:
        return False
    return True
