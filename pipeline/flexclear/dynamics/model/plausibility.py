"""Plausibility checks of an assembled mechanism: pins that start outside their joints, joints that may be missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from math import ceil, floor, log10
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics.contact.surfaces import SURFACES
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.mechanism import Contact, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.stops import End
from flexclear.dynamics.vectors import ZERO
from flexclear.scene.loads import Gravity, SpringDamper
from flexclear.scene.schema import Scene
from flexclear.scene.variants import replaceable_contacts
from flexclear.system.errors import InputError, errors_from

#: frames closer than this fraction of the mechanism's size are at one point; penetrations below this fraction of
#: clearance or radius count as touching
SAME_POINT = 1e-3
#: joints of planar mechanisms: their z axis is one about which bodies turn, or along which they slide; largest sine of
#: the angle, and largest difference of its cosine from 1, between directions that count as parallel
PLANAR = {"revolute": "turns", "planar": "turns", "prismatic": "slides", "fixed": "fixed"}
PARALLEL = 1e-6
#: penetrations above this fraction of clearance or radius are mistakes, not contacts that began before the start
DEEP = 0.1


class Separation(NamedTuple):
    """A contact in a pose of its mechanism: depth of its surfaces [m or rad], and closest point of its outer part.

    offset: of the inner frame from that point [m].  inner: pose of the inner frame.
    """

    contact: Contact
    depth: float
    offset: np.ndarray
    inner: Placement


def separations(mechanism: Mechanism) -> Iterator[Separation]:
    """Yield the contacts in the mechanism's start pose, but for ends of combined coordinates."""
    poses = [link.start for link in mechanism.links]
    for contact in mechanism.contacts:
        outer, inner = (poses[site.link].of(start_place(mechanism, site)) for site in (contact.outer, contact.inner))
        joint = contact.joint
        if contact.others:  # the start of a run counts the turns of both coordinates, by which their difference jumps
            continue
        if isinstance(joint, End):
            beyond = joint.value(outer, inner) - joint.limit
            yield Separation(contact, joint.sense * beyond, np.zeros(3), inner)
        else:
            surfaces = SURFACES[joint.type]
            (axes, a), (_, b) = outer.pose, inner.pose
            gap, *_, offset = surfaces.separation(joint, axes, b - a, ZERO)
            yield Separation(contact, -float(gap), np.array(offset), inner)


def start_errors(mechanism: Mechanism, *, final: bool = True) -> list[InputError]:
    """Return the errors of a start pose: parts outside their hollow parts, surfaces that overlap, and springs without
    length.

    Small overlaps, which rounding of poses may cause, pass, and those which the assembly of flexible bodies may remove.
    final: False for a pose close to which an equilibrium is searched; only parts outside of others are errors there.
    """
    scene, slack = mechanism.scene, 0.0 if mechanism.all_rigid else 2.0 * mechanism.start_residual
    checks = list[Callable[[], None]]()
    for contact, depth, offset, _ in separations(mechanism):
        if depth > contact.joint.radius + slack and contact.joint.hollow:
            checks.append(partial(_refuse_missed, contact, offset))
        elif final and depth > SAME_POINT * max(contact.joint.clearance, contact.joint.radius) + slack:
            checks.append(partial(refuse_depth, scene, contact, depth))
    for name, load in scene.forces().items() if final else ():
        frames = getattr(load, "between", ())
        if frames and len(set(_links(mechanism, frames))) == 2:
            ends = [_position(mechanism, frame) for frame in frames]
            checks.append(
                partial(_refuse_short, name, load, float(np.linalg.norm(ends[1] - ends[0])), mechanism.length)
            )
    return errors_from(checks)


def _refuse_missed(contact: Contact, offset: np.ndarray) -> None:
    """Raise InputError for a pin or ball outside its hollow part, with the distance."""
    joint: Any = contact.joint
    (hollow, inner), away = joint.surfaces, length(float(np.linalg.norm(offset)))
    raise InputError(
        f"[{contact.place}.between]",
        f"the {inner} ('{joint.between[1]}') starts {away} from the {joint.middle} of its {hollow} "
        f"('{joint.between[0]}'), where the clearance allows {length(joint.clearance)}",
        "correct poses or frames; a bare number is in metres: 50 is 50 m",
    )


def _refuse_short(name: str, load: Any, distance: float, size: float) -> None:
    """Raise InputError for a spring or damper of zero length: it has no direction; size: of the mechanism [m]."""
    directed = isinstance(load, SpringDamper) and (load.damping > 0.0 or load.free_length)
    # springs shorter than this fraction of the mechanism's size have no direction
    if directed and distance <= 1e-9 * size:
        raise InputError(
            f"[load.{name}.between]",
            "its two ends coincide at the start, so that its force has no direction",
            "move an end; only a spring with free_length = 0 and without damping may start so",
        )


def refuse_depth(scene: Scene, contact: Contact, depth: float) -> None:
    """Raise InputError for a start penetration `depth` [m or rad] of surfaces, unless an approach speed is given."""
    joint = contact.joint
    if joint.initial_approach_speed is not None:
        return
    problem = f"its surfaces start with a penetration of {length(depth)} (clearance {length(joint.clearance)})"
    remedies = ["move a body", "enlarge the clearance"]
    if isinstance(joint, End):
        unit = "rad" if joint.coordinate.turning else "m"
        problem = f"the coordinate starts {depth:.3g} {unit} beyond {joint.limit:.6g} {unit}"
        end, more = ("upper", "more") if joint.sense > 0.0 else ("lower", "less")
        remedies = [f"set {end} to {_beyond(joint, depth):.6g} {unit} or {more}"]
    elif not joint.hollow:
        outer, inner = joint.surfaces
        problem = f"the {inner} starts with a penetration of {length(depth)} into the {outer}"
        remedies[1] = f"lower the {outer}"
    elif contact.owner in replaceable_contacts(scene) and (scene.start is None or scene.start.at != "ideal"):
        remedies.insert(1, "start the joint as without clearance ([start] at = 'ideal')")
    if depth <= DEEP * max(joint.clearance, joint.radius):
        remedies.append("declare the speed at which this contact began as initial_approach_speed")
    *others, last = remedies
    raise InputError(f"[{contact.place}]", problem, f"{', '.join(others)}, or {last}" if others else last)


def _beyond(end: End, depth: float) -> float:
    """Return a limit with a tenth of `depth` to spare, rounded: loose pins may rest elsewhere without the stop."""
    unit = 10.0 ** (floor(log10(depth)) - 1)
    return end.sense * ceil((end.sense * end.limit + 1.1 * depth) / unit) * unit


def length(metres: float) -> str:
    """Return a length as text in m, mm or um."""
    for factor, unit in ((1.0, "m"), (1e3, "mm")):
        if metres * factor >= 1.0:
            return f"{metres * factor:.4g} {unit}"
    return f"{metres * 1e6:.4g} um"


def unused_frames(mechanism: Mechanism) -> list[str]:
    """Return the frames that the scene names nowhere outside its bodies."""
    written = mechanism.scene.model_dump_json(exclude={"body", "title", "description"}, exclude_none=True)
    return [name for name in mechanism.frames if name not in written]


def doubts(mechanism: Mechanism) -> list[tuple[str, str, str]]:
    """Return what an assembled mechanism may lack or have by mistake: place in the scene, text and remedy of each."""
    return [*_missing_joints(mechanism), *_idle_gravity(mechanism)]


def _idle_gravity(mechanism: Mechanism) -> Iterator[tuple[str, str, str]]:
    """Yield the gravity that acts along the axes about which a planar mechanism of rigid bodies turns."""
    scene, axes = mechanism.scene, dict[str, list[np.ndarray]]()
    for joint in scene.joint.values():
        frame = mechanism.frames[joint.between[0]]
        link = mechanism.links[mechanism.link_of[frame.body]]
        R = link.start.of(link.placements[frame.body]).of(frame.placement).R
        axes.setdefault(PLANAR.get(getattr(joint, "held", None) or joint.type, ""), []).append(R[:, 2])
    normals, slides = (np.array(axes.get(key, [])).reshape(-1, 3) for key in ("turns", "slides"))
    apart = any(link.branch.edge is None or link.on_path for link in mechanism.links[1:])
    if not len(normals) or "" in axes or apart or scene.joints_with_friction() or not mechanism.all_rigid:
        return
    planar = np.all(abs(normals @ normals[0]) > 1.0 - PARALLEL) and np.all(abs(slides @ normals[0]) < PARALLEL)
    for name, load in scene.load.items():
        if planar and isinstance(load, Gravity):
            g = np.array(load.acceleration)
            if abs(g @ normals[0]) > (1.0 - PARALLEL) * np.linalg.norm(g) > 0.0:
                text = f"{[float(x) for x in g]} m/s^2 is along the axes of all joints, so that it moves nothing"
                loose = any(getattr(joint, "held", None) for joint in scene.joint.values())
                tilts = "; to let loose pins tilt under it, write clearance-spherical joints" if loose else ""
                yield f"[load.{name}.acceleration]", text, f"turn it into the plane of motion{tilts}, or remove it"


def _missing_joints(mechanism: Mechanism) -> list[tuple[str, str, str]]:
    """Return unused frames at one point of two unconnected bodies, where a joint may be missing."""
    parts = (*mechanism.scene.joint.values(), *mechanism.scene.load.values())
    connected = {frozenset(_links(mechanism, part.between)) for part in parts if hasattr(part, "between")}
    result = []
    for a, b in combinations(unused_frames(mechanism), 2):
        links = _links(mechanism, (a, b))
        if links[0] == links[1] or frozenset(links) in connected:
            continue
        if np.linalg.norm(_position(mechanism, a) - _position(mechanism, b)) <= SAME_POINT * mechanism.length:
            text = f"the frames '{a}' and '{b}' are unused and start at the same point: is a joint missing?"
            remedy = f'add a joint with between = ["{a}", "{b}"], or remove the frames'
            result.append((f"[body.{mechanism.frames[a].body}]", text, remedy))
    return result


def _links(mechanism: Mechanism, frames: tuple[str, str]) -> list[int]:
    return [mechanism.link_of[mechanism.frames[frame].body] for frame in frames]


def _position(mechanism: Mechanism, frame: str) -> np.ndarray:
    """Return the start position of a frame, from the mechanism's origin [m]."""
    there = mechanism.frames[frame]
    link = mechanism.links[mechanism.link_of[there.body]]
    position: np.ndarray = link.start.of(link.placements[there.body]).point(there.placement.p)
    return position
