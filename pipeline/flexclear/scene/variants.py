"""Variants of a scene: the removable effects, the scene without some of them, the ideal mechanism, and its file.

Parts that nothing couples to the requested quantities can be removed without any error. Joints, drives, loads, stops
and gears couple the bodies and joints that they name; the fixed world couples nothing, and gravity acts on each body by
itself.

An effect has the name of its key path: ``joint.A1.clearance``, ``joint.A1.friction``, ``body.rod1.modes``,
``body.rod1.damping``, ``body.rod1.stiffening``, ``load.gravity``, ``stop.X``, ``gear.X.backlash``. A variant without
effects differs from its scene by replaced and removed parts only, so that a file can state it by extending the scene's.
Other parts, such as springs, are effects on request: their names are those of the parts. An ideal joint takes the place
of a bushing.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from flexclear.scene.ends import OF_TEETH
from flexclear.scene.load import FAMILIES, SETTINGS, edited
from flexclear.scene.loads import Bushing
from flexclear.scene.loose_joints import SURFACES, Clearance
from flexclear.scene.parts import UNSEEN
from flexclear.scene.quantity import parse
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

#: loads that are effects of the environment on a mechanism, and do not drive it
OF_THE_WORLD = ("gravity", "joint-friction")
#: kinds of effects, as in reports
CLEARANCE, FLEXIBILITY, BACKLASH = "clearance", "flexibility", "backlash"
#: effects that an ideal mechanism lacks, and the name of a scene without them
EFFECTS = {CLEARANCE: "without clearance", FLEXIBILITY: "rigid"}
#: kinds of effects on request: of these types of loads, others are forces
KINDS = {"bushing": "bushing", "spring-damper": "spring", "joint-spring": "spring"}
KINDS |= {"pid": "controller", "sampled-pid": "controller"}
#: keys of a flexible body that a rigid one from the same recipe also has
SHARED_KEYS = ("mesh", "segment", "pose", "velocity", "angular_velocity", *UNSEEN)
#: settings that follow the parts: quantities of removed parts are no longer requested or shown
FOLLOWING = ("accuracy", "view", "ensemble")
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect of a scene. name: its key path. kind: kind of effect. within: effect that this one depends on, as
    friction depends on its clearance; else empty. joint: type of the ideal joint in the place of a bushing."""

    name: str
    kind: str
    within: str = ""
    joint: str = ""

    @property
    def owner(self) -> str:
        """Name of the effect's part."""
        return self.name.split(".")[1]

    @property
    def words(self) -> str:
        """Description in words."""
        instead = f" instead of a {self.joint} joint" if self.joint else ""
        return self.owner if self.kind == "gravity" else f"{self.kind} of {self.owner}{instead}"


def effects(scene: Scene) -> tuple[Effect, ...]:
    """Return the removable effects of a scene, flexible bodies first, each followed by those that depend on it."""
    listed = list[Effect]()
    rods = scene.rods()
    for name, body in ((name, scene.flexible()[pieces[0]]) for name, pieces in rods.items()):
        whole = Effect(f"body.{name}.modes", FLEXIBILITY)
        listed.append(whole)
        for key in ("damping", "stiffening"):
            if getattr(body, key) is not None:
                listed.append(Effect(f"body.{name}.{key}", key, whole.name))
    for name, joint in scene.contacts().items():
        removable = name in replaceable_contacts(scene)
        if removable:
            listed.append(Effect(f"joint.{name}.clearance", CLEARANCE))
        for key in ("friction", "film"):
            if getattr(joint, key, None) is not None:
                listed.append(Effect(f"joint.{name}.{key}", key, f"joint.{name}.clearance" if removable else ""))
    listed += [Effect(f"joint.{name}.friction", "friction") for name in scene.joints_with_friction()]
    for name, load in scene.load.items():
        if load.type in OF_THE_WORLD:
            listed.append(Effect(f"load.{name}", "gravity" if load.type == "gravity" else "friction"))
    listed += [Effect(f"stop.{name}", "stop") for name in scene.stop]
    listed += [
        Effect(f"gear.{name}.backlash", BACKLASH) for name, gear in scene.gear.items() if gear.backlash is not None
    ]
    return tuple(listed)


def effects_of(scene: Scene, places: Collection[str], where: str) -> tuple[Effect, ...]:
    """Return the effects with these names, and all those of parts with these names, such as ``load.spring``.

    Without names, those of `effects`. Raises InputError, at `where`, for a name that is neither, and lists the nearest.
    """
    usual = effects(scene)
    if not places:
        return usual
    known = {effect.name: effect for effect in (*_effects_on_request(scene), *usual)}
    names = {name: {name, ".".join(name.split(".")[:2])} for name in known}
    every, asked = set().union(*names.values()), set(places)
    for place in sorted(asked - every):
        raise InputError(f"{where} {place}", "is no effect and no removable part", suggestion(place, sorted(every)))
    chosen = [name for name in known if names[name] & asked]
    within = {name: {known[name].within, *names[name]} & set(chosen) - {name} for name in chosen}
    return tuple(replace(known[name], within="".join(within[name])) for name in chosen)


def _effects_on_request(scene: Scene) -> Iterator[Effect]:
    """Yield parts whose effect is examined on request only: contacts without ideal counterpart, loads, gears."""
    for name in scene.contacts():
        if name not in replaceable_contacts(scene):
            yield Effect(f"joint.{name}", "contact")
    for name, load in scene.forces().items():
        joint = _joint_for(load) if isinstance(load, Bushing) else ""
        yield Effect(f"load.{name}", KINDS.get(load.type, "force"), joint=joint)
    for name in scene.gear:
        yield Effect(f"gear.{name}", "gear")


def _joint_for(bushing: Bushing) -> str:
    """Return the type of the ideal joint that holds what a bushing holds; empty where it carries nothing across z.

    It turns about z of the bushing's frame, about all axes where the bushing turns freely.
    """
    x, y, z, *turning = (bushing.stiffness[k][k] for k in range(6))
    if not (x and y):
        return ""
    return "cylindrical" if not z else "revolute" if any(turning) else "spherical"


def effects_by_name(scene: Scene, names: Iterable[str], where: str) -> tuple[Effect, ...]:
    """Return the effects with these names; raise InputError, with the nearest name, for an unknown one."""
    known = {effect.name: effect for effect in effects(scene)}
    for name in names:
        if name not in known:
            raise InputError(f"{where} {name}", "is not an effect of this scene", suggestion(name, known))
    return tuple(known[name] for name in names)


def without_effects(scene: Scene, gone: Collection[Effect]) -> Scene:
    """Return the scene without some of its effects; quantities that the rest does not have are no longer requested.

    The name lists the removed effects. Without any the scene itself is returned.
    """
    if not gone:
        return scene
    changes = dict(_changes(scene, gone)) | _settings(scene, gone)
    requests = {key: None for key in ("accuracy", "view", "ensemble") if getattr(scene, key) is not None}
    result = edited(scene, changes | requests)
    if requests:
        result = edited(scene, changes | _requests(scene, result))
    result._name = f"{scene.name} without {', '.join(sorted(effect.name for effect in gone))}"
    return result


def ideal_scene(scene: Scene, effects_gone: Collection[str] = tuple(EFFECTS)) -> Scene:
    """Return the ideal mechanism of a scene: without clearance, flexibility, or both, with the scene's name.

    Raises InputError when the scene has none of them.
    """
    gone = idealised_effects(scene, effects_gone)
    if not gone:
        raise InputError(
            str(scene.path or scene.name),
            f"has no {' and no '.join(effects_gone)} that can be removed",
            "compare it with another scene: flexclear compare A B",
        )
    result = without_effects(scene, gone)
    result._name = scene.name
    return result


def idealised_effects(scene: Scene, kinds: Collection[str] = tuple(EFFECTS)) -> list[Effect]:
    """Return the effects of these kinds, of EFFECTS, that the ideal mechanism lacks; with clearance goes backlash."""
    every = {*kinds, *([BACKLASH] if CLEARANCE in kinds else [])}
    return [effect for effect in effects(scene) if effect.kind in every]


def contacts_that_stay(types: Mapping[str, str]) -> list[str]:
    """Return the names of contacts that an ideal mechanism keeps, as no ideal joint has their place.

    types: type of each joint, by name.
    """
    return [name for name, kind in types.items() if kind in SURFACES and SURFACES[kind].ideal is None]


def replaceable_contacts(scene: Scene) -> dict[str, Clearance]:
    """Return joints with clearance that have an ideal counterpart, by name: all but balls on planes."""
    return {name: joint for name, joint in scene.contacts().items() if joint.ideal is not None}


def _requests(scene: Scene, bare: Scene) -> dict[str, Any]:
    """Return edits that remove requests for quantities which `bare`, the scene without some effects, does not have."""
    keys: dict[str, Any] = {}
    owners = bare.owners()
    if scene.ensemble is not None and not owners["contact"]:
        keys["ensemble"] = None
    if scene.accuracy is not None and scene.accuracy.quantities:
        table = scene.accuracy.model_dump(exclude_none=True)
        table["quantities"] = {n: w for n, w in table["quantities"].items() if _has_part(n, owners)}
        keys["accuracy"] = table if table["quantities"] else None
    if scene.view is not None and scene.view.watch is not None:
        watched = [name for name in scene.view.watch if _has_part(name, owners)]
        keys |= {"view.watch": watched} if watched else {"view": None}
    return keys


def _has_part(name: str, owners: dict[str, dict[str, bool]]) -> bool:
    try:
        parse(name, owners)
    except ValueError:
        return False
    return True


def _settings(scene: Scene, gone: Collection[Effect]) -> dict[str, Any]:
    """Return edits of settings for removed flexible bodies: what is recorded of them, deformations at the start."""
    rigid = {effect.owner for effect in gone if effect.kind == FLEXIBILITY}
    settings: dict[str, Any] = {}
    if any(rigid & set(names) for names in scene.output.requests().values()):
        settings["output"] = scene.output.without(rigid)
    if scene.start is not None and rigid & set(scene.start.modal):
        start = scene.start.model_dump(mode="json", exclude_none=True)
        settings["start"] = start | {"modal": {k: v for k, v in start["modal"].items() if k not in rigid}}
    return settings


def _changes(scene: Scene, gone: Collection[Effect]) -> Mapping[str, Any]:
    """Return key path -> replacement, or None for a removed part."""
    changes: dict[str, Any] = {}
    places = {effect.name for effect in gone}
    for effect in gone:
        if effect.within in places:
            continue
        family, name = effect.name.split(".")[:2]
        if family == "body" and name not in scene.body:
            for piece in scene.rods()[name]:
                changes |= _changes(scene, [replace(effect, name=effect.name.replace(name, piece, 1))])
            continue
        part = getattr(scene, family)[name]
        if effect.joint:
            joint = name if name not in scene.joint else f"{name}_ideal"
            changes |= {effect.name: None, f"joint.{joint}": {"type": effect.joint, "between": list(part.between)}}
        elif effect.kind == CLEARANCE:
            changes[f"joint.{name}"] = {"type": part.ideal, "between": list(part.between)}
        elif effect.kind == FLEXIBILITY:
            unchanged = part.model_dump(mode="json", include=set(SHARED_KEYS), exclude_none=True)
            changes[f"body.{name}"] = {"type": "rigid", **unchanged}
        elif effect.name.count(".") == 1:
            changes[effect.name] = None
        else:
            key = effect.name.split(".")[2]
            table = changes.get(f"{family}.{name}") or part.model_dump(mode="json", exclude_none=True)
            gone_keys = OF_TEETH if effect.kind == BACKLASH else (key,)
            changes[f"{family}.{name}"] = {k: v for k, v in table.items() if k not in gone_keys}
    return changes


def with_modes(scene: Scene, counts: Mapping[str, int]) -> Scene:
    """Return the scene with other numbers of elastic coordinates, by flexible body."""
    changes: dict[str, Any] = {}
    for name, count in counts.items():
        body = scene.flexible()[name]
        modes = body.modes.model_dump(mode="json", exclude_none=True, exclude={"count", "up_to", "compliance", "mass"})
        changes[f"body.{name}.modes"] = {**modes, "count": count}
    return edited(scene, changes) if changes else scene


def uncoupled_paths(scene: Scene, asked: Collection[str]) -> tuple[str, ...]:
    """Return paths, such as ``body.bob``, of all parts that nothing couples to the parts with the names `asked`.

    Empty where a name is of no part, and where a setting refers to a part that could be removed.
    """
    table = scene.model_dump(mode="json", exclude_none=True)
    parts = {f"{family}.{name}": part for family in FAMILIES for name, part in table.get(family, {}).items()}
    moving = [name for name, body in scene.body.items() if body.type != "ground"]
    neighbours: dict[str, set[str]] = {f"body.{name}": set() for name in moving}
    for part_name, part in parts.items():
        if part_name.startswith("body."):
            continue
        stems = {text.partition(".")[0] for text in _texts(part)}
        named = {f"body.{n}" for n in stems & set(moving)} | {f"joint.{n}" for n in stems & set(scene.joint)}
        for other in named - {part_name}:
            neighbours.setdefault(part_name, set()).add(other)
            neighbours.setdefault(other, set()).add(part_name)
    ends = [part_name for part_name in neighbours if part_name.partition(".")[2] in asked]
    if {part_name.partition(".")[2] for part_name in ends} != set(asked):
        return ()
    reached = set(ends)
    while ends:
        new = neighbours[ends.pop()] - reached
        reached |= new
        ends += new
    uncoupled_parts = [part_name for part_name in parts if part_name in neighbours and part_name not in reached]
    names = {part_name.partition(".")[2] for part_name in uncoupled_parts}
    referenced = {text.partition(".")[0] for key in SETTINGS if key not in FOLLOWING for text in _texts(table.get(key))}
    return () if names & referenced else tuple(uncoupled_parts)


def without_parts(scene: Scene, removed: Collection[str]) -> Scene:
    """Return the scene without these parts; the scene itself where none are given."""
    if not removed:
        return scene
    return edited(scene, dict.fromkeys((*removed, *FOLLOWING)))


def _texts(value: object) -> Iterator[str]:
    """Yield all texts in a table, and its keys."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield str(key)
            yield from _texts(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)


def variant_text(scene: Scene, planned: Scene, extends: str, comments: Iterable[str] = ()) -> str:
    """Return the file of a variant: it extends the scene's file, and contains only parts and settings that differ.

    Parts are replaced or removed; a setting that differs is written as a whole table. comments: lines at the head.
    """
    lines = [f"# {line}" for line in comments]
    lines += [f"extends = {json.dumps(extends)}", f"title = {json.dumps(planned.title, ensure_ascii=False)}"]
    was, now = (s.model_dump(mode="json", exclude_none=True) for s in (scene, planned))
    removed = [f"{f}.{name}" for f in FAMILIES for name in was.get(f, {}) if name not in now.get(f, {})]
    settings = [key for key in was if key not in (*FAMILIES, "title", "description")]
    removed += [key for key in settings if key not in now]
    if removed:
        lines.append(f"remove = {_value(removed)}")
    for key in now:
        if key in FAMILIES or key in ("title", "description") or was.get(key) == now[key]:
            continue
        lines += ["", f"[{key}]", *(f"{_key(k)} = {_value(v)}" for k, v in now[key].items())]
    for family in FAMILIES:
        for name, part in now.get(family, {}).items():
            if part != was[family][name]:
                lines += [
                    "",
                    f"[replace.{family}.{_key(name)}]",
                    *(f"{_key(k)} = {_value(v)}" for k, v in part.items()),
                ]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    """Return a value in TOML, tables inline."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return ("true" if value else "false") if isinstance(value, bool) else repr(value)


def relative_path(target: Path, base: Path) -> str:
    """Return a path from a file's folder to the scene that it extends; in full where that is on another drive."""
    try:
        return Path(os.path.relpath(base.resolve(), target.resolve().parent)).as_posix()
    except ValueError:
        return base.resolve().as_posix()
