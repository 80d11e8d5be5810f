"""Wrenches of every joint, including joints between rigidly joined bodies."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model.gears import Coupling
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record import gears, stops
from flexclear.dynamics.record.motion import Motions
from flexclear.numerics.rotations import cross, rotate
from flexclear.scene.drives import PathDrive

Wrench = tuple[np.ndarray, np.ndarray]  #: moment about the mechanism's origin, force; (time, 3) each, world axes
FrameWrench = tuple[str, np.ndarray, np.ndarray]  #: frame on which a wrench acts, and the wrench


#: of effects: frames on which they act, moments and forces
ACTING = {"gears": gears.on_geared_frames, "stops": stops.on_stopped_frames}


def joint_wrenches(motions: Motions, names: Collection[str] | None = None) -> dict[str, Wrench]:
    """Return the wrenches of joints on their second bodies: moment about that body's frame origin [N m], force [N].

    names: of the joints; all when None.
    """
    requested = list(motions.model.scene.joint if names is None else names)
    moment, force = every_joint_wrench(motions, requested)
    return {name: (moment[:, k], force[:, k]) for k, name in enumerate(requested)}


def every_joint_wrench(motions: Motions, names: Sequence[str]) -> Wrench:
    """Return moments [N m] and forces [N] of several joints, as `joint_wrenches` does, (time, joint, 3) each."""
    model, seen = motions.model, motions.seen
    known = _tree(model, seen) | _closures(model, seen)
    for c, (name, pair) in enumerate(model.scene.pairs().items()):
        owner = name.partition(".")[0]
        moment, force = known.get(owner, (0.0, 0.0))  # constraints of a clearance joint beyond its contacts
        push = -seen.touch["force"][:, c] if pair.swapped else seen.touch["force"][:, c]
        known[owner] = (moment + cross(seen.touch["point"][:, c], push), force + push)
    if any(name not in known for name in names):
        known |= _inside_groups(motions, known)
    for k, (name, _) in enumerate(model.loads):
        owner = name.removesuffix(".film")
        if owner != name:
            moment, force = known[owner]
            known[owner] = (moment + seen.loads["moment"][:, k], force + seen.loads["force"][:, k])
    moments, forces = (np.empty((len(seen.state), len(names), 3)) for _ in range(2))
    for k, name in enumerate(names):
        moments[:, k], forces[:, k] = known[name]
    arms = motions.positions([model.scene.joint[name].between[1] for name in names])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        moments[..., i] -= arms[..., j] * forces[..., k] - arms[..., k] * forces[..., j]
    return moments, forces


def held_moments(motions: Motions) -> dict[int, np.ndarray]:
    """Return the moments that keep pins parallel to their journals: sizes [N m], (rows,), by index of the contact."""
    model, seen = motions.model, motions.seen
    known, held = _tree(model, seen) | _closures(model, seen), dict[int, np.ndarray]()
    for c, contact in enumerate(model.contacts[: model.arrays.size(m.N_SURFACES)]):
        if contact.name in known:
            (moment, force), outer = known[contact.name], contact.outer
            moment = moment - cross(motions.positions([contact.joint.between[1]])[:, 0], force)
            axis = motions.link(outer.link).R @ outer.placement.R[:, 2]
            held[c] = np.linalg.norm(cross(axis, moment), axis=1)
    return held


def path_wrenches(model: Model, seen: Observed) -> list[FrameWrench]:
    """Return for each frame that a drive moves along a path: its name, moment about the mechanism's origin, force."""
    tree, drives = _tree(model, seen), model.scene.drive
    paths = {f"drive.{name}": drive.frame for name, drive in drives.items() if isinstance(drive, PathDrive)}
    return [(frame, *tree[edge]) for edge, frame in paths.items() if edge in tree]


def on_frames(model: Model, seen: Observed, body: str) -> list[FrameWrench]:
    """Return the wrenches on a body from loads and effects, without joints and paths."""
    on_each: list[FrameWrench] = []
    if model.loads:
        from flexclear.dynamics.record.loads import on_loaded_frames

        on_each += on_loaded_frames(model, seen)
    for on_its_frames in model.parts.functions(ACTING):
        on_each += on_its_frames(model, seen)
    return [acting for acting in on_each if model.mechanism.frames[acting[0]].body == body]


def _tree(model: Model, seen: Observed) -> dict[str, Wrench]:
    moment, force = (seen.link_wrenches[field] for field in ("moment", "force"))
    wrenches = dict[str, Wrench]()
    for i, link in enumerate(model.links):
        if link.branch.edge is not None:
            sign = -1.0 if link.branch.reverse else 1.0
            wrenches[link.branch.edge.name] = sign * moment[:, i], sign * force[:, i]
    return wrenches


def _closures(model: Model, seen: Observed) -> dict[str, Wrench]:
    moment, force = (seen.closure_wrenches[field] for field in ("moment", "force"))
    joints = [(c, closure) for c, closure in enumerate(model.closures) if not isinstance(closure, Coupling)]
    return {closure.name: (moment[:, c], force[:, c]) for c, closure in joints}


def _inside_groups(motions: Motions, known: Mapping[str, Wrench]) -> dict[str, Wrench]:
    """Return the wrenches of fixed joints inside each link, by Newton and Euler for the bodies on one side."""
    model, rows, inside = motions.model, len(motions.seen.state), dict[str, Wrench]()
    beyond = list[tuple[str, list[str], float]]()  # bodies on the far side; +1 where they are the second body's
    for link in model.links:
        others = {name: _bodies_of_joint(model, name) for name in model.scene.joint if name not in known}
        inner = [name for name, bodies in others.items() if link.placements.keys() >= set(bodies)]
        # a redundant joint between bodies of one link gets a zero wrench
        inside |= {name: (np.zeros((rows, 3)), np.zeros((rows, 3))) for name in inner}
        tree = dict[str, tuple[str, str]]()
        for name in inner:
            a, b = others[name]
            tree |= {} if b in connected_bodies(a, tree.values()) else {name: (a, b)}
        for name, (a, b) in tree.items():
            rest = [pair for other, pair in tree.items() if other != name]
            far, sign = connected_bodies(b, rest), 1.0
            if any(model.scene.body[body].type == "ground" for body in far):
                far, sign = connected_bodies(a, rest), -1.0
            bodies = [body for body in link.placements if body in far and body in model.mechanism.moving_bodies]
            beyond += [(name, bodies, sign)] if bodies else []
    acting = [(_bodies_of_joint(model, joint), wrench) for joint, wrench in known.items()]
    for name, bodies, sign in beyond:
        moment, force = np.sum([_needed_wrench(motions, body) for body in bodies], axis=0)
        for (first, second), (n, f) in acting:
            out, into = first in bodies, second in bodies
            if out != into:
                moment, force = (moment + n, force + f) if out else (moment - n, force - f)
        for body in bodies:
            for _, n, f in on_frames(model, motions.seen, body):
                moment, force = moment - n, force - f
        inside[name] = sign * moment, sign * force
    return inside


def _needed_wrench(motions: Motions, name: str) -> Wrench:
    """Return the wrench that a rigid body needs for its motion, less its weight."""
    motion, body = motions.body(name), motions.model.scene.rigid()[name]
    force, back = body.mass * (motion.a - motions.model.gravity), motion.R.swapaxes(1, 2)
    omega, J = rotate(back, motion.omega), np.array(body.inertia)
    spin = rotate(J, rotate(back, motion.alpha)) + cross(omega, rotate(J, omega))
    return rotate(motion.R, spin) + cross(motion.p, force), force


def _bodies_of_joint(model: Model, name: str) -> tuple[str, str]:
    """Return the two bodies of a joint; for a path, which acts from the world, an empty name and its body."""
    scene, frames = model.scene, model.mechanism.frames
    if name in scene.joint:
        a, b = scene.joint[name].between
        return frames[a].body, frames[b].body
    path = scene.drive[name.partition(".")[2]]
    assert isinstance(path, PathDrive)
    return "", frames[path.frame].body


def connected_bodies(start: str, pairs: Collection[tuple[str, str]]) -> set[str]:
    """Return the bodies that joined pairs connect to one body, including that body."""
    there, ends = {start}, [start]
    while ends:
        here = ends.pop()
        new = {body for pair in pairs if here in pair for body in pair} - there
        there |= new
        ends += new
    return there
