"""Tables of measured values over one or two quantities, which expressions of loads and contact laws look up."""

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from flexclear.scene.expression import Lookup
from flexclear.scene.fields import Part
from flexclear.scene.laws import Column, read_columns
from flexclear.scene.units import si_unit, unit, unit_exponents

#: largest number of points
MOST_POINTS = 5_000


def _as_tuple(value: Any) -> Any:
    return (value,) if isinstance(value, (dict, Column)) else value


@lru_cache(maxsize=64)
def _axes(points: tuple[tuple[float, ...], ...], count: int) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(sorted({row[k] for row in points})) for k in range(count))


class LookupTable(Part):
    """Values over one quantity, or over a grid of two, from a CSV file, searched for next to the scene and above it.

    In an expression ``table(NAME, ...)`` is the value at one or two quantities; outside of the points the run ends. The
    file is read with the scene: `points` holds its numbers in SI.
    """

    file: str
    """name of the CSV file"""
    of: Annotated[
        tuple[Column, ...],
        BeforeValidator(_as_tuple, json_schema_input_type=Column | tuple[Column, ...]),
        Field(min_length=1, max_length=2),
    ]
    """column of the quantity, or the columns of two, every pair of whose values has a row"""
    value: Column
    """column of the values"""
    between: Literal["cubic", "linear"] = "cubic"
    """between the points: a cubic or bicubic spline, whose second derivatives are continuous, or straight lines"""
    points: tuple[tuple[float, ...], ...] = ()
    """the numbers read from the file; not written in a scene"""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        """Read the file unless its numbers are given; afterwards only its name is stored."""
        if not isinstance(data, dict) or "points" in data or not isinstance(data.get("file"), str):
            return data
        columns = [*(_as_tuple(data.get("of")) or ()), data.get("value")]
        if not all(isinstance(one, dict) and isinstance(one.get("unit"), str) for one in columns):
            return data
        path, factors = Path(data["file"]), [(unit(one["unit"]) or (1.0, ""))[0] for one in columns]
        rows = read_columns(path, [one.get("column") for one in columns])
        if len(rows) > MOST_POINTS:
            raise ValueError(f"{path.name} has {len(rows)} points; a table has at most {MOST_POINTS}: leave rows out")
        points = [[x * factor for x, factor in zip(row, factors, strict=True)] for row in rows]
        if not all(math.isfinite(x) for row in points for x in row):
            raise ValueError(f"{path.name} has values that are no finite numbers")
        return {**data, "file": path.name, "points": points}

    @model_validator(mode="after")
    def _check_points(self) -> Self:
        if any(len(row) != len(self.of) + 1 for row in self.points):
            raise ValueError(f"each point of {self.file} has {len(self.of) + 1} numbers")
        sides = self.axes()
        for column, axis in zip(self.of, sides, strict=True):
            if len(axis) < 2:
                raise ValueError(f"{self.file} has {len(axis)} values of '{column.column}'; a table needs at least two")
        if len(self.of) == 1:
            for k in range(1, len(self.points)):
                if not self.points[k - 1][0] < self.points[k][0]:
                    rule = "must increase from point to point"
                    raise ValueError(f"'{self.of[0].column}' of {self.file} {rule}; point {k + 1} does not")
        elif len(self.points) != math.prod(map(len, sides)) or len({row[:2] for row in self.points}) < len(self.points):
            sizes = " x ".join(str(len(axis)) for axis in sides)
            raise ValueError(
                f"{self.file} has {len(self.points)} rows for {sizes} values of '{self.of[0].column}' and "
                f"'{self.of[1].column}'; give every pair one row"
            )
        return self

    def function(self, name: str) -> Lookup:
        """Return what an expression knows of the table under its name."""
        of, value = (
            (si_unit(unit_exponents(column.unit)) for column in self.of),
            si_unit(unit_exponents(self.value.unit)),
        )
        return Lookup(name, tuple(of), value)

    def axes(self) -> tuple[tuple[float, ...], ...]:
        """Return the values of each quantity in SI, ascending."""
        return _axes(self.points, len(self.of))

    def halvings(self) -> tuple[int, ...]:
        """Return how often the intervals of each quantity are halved to find one."""
        return tuple((len(axis) - 2).bit_length() for axis in self.axes())
