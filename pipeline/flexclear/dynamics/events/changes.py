"""Changes of a scene by events: parts removed, coordinates held, parts exchanged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from flexclear.dynamics.drives.pieces import pieces_of
from flexclear.scene.drives import JointDrive
from flexclear.scene.events import Event, switched_part
from flexclear.scene.expression import with_name
from flexclear.scene.fields import Part
from flexclear.scene.formulas import formula
from flexclear.scene.laws import KINDS, Constant, Delayed, Sum
from flexclear.scene.loads import EXPRESSIONS
from flexclear.scene.owners import COORDINATES, locked_coordinates
from flexclear.scene.parts import IdealJoint
from flexclear.scene.schema import Scene

#: families of parts that act along joint coordinates, and their keys that name these
ALONG = {
    "drive": ("joint",),
    "load": ("joint", "measured"),
    "stop": ("joint", "relative_to"),
    "gear": ("first", "second"),
}


@dataclass(frozen=True)
class Held:
    """A coordinate of a joint with a drive of its own; label: its name in records; turns: True for an angle."""

    drive: str
    joint: str
    coordinate: str
    label: str
    turns: bool

    @property
    def dimension(self) -> str:
        """Dimension of its values."""
        return "angle" if self.turns else "length"


def without_released_part(scene: Scene, event: Event) -> Scene:
    """Return the scene without a part; with a joint go all parts that act along its coordinates or read them."""
    family, name = event.part
    if family == "event":
        kept = {n: d for n, d in scene.drive.items() if n != name and not n.startswith(f"{name}.")}
        return scene.model_copy(update={"drive": kept})
    if family != "joint":
        return scene.model_copy(update={family: {n: p for n, p in getattr(scene, family).items() if n != name}})
    free = IdealJoint(type="free", between=scene.joint[name].between)
    left = {
        kind: {n: part for n, part in getattr(scene, kind).items() if not _acts_along(part, keys, name)}
        for kind, keys in ALONG.items()
    }
    left["load"] = {n: load for n, load in left["load"].items() if not _reads_joint(scene, n, name)}
    return scene.model_copy(update={"joint": {**scene.joint, name: free}, **left})


def _acts_along(part: Any, keys: tuple[str, ...], joint: str) -> bool:
    return any((getattr(part, key, None) or "").partition(".")[0] == joint for key in keys)


def _reads_joint(scene: Scene, load: str, joint: str) -> bool:
    """Return True when a load by an expression reads a coordinate of a joint."""
    written = formula(scene, load)
    reads = written.reads if written else ()
    return any(sort == "coordinate" and what.partition(".")[0] == joint for sort, what in reads)


def coordinates_of_event(scene: Scene, name: str, event: Event) -> list[Held]:
    """Return the coordinates whose motion an event prescribes: those of a lock, or the one whose drive is switched."""
    family, part = event.part
    if event.kind == "lock" and scene.joint[part].type in COORDINATES:
        return [
            _held_coordinate(scene, drive, part, c) for drive, (c, _) in locked_coordinates(scene, name, event).items()
        ]
    if event.kind == "switch" and family == "drive" and part in scene.drive:
        drive: Any = scene.drive[part]
        return [_held_coordinate(scene, part, drive.joint, drive.coordinate)]
    return []


def _held_coordinate(scene: Scene, drive: str, joint: str, coordinate: str | None) -> Held:
    known = COORDINATES[scene.joint[joint].type]
    name = coordinate or next(iter(known))
    return Held(drive, joint, name, joint if len(known) == 1 else f"{joint}.{name}", known[name])


def without_drives(scene: Scene, held: Iterable[Held]) -> Scene:
    """Return the scene without the drives of some coordinates."""
    mine = {(one.joint, one.coordinate) for one in held}

    def on(drive: Any) -> bool:
        if not isinstance(drive, JointDrive):
            return False
        return (drive.joint, _held_coordinate(scene, "", drive.joint, drive.coordinate).coordinate) in mine

    return scene.model_copy(update={"drive": {n: d for n, d in scene.drive.items() if not on(d)}})


def with_drives_of_event(scene: Scene, event: Event, held: Iterable[Held], at: Mapping[str, float], t: float) -> Scene:
    """Return the scene with drives whose laws begin at time t [s] at the positions `at` [m or rad], by record name."""
    made: dict[str, Any] = {}
    for one in held:
        law: Any = Constant(type="constant", value=at[one.label])
        if event.kind == "switch":
            law = JointDrive.model_validate({"joint": one.joint, "law": (event.to or {})["law"]}).law
            begins = pieces_of(law, one.dimension).value(0.0)
            law = Sum(type="sum", laws=(_delay_laws(law, t), Constant(type="constant", value=at[one.label] - begins)))
        made[one.drive] = JointDrive(joint=one.joint, coordinate=one.coordinate, law=law)
    return scene.model_copy(update={"drive": {**scene.drive, **made}})


def rates(scene: Scene, held: Iterable[Held], t: float) -> dict[str, float]:
    """Return the rates of driven coordinates after time t [s], by name in records [m/s or rad/s]."""
    drives: Any = scene.drive
    return {one.label: pieces_of(drives[one.drive].law, one.dimension).value(t, 1) for one in held}


def with_switched_load(scene: Scene, event: Event, t: float) -> Scene:
    """Return the scene with a load switched at time t [s], which is time zero for the new laws and expressions."""
    name, keys = event.part[1], event.to or {}
    new = switched_part(scene.load[name], event)
    changed = {key: _delay_laws(getattr(new, key), t) for key in keys}
    if isinstance(new, EXPRESSIONS) and "force" in keys:
        late = tuple(with_name(text, "t", f"(t - {t!r} s)") for text in new.texts)
        changed["force"] = late[0] if isinstance(new.force, str) else late
    new = new.model_copy(update=changed)
    return scene.model_copy(update={"load": {**scene.load, name: new}})


def _delay_laws(value: Any, by: float) -> Any:
    """Return a value of a part with the laws in it delayed by `by` [s]."""
    if isinstance(value, Constant):
        return value
    if isinstance(value, KINDS):
        return Delayed(type="delayed", by=by, law=value)
    if isinstance(value, tuple):
        return tuple(_delay_laws(item, by) for item in value)
    if isinstance(value, Part):
        return value.model_copy(
            update={name: _delay_laws(getattr(value, name), by) for name in type(value).model_fields}
        )
    return value
