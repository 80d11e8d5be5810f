"""Plausibility checks: values that could be intended, but look like an error of units, of sign or of digits."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, Any

from flexclear.scene.drives import JointDrive
from flexclear.scene.laws import Constant, Harmonic, Piecewise, Repeated, Spline, Step, Sum
from flexclear.scene.loads import Pid, SampledPid
from flexclear.scene.loose_joints import ClearancePrismatic
from flexclear.scene.owners import is_angle
from flexclear.scene.parts import Ground, RigidBody
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

#: largest plausible ratio of a pin's radius or length to the size of the mechanism
LARGE = 3.0
#: largest plausible ratio of a body's radius of gyration to the extent of its frames: with kg m^2 for kg mm^2 the ratio
#: is 1000 times larger, with a flywheel on a short crank ten times
FAR = 30.0
#: density [kg/m^3] above which no inertia is plausible; point masses of textbooks reach 1e8
DENSE = 1e9
#: a bare angle that is a whole multiple of the first number and not below the second looks like degrees
DEGREES, FEWEST_DEGREES = 5.0, 30.0
UNITS = 'bare numbers are SI; with a unit they are text, as "0.2 mm" or "100 kg mm^2"'


def implausible_values(scene: Scene) -> list[InputError]:
    """Return implausible values, located as validation errors are; none of them is refused."""
    checks = (
        _oversized_clearances,
        _oversized_pins,
        _misplaced_bearings,
        _oversized_inertias,
        _impossible_masses,
        _intervals,
        _angles_like_degrees,
        _gains,
    )
    return [warning for check in checks for warning in check(scene)]


def _oversized_clearances(scene: Scene) -> Iterator[InputError]:
    """Yield clearances larger than the part that moves in them."""
    for name, joint in scene.contacts().items():
        what, size = (
            ("half height", 0.5 * joint.height) if isinstance(joint, ClearancePrismatic) else ("radius", joint.radius)
        )
        if joint.clearance > size:
            text = f"{1e3 * joint.clearance:g} mm is more than the {joint.surfaces[1]}'s {what}, {1e3 * size:g} mm"
            yield warning(scene, f"joint.{name}.clearance", text, UNITS)


def _oversized_pins(scene: Scene) -> Iterator[InputError]:
    """Yield pins and balls that are larger than the whole mechanism; frames of meshes are not known here."""
    bodies = scene.rigid().values()
    points = [point for body in scene.body.values() for point in _points(body, getattr(body, "pose", None))]
    extents = [_extent([body.com, *(frame.position for frame in body.frames.values())]) for body in bodies]
    extents += [sqrt(max(body.inertia[k][k] for k in range(3)) / body.mass) for body in bodies if body.mass]
    size = max([*extents, _extent(points)], default=0.0)
    for name, joint in scene.contacts().items():
        for key in ("pin_radius", "ball_radius", "length", "height", "width") if size > 0.0 else ():
            value = getattr(joint, key, None)
            refused = joint.hollow and key.endswith("radius") and value is not None and value >= max(1.0, 15.0 * size)
            if value is not None and value > LARGE * size and not refused:
                text = f"{value:g} m is more than the size of the mechanism, {size:.3g} m"
                yield warning(scene, f"joint.{name}.{key}", text, UNITS)


def _misplaced_bearings(scene: Scene) -> Iterator[InputError]:
    """Yield frames of a body without a pose that no part names, as another unused frame that a joint may have joined.

    The other frame has the same name, or is the only unused one of the ground.
    """
    written = scene.model_dump_json(exclude={"body", "title", "description"}, exclude_none=True)
    known = {name: body for name, body in scene.body.items() if isinstance(body, (Ground, RigidBody))}
    unused = [
        (name, frame) for name, body in known.items() for frame in body.frames if f"{name}.{frame}" not in written
    ]
    joined = [{frame.partition(".")[0] for frame in getattr(part, "between", ())} for part in scene.joint.values()]
    lone = [(name, frame) for name, frame in unused if getattr(known[name], "pose", known[name]) is None]
    for name, frame in lone if scene.joint else ():
        others = [(other, its) for other, its in unused if other != name and {name, other} not in joined]
        same = [(o, f) for o, f in others if f == frame] or [(o, f) for o, f in others if isinstance(known[o], Ground)]
        if len(same) == 1 and (same[0][1] == frame or len(lone) == 1):
            other = ".".join(same[0])
            text = f"the frames '{other}' and '{name}.{frame}' are unused: is a joint missing?"
            remedy = f'add a joint with between = ["{other}", "{name}.{frame}"], or remove the frames'
            yield warning(scene, f"body.{name}.frames.{frame}", text, remedy)


def _oversized_inertias(scene: Scene) -> Iterator[InputError]:
    """Yield inertias too large for a body of its size; a body with one frame is compared with the whole scene."""
    scene_points = [point for body in scene.body.values() for point in _points(body, getattr(body, "pose", None))]
    whole = _extent(scene_points)
    for name, body in scene.rigid().items():
        own = _extent([body.com, *(frame.position for frame in body.frames.values())])
        extent = own or whole
        if not body.mass:
            continue
        gyration = sqrt(max(body.inertia[k][k] for k in range(3)) / body.mass)
        # 1.0: density [kg/m^3], about that of air, above which a body may well be much larger than the extent of its
        # frames, as a disc on a thin shaft
        if extent > 0.0 and gyration > FAR * extent and least_density(body) < 1.0:
            size = f"the body's frames span {own:.3g} m" if own else f"the whole scene spans {whole:.3g} m"
            text = f"mass and inertia give a radius of gyration of {gyration:.3g} m, but {size}"
            yield warning(scene, f"body.{name}.inertia", text, UNITS)


def _points(body: Any, pose: Any) -> list[tuple[float, float, float]]:
    """Return points that span a scene: origins of bodies and of frames of the ground."""
    if pose is not None:
        return [pose.position]
    return [frame.position for frame in getattr(body, "frames", {}).values()]


def _extent(points: list[tuple[float, float, float]]) -> float:
    """Return the diagonal of the box around points."""
    return sqrt(sum((max(x) - min(x)) ** 2 for x in zip(*points, strict=True)))


def _impossible_masses(scene: Scene) -> Iterator[InputError]:
    """Yield masses that no body with its inertia can have."""
    bodies = {name: body for name, body in scene.rigid().items() if body.mass}
    for name, body in bodies.items():
        others = max((other.mass for key, other in bodies.items() if key != name), default=inf)
        density = least_density(body)
        # the same limit for a body whose mass exceeds that of every other body of the scene by the second factor
        heavy = body.mass > 100.0 * others
        if DENSE < density < inf or (heavy and 1e6 < density < inf):
            trace = sum(body.inertia[k][k] for k in range(3))
            text = (
                f"a body of {body.mass:g} kg with a radius of gyration of {1e3 * sqrt(trace / 2.0 / body.mass):.3g} mm "
                f"has a density of at least {density:.1g} kg/m^3 (steel: 7850)"
            )
            yield warning(scene, f"body.{name}.mass", text, f"correct mass or inertia; {UNITS}")


def least_density(body: RigidBody) -> float:
    """Return the least density [kg/m^3] of a body with its mass and inertia: that of a homogeneous ball.

    Of all bodies with the same mass and sum of principal moments the ball has the largest volume; inf without inertia.
    """
    squared = 5.0 / 3.0 * sum(body.inertia[k][k] for k in range(3)) / 2.0 / body.mass
    return body.mass / (4.0 / 3.0 * pi * squared**1.5) if squared > 0.0 else inf


def _intervals(scene: Scene) -> Iterator[InputError]:
    duration = scene.time.end - scene.time.start
    if scene.output.interval > duration * (1.0 + 1e-9):
        text = (
            f"{scene.output.interval:g} s exceeds the run's duration of {duration:g} s: only start, end and events are "
            "recorded"
        )
        yield warning(scene, "output.interval", text, f'choose a shorter one, as "{1e3 * duration / 200:.1g} ms"')


def _angles_like_degrees(scene: Scene) -> Iterator[InputError]:
    """Yield bare numbers of angles that look like degrees."""
    for name, drive in scene.drive.items():
        if isinstance(drive, JointDrive) and is_angle(scene, drive):
            yield from _degrees(scene, f"drive.{name}.law", _angles_of(drive.law))
        elif not isinstance(drive, JointDrive):
            for part, law in drive.components():
                if part.startswith("rotation"):
                    yield from _degrees(scene, f"drive.{name}.{part}", _angles_of(law))
    for name, load in scene.load.items():
        if isinstance(load, (Pid, SampledPid)) and load.measured is None and is_angle(scene, load):
            yield from _degrees(scene, f"load.{name}.reference", _angles_of(load.reference))
    for name, stop in scene.stop.items():
        if is_angle(scene, stop):
            for end in stop.ends:
                yield from _degrees(scene, f"stop.{name}.{end}", [getattr(stop, end)])
    for name, gear in scene.gear.items():
        if is_angle(scene, gear):
            yield from _degrees(scene, f"gear.{name}.backlash", [gear.backlash])


def _degrees(scene: Scene, key: str, values: list[Any]) -> Iterator[InputError]:
    for value in values:
        bare = isinstance(value, (int, float)) and abs(value) >= FEWEST_DEGREES and value % DEGREES == 0.0
        if bare:
            text = f"{value:g} without a unit is {value:g} rad, which is {value / (2.0 * pi):.3g} turns"
            yield warning(
                scene, key, text, f'write "{value:g} deg" for degrees, or "{value:g} rad" if radians are meant'
            )
            return


def _angles_of(law: Any) -> list[Any]:
    """Return the values of a law that are angles; none of a polynomial, whose coefficients are mostly rates."""
    match law:
        case Constant():
            return [law.value]
        case Step():
            return list(law.change)
        case Harmonic():
            return [*law.amplitude, law.offset]
        case Spline():
            return list(law.value)
        case Sum():
            return [value for part in law.laws for value in _angles_of(part)]
        case Piecewise():
            return [value for section in law.sections for value in _angles_of(section.law)]
        case Repeated():
            return _angles_of(law.law)
    return []


def _gains(scene: Scene) -> Iterator[InputError]:
    for name, key in negative_gains(scene):
        value = getattr(scene.load[name], key)
        gain = value if isinstance(value, str) else f"{value:g}"
        text = f"the gain {gain} is negative: the controller pushes away from its reference"
        yield warning(scene, f"load.{name}.{key}", text, "write a positive gain, or turn the joint's axis")


def negative_gains(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield the names of controllers with negative gains, each with the key of the gain."""
    for name, load in scene.load.items():
        if isinstance(load, (Pid, SampledPid)):
            for key in ("proportional", "integral", "derivative"):
                value = getattr(load, key)
                if float(str(value).partition(" ")[0]) < 0.0:
                    yield name, key


def warning(scene: Scene, key: str, text: str, remedy: str) -> InputError:
    """Return a warning about the value of a key."""
    where = f"{scene.path} [{key}]" if scene.path is not None else f"[{key}]"
    return InputError(where, text, remedy)
