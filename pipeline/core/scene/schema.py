"""A whole scene as one frozen model; `Scene` is what every tower is given."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, PrivateAttr, model_validator

from pipeline.core.scene.clearance import Clearance, ClearanceRevolute, ClearanceSpherical
from pipeline.core.scene.fields import Length, Number, Part, Time
from pipeline.core.scene.parts import (
    Body,
    Drive,
    FlexibleBody,
    Ground,
    Joint,
    Load,
    RigidBody,
)


class TimeSpan(Part):
    """Start and end of the run."""

    start: Time = 0.0
    end: Time

    @model_validator(mode="after")
    def _forward(self) -> TimeSpan:
        if not self.end > self.start:
            raise ValueError(f"time.end = {self.end} s must lie after time.start = {self.start} s")
        return self


class Solver(Part):
    """Integrator and its tolerance; `evaluations` caps the right-hand sides of one run.

    ledger_tolerance: largest energy error of a run, as a share of the energy that it turns over.
    """

    integrator: str = "dop853"
    rtol: Annotated[Number, Field(ge=1e-14, le=1e-2)] = 1e-10
    evaluations: Annotated[int, Field(gt=0)] = 50_000_000
    # no contact law is known to a thousandth of its energy; a run that is off by more says something else
    ledger_tolerance: Annotated[Number, Field(gt=0.0)] = 1e-3


class Output(Part):
    """Regular output interval; drive breaks and events are always added."""

    interval: Annotated[Time, Field(gt=0.0)] = 1e-4


class Ensemble(Part):
    """Members that start with the ball of every clearance joint offset in a random direction.

    bodies: whose motion is kept; default: the bodies that carry the clearance joints.
    """

    members: Annotated[int, Field(ge=2)] = 16
    perturbation: Annotated[Length, Field(gt=0.0)] = 1e-8
    seed: int = 20190310
    bodies: tuple[str, ...] | None = None


class Accuracy(Part):
    """Wanted accuracy per quantity, e.g. ``"platform.position" = "1 um"``."""

    quantities: dict[str, str] = Field(default_factory=dict)


class Scene(Part):
    """Everything a scene file says, after composition. Names of parts are keys."""

    title: str
    description: str = ""
    body: dict[str, Body]
    joint: dict[str, Joint] = Field(default_factory=dict)
    drive: dict[str, Drive] = Field(default_factory=dict)
    load: dict[str, Load] = Field(default_factory=dict)
    time: TimeSpan
    solver: Solver = Solver()
    output: Output = Output()
    ensemble: Ensemble | None = None
    accuracy: Accuracy | None = None

    _name: str = PrivateAttr(default="scene")
    _path: Path | None = PrivateAttr(default=None)

    @property
    def name(self) -> str:
        """Path below the scenes folder without suffix, e.g. ``sps4/csj``."""
        return self._name

    @property
    def path(self) -> Path | None:
        """The file it was read from."""
        return self._path

    def rigid(self) -> dict[str, RigidBody]:
        """Rigid bodies by name."""
        return {n: b for n, b in self.body.items() if isinstance(b, RigidBody)}

    def flexible(self) -> dict[str, FlexibleBody]:
        """Flexible bodies by name."""
        return {n: b for n, b in self.body.items() if isinstance(b, FlexibleBody)}

    def ground_frames(self) -> dict[str, object]:
        """Frames of the fixed world by name, over all bodies of type ground."""
        return {f"{n}.{f}": p for n, b in self.body.items() if isinstance(b, Ground) for f, p in b.frames.items()}

    def contacts(self) -> dict[str, Clearance]:
        """Clearance joints by name."""
        return {n: j for n, j in self.joint.items() if isinstance(j, (ClearanceSpherical, ClearanceRevolute))}

    def sources(self) -> dict[str, str]:
        """Where each value comes from: ``part.key`` (or ``part``) -> text."""
        found: dict[str, str] = {}
        _collect_sources(self.model_dump(), "", found)
        return found

    def assumptions(self) -> dict[str, str]:
        """The sources that say ``assumed: why``."""
        return {k: v for k, v in self.sources().items() if v.startswith("assumed")}


def _collect_sources(node: object, place: str, found: dict[str, str]) -> None:
    if not isinstance(node, dict):
        return
    source = node.get("source")
    if isinstance(source, str):
        found[place or "scene"] = source
    elif isinstance(source, dict):
        found.update({f"{place}.{key}".lstrip("."): text for key, text in source.items()})
    for key, value in node.items():
        if key != "source":
            _collect_sources(value, f"{place}.{key}".lstrip("."), found)
