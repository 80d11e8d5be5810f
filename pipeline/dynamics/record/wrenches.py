"""Forces and moments of every joint, also of those between rigidly joined bodies."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from flexclear.pipeline.core.scene.drives import PathDrive
from flexclear.pipeline.core.scene.parts import RigidBody
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.couplings import Coupling
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.record.acting import on_body
from flexclear.pipeline.dynamics.record.motion import Motions

Wrench = tuple[np.ndarray, np.ndarray]  #: moment about the kernels' origin, force; (time, 3) each, world axes


def joint_wrenches(motions: Motions, names: Collection[str] | None = None) -> dict[str, Wrench]:
    """Wrench of joints on their second bodies: moment about that body's frame origin [N m], force [N].

    names: of the joints; all when None.
    """
    model, seen = motions.model, motions.seen
    known = _tree(model, seen) | _closures(model, seen)
    for c, contact in enumerate(model.contacts[: model.arrays.size(m.N_SURFACES)]):
        moment, force = known.get(contact.name, (0.0, 0.0))  # what a clearance joint holds beside its contact
        push = seen.touch["force"][:, c]
        known[contact.name] = (moment + np.cross(seen.touch["point"][:, c], push), force + push)
    wanted = model.scene.joint if names is None else names
    if any(name not in known for name in wanted):
        known |= _inside_groups(motions, known)
    result = {}
    for name in wanted:
        moment, force = known[name]
        arm = motions.frame_position(model.scene.joint[name].between[1])
        result[name] = (moment - np.cross(arm, force), force)
    return result


def path_wrenches(model: Model, seen: Observed) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """For every frame that a drive leads along a path: its name, moment about the kernels' origin, force."""
    tree, drives = _tree(model, seen), model.scene.drive
    paths = {f"drive.{name}": drive.frame for name, drive in drives.items() if isinstance(drive, PathDrive)}
    return [(frame, *tree[edge]) for edge, frame in paths.items() if edge in tree]


def _tree(model: Model, seen: Observed) -> dict[str, Wrench]:
    wrenches = {}
    for i, link in enumerate(model.links):
        if link.branch.edge is not None:
            sign = -1.0 if link.branch.reverse else 1.0
            wrenches[link.branch.edge.name] = _wrench(seen.link_wrenches[:, i], sign)
    return wrenches


def _closures(model: Model, seen: Observed) -> dict[str, Wrench]:
    joints = [(c, closure) for c, closure in enumerate(model.closures) if not isinstance(closure, Coupling)]
    return {closure.name: _wrench(seen.closure_wrenches[:, c]) for c, closure in joints}


def _wrench(rows: np.ndarray, sign: float = 1.0) -> Wrench:
    return sign * rows["moment"], sign * rows["force"]


def _inside_groups(motions: Motions, known: Mapping[str, Wrench]) -> dict[str, Wrench]:
    """Wrenches of the fixed joints inside each link, by Newton and Euler for the bodies beyond them."""
    model, inside = motions.model, dict[str, Wrench]()
    for link in model.links:
        every = model.scene.joint.items()
        inner = [n for n, j in every if n not in known and _is_inside(model, j.between, link.places)]
        demand = {b: _demand(motions, b, known) for b in link.places}
        tree = _forest(model, inner, list(link.places))
        for name in inner:
            if name not in tree:
                # a second path between bodies that are joined already: it carries nothing here
                zero = np.zeros_like(next(iter(demand.values()))[0])
                inside[name] = (zero, zero)
                continue
            side, sign = _far_side(model, name, tree)
            moment, force = (sign * np.sum([demand[b][k] for b in side], axis=0) for k in (0, 1))
            inside[name] = (moment, force)
    return inside


def _is_inside(model: Model, between: tuple[str, str], places: Mapping[str, object]) -> bool:
    return all(model.mechanism.frames[f].body in places for f in between)


def _demand(motions: Motions, name: str, known: Mapping[str, Wrench]) -> Wrench:
    """What the fixed joints must supply to a body: its inertia less gravity, loads, paths and all other joints."""
    model, seen = motions.model, motions.seen
    moment, force = np.zeros((len(seen.state), 3)), np.zeros((len(seen.state), 3))
    body = model.scene.body[name]
    if isinstance(body, RigidBody):
        motion = motions.bodies[name]
        J = motion.R @ np.array(body.inertia) @ np.swapaxes(motion.R, 1, 2)
        force = body.mass * (motion.a - model.gravity)
        spin = np.einsum("tij,tj->ti", J, motion.omega)
        moment = np.einsum("tij,tj->ti", J, motion.alpha) + np.cross(motion.omega, spin) + np.cross(motion.p, force)
    for joint_name, (n, f) in known.items():
        a, b = _joined(model, joint_name)
        if name in (a, b):
            sign = 1.0 if name == b else -1.0
            moment, force = moment - sign * n, force - sign * f
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


def _far_side(model: Model, name: str, tree: list[str]) -> tuple[set[str], float]:
    """Bodies on one side of a fixed joint, without the ground; +1 for the second body's side."""
    frames, scene = model.mechanism.frames, model.scene
    a, b = (frames[f].body for f in scene.joint[name].between)
    others = [tuple(frames[f].body for f in scene.joint[n].between) for n in tree if n != name]

    def reach(start: str) -> set[str]:
        reached, stack = {start}, [start]
        while stack:
            body = stack.pop()
            for x, y in others:
                for near, far in ((x, y), (y, x)):
                    if near == body and far not in reached:
                        reached.add(far)
                        stack.append(far)
        return reached

    side = reach(b)
    if any(scene.body[body].type == "ground" for body in side):
        return reach(a), -1.0
    return side, 1.0
