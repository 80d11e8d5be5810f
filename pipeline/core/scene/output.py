"""What a run records: its regular output times, and what is recorded on request only.

A request is a key of ``[output]``, with the variables that it adds to the run's dataset below; the module of the same
name in `pipeline.dynamics.record` makes them.
"""

from typing import Annotated, Any

from pydantic import Field

from flexclear.pipeline.core.scene.fields import Part, Time
from flexclear.pipeline.core.variable import Schema, Variable


class Output(Part):
    """Regular output interval; drive breaks and events are always added.

    stress: flexible bodies whose section forces and peak stresses are recorded.
    interval: time between two regular outputs.
    """

    interval: Annotated[Time, Field(gt=0.0)] = 1e-4
    stress: Annotated[tuple[str, ...], Field(min_length=1)] | None = None

    def requests(self) -> dict[str, Any]:
        """What is asked for, by key."""
        return {name: asked for name in VARIABLES if (asked := getattr(self, name)) is not None}


#: key of `Output` -> variables that it adds to a run; all are optional
VARIABLES: dict[str, Schema] = {
    "stress": {
        "section_force": Variable(
            ("time", "section", "axis"),
            "N",
            "N, Qy, Qz: force of the far part of the rod on the near one, axes of the section (x along the rod)",
            optional=True,
        ),
        "section_moment": Variable(
            ("time", "section", "axis"),
            "N m",
            "T, My, Mz: its moment about the section's centre, likewise",
            optional=True,
        ),
        "peak_axial_stress": Variable(
            ("time", "section"),
            "Pa",
            "axial stress of the section that is largest in size, tension positive",
            optional=True,
        ),
        "peak_von_mises_stress": Variable(
            ("time", "section"), "Pa", "largest von Mises stress of the section", optional=True
        ),
    },
}
