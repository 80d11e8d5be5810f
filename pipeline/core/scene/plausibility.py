"""Values of a scene that could be meant, but look like a slip of units, as a bare number for millimetres does."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import dist, sqrt
from typing import TYPE_CHECKING

from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.scene.clearance import ClearanceRevolute, ClearanceSlot, ClearanceSpherical
from flexclear.pipeline.core.scene.parts import RigidBody

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene

#: radius of gyration over the extent of a body's frames from which on it is odd: kg m^2 for kg mm^2 makes it 1000
#: times larger, a flywheel on a short crank ten times
FAR = 30.0


def oddities(scene: Scene) -> list[InputError]:
    """What looks odd, in words, placed as mistakes are; nothing of it is refused."""
    return [*_clearances(scene), *_inertias(scene)]


def _clearances(scene: Scene) -> Iterator[InputError]:
    for name, joint in scene.joint.items():
        if isinstance(joint, (ClearanceRevolute, ClearanceSlot, ClearanceSpherical)) and joint.clearance > joint.radius:
            inner = "ball" if isinstance(joint, ClearanceSpherical) else "pin"
            text = f"{1e3 * joint.clearance:g} mm is more than the {inner}'s radius, {1e3 * joint.radius:g} mm"
            yield _odd(scene, f"joint.{name}.clearance", text)


def _inertias(scene: Scene) -> Iterator[InputError]:
    for name, body in scene.body.items():
        if not isinstance(body, RigidBody):
            continue
        places = [body.com, *(frame.position for frame in body.frames.values())]
        extent = max((dist(a, b) for a, b in combinations(places, 2)), default=0.0)
        gyration = sqrt(max(body.inertia[k][k] for k in range(3)) / body.mass)
        if extent > 0.0 and gyration > FAR * extent:
            yield _odd(
                scene,
                f"body.{name}.inertia",
                f"a radius of gyration of {gyration:.3g} m for a body whose frames lie within {extent:.3g} m",
            )


def _odd(scene: Scene, key: str, text: str) -> InputError:
    where = f"{scene.path} [{key}]" if scene.path is not None else f"[{key}]"
    return InputError(where, text, 'bare numbers are SI; with a unit they are text, as "0.2 mm" or "100 kg mm^2"')
