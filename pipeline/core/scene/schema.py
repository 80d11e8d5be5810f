"""A whole scene as one frozen model; `Scene` is what every tower is given."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PrivateAttr, model_validator

from pipeline.core.scene.clearance import Clearance, ClearanceRevolute, ClearanceSpherical
from pipeline.core.scene.drives import Drive
from pipeline.core.scene.fields import Length, Number, Part, PartName, Time
from pipeline.core.scene.loads import Gravity, Load
from pipeline.core.scene.output import Output
from pipeline.core.scene.parts import (
    Body,
    FlexibleBody,
    Ground,
    Joint,
    RigidBody,
)
from pipeline.core.scene.solver import PlainIntegrator, Solver
from pipeline.core.scene.wanted import KINDS, Quantity, parse, usual
from pipeline.core.units import quantity

#: rows of a run that a machine can be asked to hold
MOST_ROWS = 1e7


class TimeSpan(Part):
    """Start and end of the run."""

    start: Time = 0.0
    end: Time

    @model_validator(mode="after")
    def _forward(self) -> TimeSpan:
        if not self.end > self.start:
            raise ValueError(f"time.end = {self.end} s must lie after time.start = {self.start} s")
        return self


class Ensemble(Part):
    """Members that start with the ball of every clearance joint offset in a random direction.

    bodies: whose motion is kept; default: the bodies that carry the clearance joints.
    """

    members: Annotated[int, Field(ge=2, le=100_000)] = 16
    perturbation: Annotated[Length, Field(gt=0.0)] = 1e-8
    seed: Annotated[int, Field(ge=0)] = 20190310
    bodies: tuple[str, ...] | None = None


class Wanted(Part):
    """A wanted accuracy: absolute in SI, or relative to the quantity's own size."""

    absolute: Annotated[Number, Field(gt=0.0)] | None = None
    relative: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = None


class Accuracy(Part):
    """Wanted accuracy of the time integration per quantity, e.g. ``platform.position = "1 um"``.

    The value is an absolute one with a unit (or bare, in SI), or a share like ``"0.1 %"`` or
    ``{ relative = 1e-6 }`` of the quantity's largest change.  Kinds of quantities: `pipeline.core.scene.wanted`.
    """

    quantities: dict[str, Wanted] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, table: Any) -> Any:
        if not isinstance(table, dict) or set(table) <= {"quantities", "source"}:
            return table
        found = {name: _wanted(name, value) for name, value in _leaves(table, "")}
        return {"quantities": found} | ({"source": table["source"]} if "source" in table else {})


def _leaves(table: dict[str, Any], place: str) -> list[tuple[str, Any]]:
    """Dotted name -> value, of nested tables or quoted names alike."""
    found = []
    for key, value in table.items():
        name = f"{place}.{key}".lstrip(".")
        if isinstance(value, dict) and not set(value) <= {"absolute", "relative"}:
            found += _leaves(value, name)
        elif name != "source":
            found.append((name, value))
    return found


def _wanted(name: str, value: Any) -> Any:
    if isinstance(value, dict):
        return value
    if isinstance(value, str) and value.rstrip().endswith("%"):
        return {"relative": quantity(value, "number")}
    kind = KINDS.get(name.rpartition(".")[2])
    if kind is None:
        return {"absolute": 1.0}  # the scene, which knows its parts, tells what could have been meant
    problems = []
    for dimension in kind.dimensions:
        try:
            return {"absolute": quantity(value, dimension)}
        except ValueError as error:
            problems.append(str(error))
    raise ValueError(f"{name}: {problems[0]}")


class Scene(Part):
    """Everything a scene file says, after composition. Names of parts are keys."""

    title: str
    description: str = ""
    body: dict[PartName, Body]
    joint: dict[PartName, Joint] = Field(default_factory=dict)
    drive: dict[PartName, Drive] = Field(default_factory=dict)
    load: dict[PartName, Load] = Field(default_factory=dict)
    time: TimeSpan
    solver: Solver = PlainIntegrator()
    output: Output = Output()
    ensemble: Ensemble | None = None
    accuracy: Accuracy | None = None

    def _rows_can_be_kept(self) -> None:
        rows = (self.time.end - self.time.start) / self.output.interval
        if rows > MOST_ROWS:
            raise ValueError(
                f"output.interval = {self.output.interval:g} s asks for {rows:.3g} rows, more than {MOST_ROWS:g}: "
                "choose a longer one"
            )

    def _quantities_are_there(self) -> None:
        for name in self.accuracy.quantities if self.accuracy else ():
            try:
                parse(name, self.owners())
            except ValueError as error:
                raise ValueError(f"accuracy.{name}: {error}") from None

    def _stressed_bodies_are_flexible(self) -> None:
        for name in self.output.stress or ():
            if name not in self.flexible():
                known = ", ".join(self.flexible()) or "none"
                raise ValueError(f"output.stress: '{name}' is no flexible body of this scene; flexible ones: {known}")

    @model_validator(mode="after")
    def _fits_together(self) -> Scene:
        self.check()
        return self

    def check(self) -> None:
        """ValueError where parts and settings that are right by themselves do not go together."""
        self._rows_can_be_kept()
        self._quantities_are_there()
        self._stressed_bodies_are_flexible()

    def owners(self) -> dict[str, tuple[str, ...]]:
        """Names of the parts that may own a quantity, by what they are."""
        moving = tuple(name for name, body in self.body.items() if not isinstance(body, Ground))
        return {
            "body": moving,
            "joint": tuple(self.joint),
            "drive": tuple(self.drive),
            "contact": tuple(self.contacts()),
        }

    def wanted(self) -> list[Quantity]:
        """The quantities that `[accuracy]` names; without it the usual ones."""
        if self.accuracy is not None and self.accuracy.quantities:
            return [parse(name, self.owners()) for name in self.accuracy.quantities]
        moving = {name for name, body in self.body.items() if not isinstance(body, Ground)}
        joints = {
            name: [frame.partition(".")[0] for frame in joint.between if frame.partition(".")[0] in moving]
            for name, joint in self.joint.items()
            if joint.type != "fixed"
        }
        hosts = self._hosts()
        return usual({n: [hosts[b] for b in pair] for n, pair in joints.items()}, tuple(self.contacts()))

    def _hosts(self) -> dict[str, str]:
        """For every moving body the body that it is fixed to, or itself."""
        moving = [name for name, body in self.body.items() if not isinstance(body, Ground)]
        host = {name: name for name in moving}
        for joint in self.joint.values():
            a, b = (frame.partition(".")[0] for frame in joint.between)
            if joint.type == "fixed" and a in host and b in host:
                old, new = host[b], host[a]
                host = {name: new if at == old else at for name, at in host.items()}
        return host

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

    def contacts(self) -> dict[str, Clearance]:
        """Clearance joints by name."""
        return {n: j for n, j in self.joint.items() if isinstance(j, (ClearanceSpherical, ClearanceRevolute))}

    def forces(self) -> dict[str, Any]:
        """Loads other than gravity, which is a field, by name."""
        return {n: load for n, load in self.load.items() if not isinstance(load, Gravity)}

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
