"""Components of a scene that own quantities, by the dimension of the run; a scene is any object with its parts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from flexclear.scene.drives import PathDrive
from flexclear.scene.films import actions_of, films_of
from flexclear.scene.loads import Bushing, Pid, SampledPid
from flexclear.scene.parts import Ground
from flexclear.scene.quantity import KINDS
from flexclear.scene.segments import body_frames

#: joint type -> its coordinates by name, and whether each is an angle, as in the classes of the joints
COORDINATES: Mapping[str, Mapping[str, bool]] = {
    "revolute": {"rotation": True},
    "prismatic": {"translation": False},
    "cylindrical": {"rotation": True, "translation": False},
    "slot": {"translation": False, "rotation": True},
    "planar": {"x": False, "y": False, "rotation": True},
    "universal": {"first": True, "second": True},
}
#: quantities of the whole mechanism that require loads, and one that requires flexible bodies
_OF_LOADS, _OF_MODES = ("load_work", "load_loss"), ("modal_damping_loss",)


def owners(scene: Any) -> dict[str, dict[str, bool]]:
    """Return names by `quantity.OWNERS`, and whether each acts about an axis, so that forces are torques."""
    forces, contacts, moving = (
        scene.forces(),
        scene.pairs(),
        _without_rotation(name for name, body in scene.body.items() if not isinstance(body, Ground)),
    )
    stops = {f"{name}.{end}": is_angle(scene, stop) for name, stop in scene.stops().items() for end in stop.ends}
    controllers = {name: load for name, load in forces.items() if isinstance(load, (Pid, SampledPid))}
    modes = {name: body.modes.count for name, body in scene.flexible().items()}
    unread = {name for name, mesh in scene.recipes().items() if not mesh}
    return {
        "body": moving,
        "frame": _Frames(_frames(scene), unread),
        "joint": _without_rotation(scene.joint),
        "coordinate": _coordinates(scene),
        "drive": dict(_drives(scene)),
        "controller": {name: is_angle(scene, load) for name, load in controllers.items()},
        "gear": {name: _is_angle(scene, gear.second) for name, gear in scene.gear.items()},
        "load": {name: _measures_angle(scene, load) for name, load in forces.items()},
        "bushing": _without_rotation(name for name, load in forces.items() if isinstance(load, Bushing)),
        "film": _without_rotation(films_of(scene)),
        "contact": _without_rotation(contacts) | stops,
        "rubbing": _without_rotation(scene.joints_with_friction()),
        "worn": _without_rotation(scene.wearing_joints()),
        "mode": _without_rotation(f"{n}.{k}" for n, c in modes.items() if isinstance(c, int) for k in range(1, c + 1)),
        "section": _without_rotation(scene.output.stress or ()),
        "gauge": _without_rotation(
            n for body in scene.output.stress or () for n in (body, *scene.output.gauge_names(body))
        ),
        "": _without_rotation(_names_of_all(scene)),
    }


def _without_rotation(names: Any) -> dict[str, bool]:
    return dict.fromkeys(names, False)


def _names_of_all(scene: Any) -> Iterator[str]:
    for key, kind in KINDS.items():
        possible = (key not in _OF_LOADS or actions_of(scene)) and (key not in _OF_MODES or scene.flexible())
        if kind.owner == "" and kind.variable and possible:
            yield key


class _Frames(dict[str, bool]):
    """Names of frames; of bodies whose recipe is left out where their bundle is given, any frame may exist."""

    def __init__(self, names: Iterable[str], unread: Collection[str]) -> None:
        super().__init__(_without_rotation(names))
        self.unread = unread

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or str(name).partition(".")[0] in self.unread

    def __missing__(self, name: str) -> bool:
        return False


def _frames(scene: Any) -> Iterator[str]:
    """Yield frames of bodies; of bodies whose recipe cannot be read, the frames that the scene names."""
    for name, body in scene.body.items():
        mesh, own = getattr(body, "mesh", ""), getattr(body, "frames", None)
        known = body_frames(mesh, body.segment) if mesh else own
        yield from (f"{name}.{frame}" for frame in known or ())
    for part in (*scene.joint.values(), *scene.load.values(), *scene.drive.values()):
        yield from getattr(part, "between", ())
        yield from (part.frame,) if hasattr(part, "frame") else ()


def _coordinates(scene: Any) -> dict[str, bool]:
    return {
        name if len(known) == 1 else f"{name}.{coordinate}": turns
        for name, joint in scene.joint.items()
        for known in [COORDINATES.get(joint.type, {})]
        for coordinate, turns in known.items()
    }


def _drives(scene: Any) -> Iterator[tuple[str, bool]]:
    for name, drive in scene.drive.items():
        if isinstance(drive, PathDrive):
            yield from ((f"{name}.{part}", part.startswith("rotation")) for part, _ in drive.components())
        else:
            yield name, is_angle(scene, drive)
    for name, event in scene.event.items():
        if event.kind == "lock":
            yield from ((held, turning) for held, (_, turning) in locked_coordinates(scene, name, event).items())


def locked_coordinates(scene: Any, name: str, event: Any) -> dict[str, tuple[str, bool]]:
    """Return the coordinates that a lock called `name` holds: name of the drive -> coordinate, and whether an angle."""
    joint = scene.joint.get(event.part[1])
    known = COORDINATES.get(joint.type, {}) if joint is not None else {}
    return {f"{name}.{c}" if len(known) > 1 else name: (c, turning) for c, turning in known.items()}


def is_angle(scene: Any, part: Any) -> bool:
    """Return True when the coordinate of a part with `joint` and `coordinate` is an angle."""
    joint = scene.joint.get(part.joint)
    known = COORDINATES.get(joint.type, {}) if joint is not None else {}
    return known.get(part.coordinate or next(iter(known), ""), False)


def _is_angle(scene: Any, text: str) -> bool:
    """Return True when the coordinate ``A`` or ``A.rotation`` is an angle."""
    known = _coordinates(scene)
    return known.get(text, known.get(text.partition(".")[0], False))


def _measures_angle(scene: Any, load: Any) -> bool:
    if getattr(load, "measured", None):
        return _is_angle(scene, load.measured)
    return hasattr(load, "joint") and is_angle(scene, load)
