"""The output of a run: regular output times, data recorded on request, the description of variables; what is shown.

A request is a key of ``[output]``, with the variables that it adds to the run's dataset below; the module of the same
name in `dynamics.record` computes them.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from flexclear.scene.fields import Direction, Number, Part, Position, Positive, Time, require_one


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of an artifact. `optional` ones are absent where the scene has no corresponding part.

    units: as UDUNITS reads them; empty for words. turning: units of entries that turn instead of sliding, where a
    dimension has both. gaps: whether entries may be NaN, where a value does not exist.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    optional: bool = False
    turning: str = ""
    gaps: bool = False


Schema = dict[str, Variable]


def rows(text: str) -> tuple[tuple[str, ...], ...]:
    """Return the cells of a table, one row per line: ``first | second | third``; indented lines continue a row."""
    return tuple(tuple(map(str.strip, line.split("|"))) for line in re.sub(r"\n +", " ", text.strip()).splitlines())


def table(text: str) -> Schema:
    """Return variables by name, one in each line: ``name | dimensions | units | long name``.

    After the name ``?`` marks optional variables and ``~`` those that may have gaps; ``units, units`` are those of
    entries that slide and of those that turn. An indented line continues the long name of the line before.
    """
    variables = {}
    for name, dims, units, long_name in rows(text):
        sliding, _, turning = units.partition(", ")
        variables[name.rstrip("?~")] = Variable(
            tuple(dims.split()), sliding, long_name, "?" in name, turning, gaps="~" in name
        )
    return variables


class Gauge(Part):
    """Part of a solid's surface where stress is recorded, given by one of position, frame and region."""

    body: str
    """the solid, one of those in `stress`"""
    position: Position | None = None
    """position of the gauge, which is at the nearest node, body frame"""
    frame: str | None = None
    """a frame of the solid's recipe: the gauge is at the nodes that are tied to it"""
    region: str | None = None
    """a named region of the solid's mesh"""

    @model_validator(mode="after")
    def _one_rule(self) -> Self:
        require_one(self, ("position", "frame", "region"), "says where")
        return self


class Output(Part):
    """Regular output interval; drive breaks and events are always added."""

    interval: Annotated[Time, Field(gt=0.0)] = 1e-4
    """time between two regular outputs"""
    horizon: bool = True
    """with contacts: repeat the run from a perturbed start to estimate its predictability horizon, at most at the cost
    of a second run; `false` leaves `horizon` and `separation` out of the run"""
    stress: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """flexible bodies whose stresses are recorded: section forces and peaks of rods, surfaces of solids"""
    gauges: Annotated[dict[str, Gauge], Field(min_length=1)] | None = None
    """gauges on solids where stress is recorded besides the peak"""
    frame_loads: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """flexible bodies of which the loads on all frames are recorded, in body axes"""

    @model_validator(mode="after")
    def _gauges_are_on_stressed_bodies(self) -> Self:
        for name, gauge in (self.gauges or {}).items():
            if gauge.body not in (self.stress or ()):
                known = ", ".join(self.stress or ()) or "none"
                raise ValueError(f"gauges.{name}: '{gauge.body}' is not a body in `stress` ({known}); add it")
        return self

    def gauge_names(self, body: str) -> list[str]:
        """Return the names of a body's gauges in the run."""
        return [f"{body}.{name}" for name in self.on(body)]

    def on(self, body: str) -> dict[str, Gauge]:
        """Return the gauges of a body."""
        return {name: gauge for name, gauge in (self.gauges or {}).items() if gauge.body == body}

    def without(self, bodies: Collection[str]) -> dict[str, Any]:
        """Return the output as a table without the stresses and loads of these bodies."""
        rest = self.model_dump(mode="json", exclude_none=True, exclude={"gauges", *OF_FLEXIBLE})
        asked = {key: getattr(self, key) or () for key in OF_FLEXIBLE}
        lists = {key: [name for name in names if name not in bodies] for key, names in asked.items()}
        gauges = {
            name: gauge.model_dump(mode="json", exclude_none=True)
            for name, gauge in (self.gauges or {}).items()
            if gauge.body not in bodies
        }
        return rest | {key: names for key, names in lists.items() if names} | ({"gauges": gauges} if gauges else {})

    def requests(self) -> dict[str, Any]:
        """Return the requests, by key."""
        return {name: request for name in VARIABLES if (request := getattr(self, name)) is not None}


#: keys that list flexible bodies
OF_FLEXIBLE = ("stress", "frame_loads")
#: key of `Output` -> variables that it adds to a run; all are optional
VARIABLES: dict[str, Schema] = {
    "stress": table("""
section_force? | time section axis | N | N, Qy, Qz: force of the far part of the rod on the near one, axes of the
    section (x along the rod)
section_moment? | time section axis | N m | T, My, Mz: moment of the far part about the section's centre, section axes
peak_axial_stress? | time section | Pa | axial stress of the section that is largest in size, tension positive
peak_von_mises_stress? | time section | Pa | largest von Mises stress of the section
von_mises_stress? | time gauge | Pa | von Mises stress of the gauge's node where it is largest
first_principal_stress? | time gauge | Pa | largest principal stress at the gauge's node, tension positive
second_principal_stress? | time gauge | Pa | middle principal stress at the gauge's node, tension positive
third_principal_stress? | time gauge | Pa | smallest principal stress at the gauge's node, tension positive
stress_position? | time gauge axis | m | undeformed position of that node, body frame
stress_tensor? | time gauge tensor | Pa | stress at the gauge's node, body axes
stress_factor? | time stress_field | 1 | factor of the bundle's stress field, SI
"""),
    "frame_loads": table("""
frame_force? | time loaded_frame axis | N | force of joints, loads and contacts on the flexible body at the frame, body
    axes
frame_moment? | time loaded_frame axis | N m | their moment about the frame's displaced origin, body axes
origin_acceleration? | time loaded_body axis | m s-2 | acceleration of the body frame's origin minus gravity, body axes
axes_velocity? | time loaded_body axis | rad s-1 | angular velocity of the body frame, body axes
axes_acceleration? | time loaded_body axis | rad s-2 | angular acceleration of the body frame, body axes
"""),
}
#: the names of those variables
ON_REQUEST = frozenset(name for schema in VARIABLES.values() for name in schema)


class View(Part):
    """Settings of what is examined and drawn; no effect on the motion."""

    watch: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """quantities that comparisons, tables and films show, as ``platform.position`` or ``A1.force - A2.force``; default:
    those of `[accuracy]`, else the motion of the body with most joints, a reaction and the contacts"""
    direction: Direction | None = None
    """viewing direction of pictures and films, a vector from the mechanism to the eye; default: normal to a planar
    mechanism, else from above and in front"""
    up: Direction | None = None
    """upward direction in pictures, world axes; default: against gravity, else z"""
    zoom: Annotated[Number, Positive] | None = None
    """magnification of the mechanism against the usual size"""
    exaggeration: Annotated[Number, Positive] | None = None
    """magnification of drawn deformations against the computed ones; default: large enough to be visible"""
    duration: Annotated[Time, Positive] | None = None
    """duration of films; default: some 4 s"""
    impact_slowdown: Annotated[Number, Field(ge=1.0)] | None = None
    """factor by which films run slower around impacts; default: 8; 1 runs evenly"""

    @model_validator(mode="after")
    def _check_directions(self) -> Self:
        for direction in (self.direction, self.up):
            if direction is not None and not any(direction):
                raise ValueError("a direction must not have length zero")
        return self
