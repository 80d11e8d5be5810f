"""Events of a scene, each at most once: a part is released, a motion is locked, a part is switched to another."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, TypeAdapter, ValidationError, WithJsonSchema, model_validator

from flexclear.scene.drives import Drive, JointDrive, PathDrive
from flexclear.scene.event_kinds import CHANGES
from flexclear.scene.fields import Part, PartName, given_keys, require_one
from flexclear.scene.formulas import formula
from flexclear.scene.loads import Load, SampledPid
from flexclear.scene.loose_joints import CONTACTS
from flexclear.scene.owners import COORDINATES
from flexclear.scene.quantity import parse_condition
from flexclear.scene.registry import suggestion
from flexclear.scene.units import quantity

#: families of the parts that each change may name
NAMED = {
    "release": ("joint", "drive", "load", "stop", "gear", "event"),
    "lock": ("joint",),
    "switch": ("load", "drive"),
}


def _time_or_condition(value: Any) -> float | str:
    """Return a time [s], or the text of a comparison."""
    return value if isinstance(value, str) and ("<" in value or ">" in value) else quantity(value, "time")


_WHEN = {"type": ["number", "string"], "description": "a time, or a comparison as 'force(A1) > 200 N'"}
When = Annotated[float | str, BeforeValidator(_time_or_condition), WithJsonSchema(_WHEN)]


class Event(Part):
    """A change that happens once in the run: at a time, or when a comparison of quantities becomes true."""

    at: When
    """a time, or a comparison of quantities with < or >; vectors count by their magnitude"""
    after: PartName | None = None
    """another event, which must happen first"""
    release: str | None = None
    """part that is removed: joint.NAME, drive.NAME, load.NAME, stop.NAME, gear.NAME, or event.NAME of a lock"""
    lock: str | None = None
    """joint.NAME, whose coordinates stop and stay fixed"""
    switch: str | None = None
    """load.NAME, or drive.NAME of a joint, that is replaced by another one"""
    to: dict[str, Any] | None = None
    """the keys that change; with another type, all keys of the part; laws and expressions count time from the event,
    and laws of drives count positions from the coordinate at the event"""

    @model_validator(mode="after")
    def _one_change(self) -> Self:
        require_one(self, CHANGES, "says what changes")
        if (self.switch is None) != (self.to is None):
            raise ValueError("switch needs to, and to needs switch: a part, and the keys of the part that change")
        return self

    @property
    def kind(self) -> str:
        """The change in `CHANGES` that the event makes."""
        return given_keys(self, CHANGES)[0]

    @property
    def part(self) -> tuple[str, str]:
        """Family and name of the part that the event changes."""
        family, _, name = str(getattr(self, self.kind)).partition(".")
        return family, name

    @property
    def before(self) -> set[str]:
        """Events that happen before this one."""
        family, name = self.part
        return {name for name in (self.after, name if family == "event" else None) if name}


@cache
def _reader(family: str) -> Any:
    return TypeAdapter(Load if family == "load" else Drive)


def switched_part(part: Any, event: Event) -> Any:
    """Return the part that replaces another at an event; raise ValueError for impossible keys.

    A new part of the same type takes the other keys of the old one.
    """
    to = event.to or {}
    old = part.model_dump(mode="json", exclude_none=True)
    same = "type" not in to or to["type"] == old.get("type")
    try:
        return _reader(event.part[0]).validate_python({**(old if same else {}), **to})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(key) for key in first["loc"][1:])
        raise ValueError(f"{where}: {first['msg'].removeprefix('Value error, ')}".lstrip(": ")) from None


def with_switched(scene: Any) -> Any:
    """Return the scene with the new parts of all switches added, so that it names all parts that a run may need."""
    new_parts: dict[str, dict[str, Any]] = {}
    for name, event in scene.event.items():
        if event.kind == "switch":
            family, part = event.part
            new_parts.setdefault(family, {})[f"{part}.{name}"] = switched_part(getattr(scene, family)[part], event)
    return scene.model_copy(update={family: {**getattr(scene, family), **parts} for family, parts in new_parts.items()})


def require_possible(scene: Any) -> None:
    """Raise ValueError, which opens with the key path, for events that are impossible in a scene."""
    if not scene.event:
        return
    for name, event in scene.event.items():
        for key, problem in _problems(scene, name, event):
            raise ValueError(f"event.{name}{'.' if key else ''}{key}: {problem}")
    _require_distinct(scene)
    for name, load in scene.load.items():
        if isinstance(load, SampledPid):
            raise ValueError(f"load.{name}: a sampled controller cannot continue across events: use a continuous 'pid'")
    for name, drive in scene.drive.items():
        if isinstance(drive, PathDrive) and drive.actuators:
            raise ValueError(
                f"drive.{name}.actuators: a path with actuators allows no events: drive the joints instead"
            )
    for setting in ("ensemble", "sections"):
        if getattr(scene, setting) is not None:
            raise ValueError(f"{setting}: only a single run may have events: remove [{setting}] or the events")


def _problems(scene: Any, name: str, event: Event) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with one event: its key, and why."""
    kind, (family, part) = event.kind, event.part
    if family not in NAMED[kind] or not part:
        yield kind, f"names {' or '.join(f'{one}.NAME' for one in NAMED[kind])}, not '{getattr(event, kind)}'"
    elif part not in getattr(scene, family):
        yield kind, f"there is no {family} '{part}' ({suggestion(part, getattr(scene, family))})"
    elif family == "event" and scene.event[part].kind != "lock":
        yield kind, f"'{part}' is not a lock and cannot be released"
    elif kind == "release" and family == "joint" and scene.joint[part].type == "free":
        yield kind, f"joint '{part}' is free already"
    elif kind == "lock":
        yield from _errors_of_lock(scene, name, scene.joint[part])
    elif kind == "switch":
        yield from _errors_of_switch(scene, getattr(scene, family)[part], event)
    for other in event.before:
        if other not in scene.event:
            yield "after", f"there is no event '{other}' ({suggestion(other, scene.event)})"
        elif name in _chain(scene.event, other):
            yield "after", f"'{name}' and '{other}' wait for each other"
    if isinstance(event.at, float):
        if not scene.time.start < event.at < scene.time.end:
            yield "at", f"{event.at:g} s is not within the run, {scene.time.start:g} to {scene.time.end:g} s"
        return
    try:
        parse_condition(str(event.at), scene.owners())
    except ValueError as error:
        yield "at", str(error)


def _errors_of_lock(scene: Any, name: str, joint: Any) -> Iterator[tuple[str, str]]:
    if isinstance(joint, CONTACTS):
        yield "lock", "a joint with clearance has no coordinate to hold: lock an ideal joint"
    elif joint.type not in COORDINATES:
        yield "lock", f"a {joint.type} joint has no coordinate to hold: lock a {' or '.join(COORDINATES)} joint"
    elif name in scene.drive:
        yield "", f"a drive has the name '{name}', under which the lock would be recorded: choose another name"


def _errors_of_switch(scene: Any, part: Any, event: Event) -> Iterator[tuple[str, str]]:
    if isinstance(part, PathDrive):
        yield "switch", "is the path of a frame; drives of joints can be switched"
        return
    try:
        new = switched_part(part, event)
        if event.part[0] == "load":
            formula(scene.model_copy(update={"load": {**scene.load, event.part[1]: new}}), event.part[1])
    except ValueError as error:
        yield "to", str(error)
        return
    if isinstance(part, JointDrive) and (new.joint, new.coordinate) != (part.joint, part.coordinate):
        yield "to", "an event cannot change a drive's coordinate: give another law"
    elif isinstance(part, JointDrive) and "law" not in (event.to or {}):
        yield "to", "gives no law; switching a drive needs another law"
    elif isinstance(new, SampledPid):
        yield "to", "a sampled controller cannot start at an event: use a continuous 'pid'"


def _chain(events: Mapping[str, Event], name: str) -> Collection[str]:
    """Return all events that happen before one, including itself; circles are allowed."""
    waiting, before = [name], set[str]()
    while waiting:
        one = waiting.pop()
        if one not in before and one in events:
            before.add(one)
            waiting += events[one].before
    return before


def _require_distinct(scene: Any) -> None:
    """Raise ValueError for two events that release, or lock, the same part."""
    done: dict[tuple[str, tuple[str, str]], str] = {}
    for name, event in scene.event.items():
        other = done.setdefault((event.kind, event.part), name)
        if other != name and event.kind != "switch":
            family, part = event.part
            raise ValueError(f"event.{name}.{event.kind}: event '{other}' does so with {family}.{part} already")
