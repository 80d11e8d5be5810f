"""The ideal mechanism of a scene: clearance or flexibility taken away, everything else as it is."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from flexclear.pipeline.core.scene.appearance import UNSEEN
from flexclear.pipeline.core.scene.clearance import Clearance
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.quantity import parse
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError

#: effects that can be taken away, and how a scene without them is called
EFFECTS = {"clearance": "without clearance", "flexibility": "rigid"}
#: joint with clearance -> the joint that connects the same frames without; slots and planes have none
WITHOUT_CLEARANCE = {"clearance-revolute": "revolute", "clearance-spherical": "spherical"}
#: keys of a flexible body that a rigid one from the same recipe has, too
KEPT = ("mesh", "pose", "velocity", "angular_velocity", *UNSEEN)


def ideal(scene: Scene, effects: tuple[str, ...] = tuple(EFFECTS)) -> Scene:
    """The scene without these effects; quantities that it then no longer has are not asked for.

    Raises InputError when the scene has none of them.
    """
    changes: dict[str, Any] = {}
    if "clearance" in effects:
        for name, joint in loose(scene).items():
            changes[f"joint.{name}"] = {"type": WITHOUT_CLEARANCE[joint.type], "between": list(joint.between)}
    if "flexibility" in effects:
        for name, body in scene.flexible().items():
            unchanged = body.model_dump(mode="json", include=set(KEPT), exclude_none=True)
            changes[f"body.{name}"] = {"type": "rigid", **unchanged}
    if not changes:
        raise InputError(
            str(scene.path or scene.name),
            f"has no {' and no '.join(effects)} that could be taken away",
            "compare it with another scene: flexclear compare A B",
        )
    if "flexibility" in effects and scene.output.stress is not None:
        changes["output"] = scene.output.without(scene.output.stress)
    return edited(scene, changes | owned(scene, tuple(loose(scene)) if "clearance" in effects else ()))


def loose(scene: Scene) -> dict[str, Clearance]:
    """The joints with clearance that have an ideal counterpart, by name: pins and balls, not slots and planes."""
    return {name: joint for name, joint in scene.contacts().items() if joint.type in WITHOUT_CLEARANCE}


def owned(scene: Scene, left: Collection[str]) -> dict[str, Any]:
    """Edits of what is asked for, where the joints with clearance, or the stops, of these names are taken away."""
    keys: dict[str, Any] = {}
    owners = scene.owners()
    if left:
        loosened = ("contact", "worn")
        owners |= {
            of: {n: turns for n, turns in owners[of].items() if n.partition(".")[0] not in left} for of in loosened
        }
        if not owners["contact"]:
            keys["ensemble"] = None
        if scene.accuracy is not None:
            requested = {
                n: w.model_dump(exclude_none=True) for n, w in scene.accuracy.quantities.items() if _has(n, owners)
            }
            rest = scene.accuracy.model_dump(exclude={"quantities"}, exclude_none=True)
            keys["accuracy"] = {**rest, "quantities": requested} if requested else None
        if scene.view is not None and scene.view.watch is not None:
            watched = [name for name in scene.view.watch if _has(name, owners)]
            keys["view.watch"] = watched or None
            if not watched:
                keys["view"] = None
                del keys["view.watch"]
    return keys


def _has(name: str, owners: dict[str, dict[str, bool]]) -> bool:
    try:
        parse(name, owners)
    except ValueError:
        return False
    return True
