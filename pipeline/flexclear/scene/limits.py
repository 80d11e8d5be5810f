"""Limits on the resources that a scene may request from the machine."""

import re
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema

from flexclear.scene.fields import Part, Time
from flexclear.system.errors import InputError, ResourceError

_UNITS = {"B": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}
_SIZE = re.compile(r"(\d{1,15}(?:\.\d{1,15})?) ?([kMGT]?B)")


def _bytes(value: Any) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return value
    match = _SIZE.fullmatch(value.strip()) if isinstance(value, str) else None
    if match is None:
        raise ValueError(f"expected a size such as '4 GB', in {', '.join(_UNITS)}")
    return float(match[1]) * _UNITS[match[2]]


_TEXT = {"type": "string", "description": "size such as '4 GB'"}
Bytes = Annotated[float, BeforeValidator(_bytes), Field(gt=0.0), WithJsonSchema(_TEXT)]


class Limits(Part):
    """Largest resources of the work, which are estimated first; a larger request is refused at once (exit code 4)."""

    time: Annotated[Time, Field(gt=0.0)] | None = None
    """wall time of each run, ensemble or study of sections; partial results are stored at the limit"""
    memory: Bytes | None = None
    """default: four fifths of what is free"""
    disk: Bytes | None = None
    """default: four fifths of what is free"""
    parts: Annotated[int, Field(ge=1)] = 2000
    """largest number of parts of each family, such as bodies or joints"""
    cells: Annotated[int, Field(ge=1)] = 500_000
    """largest number of elements or cells of one mesh"""
    modes: Annotated[int, Field(ge=1)] = 2000
    """largest number of elastic coordinates of one body"""
    rows: Annotated[int, Field(ge=1)] = 10_000_000
    """largest number of rows of a run"""
    members: Annotated[int, Field(ge=2)] = 100_000
    """largest number of members of an ensemble"""

    @property
    def time_words(self) -> str:
        """The message when the time is over."""
        return f"the run reached the {self.time or 0.0:.6g} s of limits.time"

    def as_table(self) -> dict[str, Any]:
        """Return the limits as a table that can be read again."""
        return self.model_dump(exclude={"source"}, exclude_none=True)


def check_rows(rows: float, interval: float, limits: Limits) -> None:
    """Raise ResourceError when an output interval [s] requests more rows than a run may have."""
    if rows > limits.rows:
        raise ResourceError(
            f"[output.interval]: {interval:g} s requests {rows:.3g} rows, more than the {limits.rows} that limits.rows "
            "allows; choose a longer one"
        )


def check_members(members: int, limits: Limits, where: str = "[ensemble.members]") -> None:
    """Raise ResourceError when an ensemble has more members than the limits allow."""
    if members > limits.members:
        text = f"{min(members, 10**300):.6g}"  # a whole number may be beyond any float
        raise ResourceError(f"{where}: {text} are more than the {limits.members} that limits.members allows")


def require_scatter(scene: Any, where: str) -> None:
    """Raise InputError for a scene whose ensemble members would all be the same run."""
    if not scene.contacts() and not scene.stops():
        problem = "members differ in their ball offsets, but the scene has neither clearance joint nor stop"
        raise InputError(where, problem, "remove it")


def check_parts(table: dict[str, Any], path: Path, families: tuple[str, ...]) -> None:
    """Raise ResourceError when an otherwise unchecked scene has more parts of a family than the limits allow."""
    limits = table.get("limits")
    most = limits.get("parts") if isinstance(limits, dict) else None
    most = most if isinstance(most, int) else Limits().parts
    for family in families:
        count = len(table[family]) if isinstance(table.get(family), dict) else 0
        if count > most:
            raise ResourceError(
                f"{path} [{family}]: {count} parts are more than the {most} that limits.parts allows; "
                "the work grows at least with the square of their number"
            )


def check_cells(shape: Any, elements: Any, limits: Limits, recipe: Path) -> None:
    """Raise ResourceError when an otherwise unchecked recipe requests too many elements or cells."""
    given = [elements] if isinstance(elements, int) else []
    if isinstance(shape, dict):
        cells = shape.get("cells")
        given = cells if isinstance(cells, list) else list(cells.values()) if isinstance(cells, dict) else given
    count = prod(max(n, 1) for n in given if isinstance(n, int)) if given else 0
    if count > limits.cells:
        text = f"{min(count, 10**300):.3g}"  # a whole number may be beyond any float
        raise ResourceError(f"{recipe}: {text} cells are more than the {limits.cells} that limits.cells allows")
