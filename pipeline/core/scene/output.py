"""What a run records: its regular output times, and what is recorded on request only; how variables are described.

A request is a key of ``[output]``, with the variables that it adds to the run's dataset below; the module of the same
name in `pipeline.dynamics.record` makes them.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from flexclear.pipeline.core.scene.fields import Part, Position, Time, require_one


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of an artifact. `optional` ones are absent where the scene has no such part.

    units: as UDUNITS reads them; empty for words.  turning: units of entries that turn instead of sliding, where a
    dimension has both.  gaps: whether entries may be NaN, where there is nothing.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    optional: bool = False
    turning: str = ""
    gaps: bool = False


Schema = dict[str, Variable]


def rows(text: str) -> tuple[tuple[str, ...], ...]:
    """Cells of a table, one row in each line: ``first | second | third``; an indented line continues the one before."""
    return tuple(tuple(map(str.strip, line.split("|"))) for line in re.sub(r"\n +", " ", text.strip()).splitlines())


def table(text: str) -> Schema:
    """Variables by name, one in each line: ``name | dimensions | units | long name``.

    Behind the name ``?`` marks what is optional and ``~`` what may have gaps; ``units, units`` are those of entries
    that slide and of those that turn. An indented line continues the long name of the line before.
    """
    variables = {}
    for name, dims, units, long_name in rows(text):
        sliding, _, turning = units.partition(", ")
        variables[name.rstrip("?~")] = Variable(
            tuple(dims.split()), sliding, long_name, "?" in name, turning, gaps="~" in name
        )
    return variables


class Gauge(Part):
    """Where on the surface of a solid its stress is recorded: one of position, frame and region."""

    body: str
    """the solid, one of those in `stress`"""
    position: Position | None = None
    """of the nearest node, body frame"""
    frame: str | None = None
    """a frame of its recipe, for the nodes that are tied to it"""
    region: str | None = None
    """a named region of its mesh"""

    @model_validator(mode="after")
    def _one_rule(self) -> Self:
        require_one(self, ("position", "frame", "region"), "says where")
        return self


class Output(Part):
    """Regular output interval; drive breaks and events are always added."""

    interval: Annotated[Time, Field(gt=0.0)] = 1e-4
    """time between two regular outputs"""
    stress: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """flexible bodies whose stresses are recorded: section forces and peaks of rods, surfaces of solids"""
    gauges: Annotated[dict[str, Gauge], Field(min_length=1)] | None = None
    """where on solids stress is recorded next to the peak"""

    @model_validator(mode="after")
    def _gauges_are_on_stressed_bodies(self) -> Self:
        for name, gauge in (self.gauges or {}).items():
            if gauge.body not in (self.stress or ()):
                asked = ", ".join(self.stress or ()) or "none"
                raise ValueError(f"gauges.{name}: '{gauge.body}' is none of the bodies in `stress` ({asked}); add it")
        return self

    def gauge_names(self, body: str) -> list[str]:
        """Gauges of a body, as the run calls them."""
        return [f"{body}.{name}" for name in self.on(body)]

    def on(self, body: str) -> dict[str, Gauge]:
        """The gauges of a body."""
        return {name: gauge for name, gauge in (self.gauges or {}).items() if gauge.body == body}

    def without(self, bodies: Collection[str]) -> dict[str, Any]:
        """The same as a table in which the stresses of these bodies are not asked for."""
        rest = self.model_dump(mode="json", exclude_none=True, exclude={"stress", "gauges"})
        stress = [name for name in self.stress or () if name not in bodies]
        gauges = {
            name: gauge.model_dump(mode="json", exclude_none=True)
            for name, gauge in (self.gauges or {}).items()
            if gauge.body not in bodies
        }
        return rest | ({"stress": stress} if stress else {}) | ({"gauges": gauges} if gauges else {})

    def requests(self) -> dict[str, Any]:
        """What is asked for, by key."""
        return {name: asked for name in VARIABLES if (asked := getattr(self, name)) is not None}


#: key of `Output` -> variables that it adds to a run; all are optional
VARIABLES: dict[str, Schema] = {
    "stress": table("""
section_force? | time section axis | N | N, Qy, Qz: force of the far part of the rod on the near one, axes of the
    section (x along the rod)
section_moment? | time section axis | N m | T, My, Mz: its moment about the section's centre, likewise
peak_axial_stress? | time section | Pa | axial stress of the section that is largest in size, tension positive
peak_von_mises_stress? | time section | Pa | largest von Mises stress of the section
von_mises_stress? | time gauge | Pa | von Mises stress of the gauge's node where it is largest
first_principal_stress? | time gauge | Pa | largest principal stress there, tension positive
second_principal_stress? | time gauge | Pa | middle principal stress there, tension positive
third_principal_stress? | time gauge | Pa | smallest principal stress there, tension positive
stress_position? | time gauge axis | m | undeformed position of that node, body frame
stress_tensor? | time gauge tensor | Pa | stress there, body axes
stress_factor? | time stress_field | 1 | what the bundle's stress field is multiplied by, SI
"""),
}
