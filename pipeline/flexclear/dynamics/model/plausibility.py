"""Plausibility checks of an assembled mechanism: pins that start outside their joints, joints that may be missing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from flexclear.dynamics.effects.stops.model import STOP, End
from flexclear.dynamics.model.mechanism import Contact, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.scene.schema import Scene
from flexclear.scene.variants import loose
from flexclear.system.errors import InputError

#: contact surfaces of a pin or ball in a hollow part
ROUND = ("clearance-revolute", "clearance-spherical")
#: frames closer than this fraction of the mechanism's size are at one point; penetrations below this fraction of
#: clearance or radius count as touching
SAME_POINT = 1e-3


def offsets(mechanism: Mechanism) -> Iterator[tuple[Contact, np.ndarray, Placement]]:
    """Yield each pin and ball: its contact, its offset [m] from the middle of the hollow part, and its start pose.

    The offset of a pin leaves out the component along its axis, which is arbitrary.
    """
    for contact in mechanism.contacts:
        if contact.joint.type == STOP or contact.joint.type not in ROUND:
            continue
        outer, inner = (mechanism.links[s.link].start.of(s.placement) for s in (contact.outer, contact.inner))
        away = inner.p - outer.p
        if contact.joint.type == "clearance-revolute":
            away = away - (away @ outer.R[:, 2]) * outer.R[:, 2]
        yield contact, away, inner


def refuse_missed(mechanism: Mechanism) -> None:
    """Raise InputError for a pin or ball that starts outside its hollow part, with the distance."""
    for contact, away, _ in offsets(mechanism):
        joint, distance = contact.joint, float(np.linalg.norm(away))
        if distance <= joint.clearance + joint.radius:
            continue
        names = ("socket", "ball") if joint.type == "clearance-spherical" else ("journal", "pin")
        raise InputError(
            f"[{contact.place}.between]",
            f"the {names[1]} ('{joint.between[1]}') starts {length(distance)} from the centre of its {names[0]} "
            f"('{joint.between[0]}'), where the clearance allows {length(joint.clearance)}",
            "correct poses or frames; a bare number is in metres: 50 is 50 m",
        )


def refuse_overlap(mechanism: Mechanism) -> None:
    """Raise InputError for a ball or pin of a rigid mechanism that starts within the material of hollow part or plane.

    Small overlaps, which rounding of poses may cause, pass: the run closes the loops exactly.
    """
    scene = mechanism.scene
    if scene.start is not None and scene.start.at is not None:
        return
    for contact, away, _ in offsets(mechanism):
        depth = float(np.linalg.norm(away)) - contact.joint.clearance
        if depth > SAME_POINT * contact.joint.clearance:
            refuse_depth(scene, contact, depth)
    for contact in mechanism.contacts:
        if contact.joint.type == "ball-on-plane":
            plane, ball = (mechanism.links[s.link].start.of(s.placement) for s in (contact.outer, contact.inner))
            depth = contact.joint.radius - float((ball.p - plane.p) @ plane.R[:, 2])
            if depth > SAME_POINT * contact.joint.radius:
                refuse_depth(scene, contact, depth)


def refuse_depth(scene: Scene, contact: Contact, depth: float) -> None:
    """Raise InputError for a start penetration `depth` [m or rad] of surfaces, unless an approach speed is given."""
    joint = contact.joint
    if joint.initial_approach_speed is not None:
        return
    problem, remedy = f"its surfaces start with a penetration of {length(depth)}", "enlarge the clearance"
    problem += f" (clearance {length(joint.clearance)})"
    if joint.type == "ball-on-plane":
        problem, remedy = f"the ball starts with a penetration of {length(depth)} into the plane", "lower the plane"
    elif isinstance(joint, End):
        unit = "rad" if joint.coordinate.turning else "m"
        problem, remedy = f"the coordinate starts {depth:.3g} {unit} beyond {joint.limit:.6g} {unit}", "move the end"
    elif contact.name in loose(scene):
        remedy = "start the joint as without clearance ([start] at = 'ideal'), " + remedy
    raise InputError(
        f"[{contact.place}]",
        problem,
        f"move a body, {remedy}, or declare the speed at which this contact began as initial_approach_speed",
    )


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


def missing_joints(mechanism: Mechanism) -> list[tuple[str, str, str]]:
    """Return unused frames at one point of two unconnected bodies, where a joint may be missing: body, text, remedy."""
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
            result.append((mechanism.frames[a].body, text, remedy))
    return result


def _links(mechanism: Mechanism, frames: tuple[str, str]) -> list[int]:
    return [mechanism.link_of[mechanism.frames[frame].body] for frame in frames]


def _position(mechanism: Mechanism, frame: str) -> np.ndarray:
    """Return the start position of a frame, from the kernels' origin [m]."""
    there = mechanism.frames[frame]
    link = mechanism.links[mechanism.link_of[there.body]]
    position: np.ndarray = link.start.of(link.placements[there.body]).point(there.placement.p)
    return position
