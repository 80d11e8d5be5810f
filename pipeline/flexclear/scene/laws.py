"""Laws of time for prescribed coordinates and for loads: one language for both.

The values of a law are lengths, angles, forces or torques, as the prescribed quantity demands; a bare number is in SI
units. The course of a law of type 'step' is described in `dynamics.drives.step`.
"""

import csv
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias, get_args

from pydantic import BeforeValidator, Field, WithJsonSchema, field_validator, model_validator

from flexclear.scene.fields import Angle, Part, Rate, Time
from flexclear.scene.units import any_quantity, quantity, unit, unknown_unit_message

_TEXT = {"type": ["number", "string"], "description": "SI number, or text with a unit that fits the quantity"}
Value: TypeAlias = Annotated[float | str, BeforeValidator(any_quantity), WithJsonSchema(_TEXT)]


def _as_list(value: Any) -> Any:
    """Return a single entry, written without brackets, as a list."""
    return [value] if isinstance(value, (int, float, str)) else value


_LIST = BeforeValidator(_as_list, json_schema_input_type=float | str | tuple[float | str, ...])
Values: TypeAlias = Annotated[tuple[Value, ...], _LIST]
Times: TypeAlias = Annotated[tuple[Time, ...], _LIST]

#: largest size of a table [bytes]; every row is a piece of a law, at which integration stops
LARGEST_TABLE = 16 << 20
#: largest number of coefficients of a polynomial law
COEFFICIENTS = 8
#: largest number of steps of one law, and of pieces of composed laws: each is compared with all others
MOST_STEPS, MOST_PIECES = 5_000, 200_000
#: largest product of pieces and laws of a sum: each law is evaluated at the start of each piece
MOST_SUMMED = 1_000_000
Ends = Literal["not-a-knot", "natural", "clamped", "periodic"]


class Constant(Part):
    """A constant value."""

    type: Literal["constant"]
    value: Value = 0.0
    """the value"""


class Step(Part):
    """ADAMS STEP: a cubic from one value to the next, flat outside; several are summed (eq. 29, 35)."""

    type: Literal["step"]
    start: Annotated[Times, Field(max_length=MOST_STEPS)]
    """times at which each step begins and ends"""
    end: Times
    """times at which each step begins and ends"""
    change: Values
    """change of the value by each step"""

    @field_validator("change")
    @classmethod
    def _not_empty(cls, value: tuple[float | str, ...]) -> tuple[float | str, ...]:
        if not value:
            raise ValueError("a step law needs at least one step")
        return value

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if not len(self.start) == len(self.end) == len(self.change):
            raise ValueError(
                "start, end and change must have one entry per step each; "
                f"they have {len(self.start)}, {len(self.end)} and {len(self.change)}"
            )
        for a, b in zip(self.start, self.end, strict=True):
            if not a < b:
                raise ValueError(f"each step must end after it starts; start = {a:g} s, end = {b:g} s")
        return self


def _coefficient(value: Any) -> Any:
    """Return a number, or text with a unit, which the part that has the law checks."""
    has_unit = isinstance(value, str) and any(character.isalpha() or character == "°" for character in value)
    return value if has_unit else quantity(value, "number")


class Polynomial(Part):
    """c0 + c1 (t - origin) + c2 (t - origin)^2 + ...; in SI units, or as ``["30 deg", "10 deg/s"]``."""

    type: Literal["polynomial"]
    coefficients: Annotated[
        tuple[Annotated[float | str, BeforeValidator(_coefficient)], ...],
        Field(min_length=1, max_length=COEFFICIENTS),
    ]
    """c0, c1, c2 and so on"""
    origin: Time = 0.0
    """time from which t is counted"""


class Harmonic(Part):
    """Offset plus the sum of amplitude sin(frequency t + phase); phase 90 deg is a cosine."""

    type: Literal["harmonic"]
    amplitude: Annotated[Values, Field(min_length=1)]
    """amplitude of each sine"""
    frequency: Annotated[tuple[Rate, ...], _LIST]
    """frequency of each sine, as angular velocity or in Hz"""
    phase: Annotated[tuple[Angle, ...], _LIST] | None = None
    """phase of each sine at t = 0; default: 0"""
    offset: Value = 0.0
    """mean value"""

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        phases = self.frequency if self.phase is None else self.phase
        if not len(self.amplitude) == len(self.frequency) == len(phases):
            raise ValueError(
                "amplitude, frequency and phase must have one entry per harmonic each; "
                f"they have {len(self.amplitude)}, {len(self.frequency)} and {len(phases)}"
            )
        return self


class Spline(Part):
    """Interpolating spline: degree 3 with continuous second derivatives, degree 5 with continuous fourth ones."""

    type: Literal["spline"]
    time: tuple[Time, ...]
    """times of the points, ascending"""
    value: tuple[Value, ...]
    """values at these times"""
    degree: Literal[3, 5] = 3
    """degree of the polynomials between points, 3 or 5"""
    ends: Ends = "not-a-knot"
    """end conditions: 'not-a-knot'; 'natural' (second derivative zero; for degree 5 third and fourth); 'clamped' (first
    derivative zero; for degree 5 second, too); 'periodic'. The points must cover the run"""

    @model_validator(mode="after")
    def _check_curve(self) -> Self:
        if len(self.time) != len(self.value):
            raise ValueError(f"each time needs one value; {len(self.time)} times have {len(self.value)} values")
        _check_points(self.time, self.degree, self.ends)
        return self


class Column(Part):
    """A column of a table, and the unit of its numbers."""

    column: str | Annotated[int, Field(ge=1)]
    """header of the column, or its number from 1"""
    unit: str
    """unit of the numbers in the column"""

    @field_validator("unit")
    @classmethod
    def _require_known_unit(cls, text: str) -> str:
        if text != "1" and unit(text) is None:
            raise ValueError(f"{unknown_unit_message(text)}; 1 is the unit of a number")
        return text


class Table(Part):
    """A spline through the rows of a CSV file, searched for next to the scene and in the folders above it.

    The file is read with the scene: `points` holds its numbers, time in seconds, values in their column's unit.
    """

    type: Literal["table"]
    file: str
    """name of the CSV file"""
    time: Column
    """columns of the times and of the values"""
    value: Column
    """columns of the times and of the values"""
    degree: Literal[3, 5] = 3
    """degree of the spline, 3 or 5"""
    ends: Ends = "not-a-knot"
    """end conditions, as for a spline"""
    points: tuple[tuple[float, float], ...] = ()
    """the numbers read from the file; not written in a scene"""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        """Read the file unless its numbers are given; afterwards only its name is stored."""
        if not isinstance(data, dict) or "points" in data or not isinstance(data.get("file"), str):
            return data
        if not isinstance(data.get("time"), dict) or not isinstance(data.get("value"), dict):
            return data
        path = Path(data["file"])
        return {**data, "file": path.name, "points": read_points(path, data["time"], data["value"])}

    @model_validator(mode="after")
    def _check_curve(self) -> Self:
        _check_points([t for t, _ in self.points], self.degree, self.ends)
        if self.ends == "periodic" and self.points[0][1] != self.points[-1][1]:
            raise ValueError(
                "a periodic table must end with its first value; it starts "
                f"with {self.points[0][1]:g} and ends with {self.points[-1][1]:g}"
            )
        return self


class Sum(Part):
    """Sum of laws."""

    type: Literal["sum"]
    laws: Annotated[tuple["Bare", ...], Field(min_length=1)]
    """the laws that are added"""

    @model_validator(mode="after")
    def _check_pieces(self) -> Self:
        if _count(self) * len(self.laws) > MOST_SUMMED:
            raise ValueError(f"a sum of {len(self.laws)} laws takes at most {MOST_SUMMED // len(self.laws)} pieces")
        return self


class Section(Part):
    """A law that holds from this time until the next section starts."""

    start: Time
    """time from which the law holds"""
    law: "Bare"
    """law of this section"""


class Piecewise(Part):
    """Laws one after the other; the first also holds before it starts."""

    type: Literal["piecewise"]
    sections: Annotated[tuple[Section, ...], Field(min_length=1)]
    """laws and their starts, in order"""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        starts = [s.start for s in self.sections]
        if any(not a < b for a, b in pairwise(starts)):
            raise ValueError(f"the sections must start at increasing times, not at {starts} s")
        _check_count(self)
        return self


class Repeated(Part):
    """A law that repeats: its course over a `period` from `start`, `times` times; the last one continues."""

    type: Literal["repeated"]
    period: Annotated[Time, Field(gt=0)]
    """length of one course"""
    times: Annotated[int, Field(ge=1)]
    """number of courses"""
    start: Time = 0.0
    """time at which the first course begins"""
    law: "Bare"
    """law that is repeated"""

    @model_validator(mode="after")
    def _check_pieces(self) -> Self:
        _check_count(self)
        return self


class Delayed(Part):
    """A law whose time is counted from a later moment."""

    type: Literal["delayed"]
    by: Time
    """the moment from which the law counts time [s]"""
    law: "Bare"
    """law that is delayed"""


class Expression(Part):
    """An expression of the time `t` that consists of polynomials and sines, as ``h * sin(w * t)^2``.

    `max`, `min`, `abs`, `sign` and `step` divide it into pieces between start and end.
    """

    type: Literal["expression"]
    value: str
    """the expression"""
    values: dict[str, Value] = Field(default_factory=dict)
    """named constants, each a number or text with its unit"""
    start: Time = 0.0
    """interval in which the expression is used, for expressions in pieces"""
    end: Time | None = None
    """interval in which the expression is used, for expressions in pieces"""

    @model_validator(mode="after")
    def _check_duration(self) -> Self:
        if self.end is not None and not self.start < self.end:
            raise ValueError(f"it must end after it starts; start = {self.start:g} s, end = {self.end:g} s")
        return self


Law = Annotated[
    Constant | Step | Polynomial | Harmonic | Spline | Table | Sum | Piecewise | Repeated | Delayed | Expression,
    Field(discriminator="type"),
]
#: all types of laws
KINDS: tuple[Any, ...] = get_args(get_args(Law)[0])


def _constant_law(law: Any) -> Any:
    """Return a bare value as a constant law."""
    return law if not isinstance(law, (int, float, str)) else {"type": "constant", "value": law}


Bare = Annotated[Law, BeforeValidator(_constant_law, json_schema_input_type=Law | float | str)]


def _count(law: Any) -> int:
    """Return the largest number of pieces of a law; at each, integration stops."""
    match law:
        case Step():
            return 2 * len(law.start) + 1
        case Spline():
            return len(law.time)
        case Table():
            return len(law.points)
        case Sum():
            return sum(map(_count, law.laws))
        case Piecewise():
            return sum(1 + _count(section.law) for section in law.sections)
        case Repeated():
            return law.times * (1 + _count(law.law))
        case Delayed():
            return _count(law.law)
    return 1


def _check_count(law: Any) -> None:
    if _count(law) > MOST_PIECES:
        text = f"{min(_count(law), 10**300):.6g}"
        raise ValueError(f"it has {text} pieces, at each of which integration stops; the limit is {MOST_PIECES}")


def law_types(node: object) -> Iterator[str]:
    """Yield the types of all laws anywhere in a part, also inside sums and sections."""
    if isinstance(node, KINDS):
        yield node.type
    below = [getattr(node, name) for name in type(node).model_fields] if isinstance(node, Part) else node
    for item in below if isinstance(below, (tuple, list)) else ():
        if isinstance(item, (Part, tuple, list)):  # a table has thousands of numbers
            yield from law_types(item)


def read_points(path: Path, time: dict[str, Any], value: dict[str, Any]) -> list[tuple[float, ...]]:
    """Return two columns of a CSV file, time in seconds; raise ValueError, in words, for unreadable files."""
    unit = time.get("unit", "s")
    rows = read_columns(path, [time.get("column"), value.get("column")])
    return [(quantity(f"{t!r} {unit}", "time"), quantity(x, "number")) for t, x in rows]


def read_columns(path: Path, requested: list[Any]) -> list[tuple[float, ...]]:
    """Return columns of a CSV file, by header or number from 1; raise ValueError, in words, for unreadable files."""
    try:
        if not path.is_file() and path.exists():
            raise ValueError(f"the table {path.name} cannot be read: it is not an ordinary file")
        if path.stat().st_size > LARGEST_TABLE:
            raise ValueError(f"the table {path.name} is larger than {LARGEST_TABLE >> 20} MB: leave rows out")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row and not row[0].lstrip().startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"the table {path.name} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    header = [] if not rows or _is_number(rows[0][0]) else [cell.strip() for cell in rows[0]]
    columns = [_column(path, header, rows, one) for one in requested]
    points = []
    for number, row in enumerate(rows[1:] if header else rows, start=2 if header else 1):
        cells = [row[c].strip() if c < len(row) else "" for c in columns]
        if not all(_is_number(cell) for cell in cells):
            which = " and ".join(str(c + 1) for c in columns)
            raise ValueError(f"row {number} of {path.name} has no numbers in columns {which}")
        points.append(tuple(float(cell) for cell in cells))
    return points


def _column(path: Path, header: list[str], rows: list[list[str]], requested: object) -> int:
    if isinstance(requested, int) and not isinstance(requested, bool):
        if rows and not 1 <= requested <= len(rows[0]):
            raise ValueError(f"{path.name} has {len(rows[0])} columns, no column {requested}")
        return requested - 1
    if requested not in header:
        from difflib import get_close_matches  # here, since correct names do not need it

        near = get_close_matches(str(requested), header, n=1)  # nothing else is quoted of a file that may be private
        hint = f"did you mean '{near[0]}'?" if near else "give the column's number"
        raise ValueError(f"{path.name} has no column '{requested}' in {'its' if header else 'a'} header; {hint}")
    return header.index(str(requested))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _check_points(time: tuple[float, ...] | list[float], degree: int, ends: str) -> None:
    fewest = 2 if degree == 3 and ends != "periodic" else 3 if degree == 3 else 6
    if len(time) < fewest:
        raise ValueError(
            f"a spline of degree {degree} with {ends} ends takes at least {fewest} points, not {len(time)}"
        )
    for k, (a, b) in enumerate(pairwise(time), start=2):
        if not a < b:
            raise ValueError(f"times must increase from point to point; point {k} at {b} s follows one at {a} s")
