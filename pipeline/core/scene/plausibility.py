"""What a scene could mean, but what looks like a slip: of units, as a bare number for millimetres, or a lost joint."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import combinations
from math import dist, sqrt, tau
from typing import TYPE_CHECKING

from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.scene.clearance import ClearanceRevolute, ClearanceSlot, ClearanceSpherical
from flexclear.pipeline.core.scene.drives import JointDrive
from flexclear.pipeline.core.scene.loads import Pid, SampledPid
from flexclear.pipeline.core.scene.parts import Ground, RigidBody

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene

SI = 'bare numbers are SI; with a unit they are text, as "0.2 mm" or "100 kg mm^2"'
#: radius of gyration over the extent of a body's frames from which on it is odd: kg m^2 for kg mm^2 makes it 1000
#: times larger, a flywheel on a short crank ten times
FAR = 30.0
#: mass over the cube of the extent of a body's frames from which on it is odd [kg/m^3]: lead has 1.1e4; g for kg make a
#: body 1000 times heavier, short spacing of frames on a large body a hundred times
DENSE = 2e6
#: a bare angle of at least so many, in whole multiples of the other, is one of degrees [rad]
TURNED, DEGREES = 30.0, 15.0
#: a body that so many frames connect with others has its joints
CONNECTED = 2


def oddities(scene: Scene) -> list[InputError]:
    """What looks odd, in words, placed as mistakes are; nothing of it is refused."""
    return [*_clearances(scene), *_inertias(scene), *_angles(scene), *_gains(scene), *_rows(scene), *_loose_ends(scene)]


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
        points = [frame.position for frame in body.frames.values()]
        if len(points) > 1:  # of one frame, the distance of the centre of mass may be an unbalance
            points.append(body.com)
        extent = max((dist(a, b) for a, b in combinations(points, 2)), default=0.0)
        gyration = sqrt(max(body.inertia[k][k] for k in range(3)) / body.mass)
        if extent > 0.0 and body.mass > DENSE * max(extent, gyration) ** 3:
            text = f"{body.mass:g} kg for a body whose frames lie within {extent:.3g} m"
            yield _odd(scene, f"body.{name}.mass", text)
        if extent > 0.0 and gyration > FAR * extent:
            yield _odd(
                scene,
                f"body.{name}.inertia",
                f"a radius of gyration of {gyration:.3g} m for a body whose frames lie within {extent:.3g} m",
            )


def _angles(scene: Scene) -> Iterator[InputError]:
    """Bare numbers that would be degrees."""
    for name, drive in scene.drive.items():
        joint = scene.joint.get(drive.joint) if isinstance(drive, JointDrive) else None
        if not isinstance(drive, JointDrive) or joint is None or joint.type != "revolute":
            continue
        for key in ("change", "amplitude"):
            given = getattr(drive.law, key, ())
            for value in given if isinstance(given, (list, tuple)) else (given,):
                if isinstance(value, (int, float)) and abs(value) >= TURNED and value % DEGREES == 0.0:
                    text = f"{value:g} rad are {abs(value) / tau:.3g} turns"
                    hint = f'bare numbers are SI; write "{value:g} deg" for degrees'
                    yield _odd(scene, f"drive.{name}.law.{key}", text, hint)


def _gains(scene: Scene) -> Iterator[InputError]:
    for name, load in scene.load.items():
        for key in ("proportional", "integral", "derivative") if isinstance(load, (Pid, SampledPid)) else ():
            value = getattr(load, key)
            if isinstance(value, (int, float)) and value < 0.0:
                text = f"{value:g} pushes the coordinate away from its reference"
                yield _odd(scene, f"load.{name}.{key}", text, "a positive gain pushes it towards the reference")


def _rows(scene: Scene) -> Iterator[InputError]:
    length = scene.time.end - scene.time.start
    if scene.output.interval > length:
        text = (
            f"{scene.output.interval:g} s is longer than the run of {length:g} s, of which only the ends are recorded"
        )
        yield _odd(scene, "output.interval", text, "choose a shorter one")


def _loose_ends(scene: Scene) -> Iterator[InputError]:
    """Two bodies that hang by one frame, while other frames of theirs are there that nothing uses."""
    table = scene.model_dump(mode="json", exclude={"body"}, exclude_none=True)
    connecting = json.dumps([table.get(kind) for kind in ("joint", "load", "drive")])
    text, ends, some = json.dumps(table), list[str](), False
    for name, body in scene.body.items():
        if isinstance(body, Ground):
            continue
        own = [f"{name}.{frame}" for frame in getattr(body, "frames", {})]
        unused = [frame for frame in own if f'"{frame}' not in text]
        used = len(set(re.findall(rf'"{re.escape(name)}\.(\w+)', connecting)))
        recipe = getattr(body, "mesh", None) is not None  # its frames are in another file
        if used < CONNECTED and (unused or recipe):
            ends += unused or [f"a frame of {name}"]
            some |= bool(unused)
    if some and len(ends) >= CONNECTED:
        yield _odd(scene, "joint", f"nothing connects {' and '.join(ends)}", "is a joint missing?")


def _odd(scene: Scene, key: str, text: str, hint: str = SI) -> InputError:
    where = f"{scene.path} [{key}]" if scene.path is not None else f"[{key}]"
    return InputError(where, text, hint)
