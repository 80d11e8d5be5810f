"""Forces and moments of every joint, also of those between rigidly joined bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.core.scene.drives import PathDrive
from pipeline.core.scene.parts import RigidBody
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.record.motion import Motion

Wrench = tuple[np.ndarray, np.ndarray]  #: moment about the kernels' origin, force; (time, 3) each, world axes


def joint_wrenches(
    model: Model, seen: dict[str, np.ndarray], bodies: Mapping[str, Motion], frames: Mapping[str, np.ndarray]
) -> dict[str, Wrench]:
    """Wrench of every joint on its second body: force [N], moment [N m] about that body's frame origin.

    Returned as (moment, force).
    """
    found = _tree(model, seen) | _closures(model, seen)
    for name, (moment, force) in _contacts(model, seen).items():
        held = found.get(name, (0.0, 0.0))  # what a clearance joint holds beside its contact
        found[name] = (held[0] + moment, held[1] + force)
    found |= _inside_groups(model, seen, bodies, found)
    result = {}
    for name, joint in model.scene.joint.items():
        moment, force = found[name]
        result[name] = (moment - np.cross(frames[joint.between[1]], force), force)
    return result


def path_wrenches(model: Model, seen: dict[str, np.ndarray]) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """For every frame that a drive leads along a path: its name, moment about the kernels' origin, force."""
    found, drives = _tree(model, seen), model.scene.drive
    paths = {f"drive.{name}": drive.frame for name, drive in drives.items() if isinstance(drive, PathDrive)}
    return [(frame, *found[edge]) for edge, frame in paths.items() if edge in found]


def _tree(model: Model, seen: dict[str, np.ndarray]) -> dict[str, Wrench]:
    found = {}
    table = seen["link_wrench"].reshape(len(seen["link_wrench"]), -1, 6)
    for i, link in enumerate(model.mechanism.links):
        edge = link.branch.edge
        if edge is not None:
            sign = -1.0 if link.branch.reverse else 1.0
            found[edge.name] = (sign * table[:, i, :3], sign * table[:, i, 3:])
    return found


def _closures(model: Model, seen: dict[str, np.ndarray]) -> dict[str, Wrench]:
    table = seen["closure_wrench"].reshape(len(seen["closure_wrench"]), -1, 6)
    return {
        model.mechanism.closures[k][0].name: (table[:, row, :3], table[:, row, 3:])
        for row, k in enumerate(model.closure_order)
    }


def _contacts(model: Model, seen: dict[str, np.ndarray]) -> dict[str, Wrench]:
    touch = seen["touch"].reshape(len(seen["touch"]), -1, m.TOUCH.size)
    found = {}
    for c, (name, *_) in enumerate(model.mechanism.contacts):
        force = touch[:, c, m.TOUCH.force : m.TOUCH.force + 3]
        found[name] = (np.cross(touch[:, c, m.TOUCH.point : m.TOUCH.point + 3], force), force)
    return found


def _inside_groups(
    model: Model, seen: dict[str, np.ndarray], bodies: Mapping[str, Motion], known: Mapping[str, Wrench]
) -> dict[str, Wrench]:
    """Wrenches of the fixed joints inside each link, by Newton and Euler for the bodies beyond them."""
    scene, mechanism = model.scene, model.mechanism
    found: dict[str, Wrench] = {}
    for link in mechanism.links:
        inner = [n for n, j in scene.joint.items() if _is_inside(model, j.between, link.places) and n not in known]
        demand = {b: _demand(model, seen, b, bodies, known) for b in link.places}
        tree = _forest(model, inner, list(link.places))
        for name in inner:
            if name not in tree:
                # a second path between bodies that are joined already: it carries nothing here
                zero = np.zeros_like(next(iter(demand.values()))[0])
                found[name] = (zero, zero)
                continue
            side, sign = _far_side(model, name, tree, list(link.places))
            moment, force = (sign * np.sum([demand[b][k] for b in side], axis=0) for k in (0, 1))
            found[name] = (moment, force)
    return found


def _is_inside(model: Model, between: tuple[str, str], places: Mapping[str, object]) -> bool:
    return all(model.mechanism.frames[f].body in places for f in between)


def _demand(
    model: Model,
    seen: dict[str, np.ndarray],
    name: str,
    bodies: Mapping[str, Motion],
    known: Mapping[str, Wrench],
) -> Wrench:
    """What the fixed joints must supply to a body: its inertia less gravity, loads, paths and all other joints."""
    scene = model.scene
    times = len(next(iter(bodies.values())).p)
    moment, force = np.zeros((times, 3)), np.zeros((times, 3))
    body = scene.body[name]
    if isinstance(body, RigidBody):
        motion = bodies[name]
        J = motion.R @ np.array(body.inertia) @ np.swapaxes(motion.R, 1, 2)
        force = body.mass * (motion.a - model.arrays.table(m.GRAVITY)["acceleration"][0])
        spin = np.einsum("tij,tj->ti", J, motion.omega)
        moment = np.einsum("tij,tj->ti", J, motion.alpha) + np.cross(motion.omega, spin) + np.cross(motion.p, force)
    for joint_name, (n, f) in known.items():
        a, b = _joined(model, joint_name)
        if name in (a, b):
            sign = 1.0 if name == b else -1.0
            moment, force = moment - sign * n, force - sign * f
    if scene.forces():
        from pipeline.dynamics.record.loads import on_body

        n, f = on_body(model, seen, name)
        moment, force = moment - n, force - f
    return moment, force


def _joined(model: Model, name: str) -> tuple[str, str]:
    """Bodies of a joint; of a path, which holds against the world, its body alone."""
    scene, frames = model.scene, model.mechanism.frames
    if name in scene.joint:
        a, b = scene.joint[name].between
        return frames[a].body, frames[b].body
    path = scene.drive[name.partition(".")[2]]
    assert isinstance(path, PathDrive)
    return "", frames[path.frame].body


def _forest(model: Model, names: list[str], bodies: list[str]) -> list[str]:
    """Fixed joints that span the bodies, in scene order."""
    root = {b: b for b in bodies}

    def top(b: str) -> str:
        while root[b] != b:
            b = root[b]
        return b

    kept = []
    for name in names:
        a, b = (top(model.mechanism.frames[f].body) for f in model.scene.joint[name].between)
        if a != b:
            root[a] = b
            kept.append(name)
    return kept


def _far_side(model: Model, name: str, tree: list[str], bodies: list[str]) -> tuple[set[str], float]:
    """Bodies on one side of a fixed joint, without the ground; +1 for the second body's side."""
    frames, scene = model.mechanism.frames, model.scene
    a, b = (frames[f].body for f in scene.joint[name].between)
    others = [tuple(frames[f].body for f in scene.joint[n].between) for n in tree if n != name]

    def reach(start: str) -> set[str]:
        found, stack = {start}, [start]
        while stack:
            body = stack.pop()
            for x, y in others:
                for near, far in ((x, y), (y, x)):
                    if near == body and far not in found:
                        found.add(far)
                        stack.append(far)
        return found

    side = reach(b)
    if any(scene.body[body].type == "ground" for body in side):
        return reach(a), -1.0
    return side, 1.0
