"""Forces and moments of every joint, also of those between rigidly joined bodies."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexclear.pipeline.core.numerics.rotations import cross
from flexclear.pipeline.core.scene.drives import PathDrive
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects.gears.model import Coupling
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.record.motion import Motions

Wrench = tuple[np.ndarray, np.ndarray]  #: moment about the kernels' origin, force; (time, 3) each, world axes
Acting = tuple[str, np.ndarray, np.ndarray]  #: the same with the frame on which it acts


def joint_wrenches(motions: Motions, names: Collection[str] | None = None) -> dict[str, Wrench]:
    """Wrench of joints on their second bodies: moment about that body's frame origin [N m], force [N].

    names: of the joints; all when None.
    """
    requested = list(motions.model.scene.joint if names is None else names)
    moment, force = every_joint_wrench(motions, requested)
    return {name: (moment[:, k], force[:, k]) for k, name in enumerate(requested)}


def every_joint_wrench(motions: Motions, names: Sequence[str]) -> Wrench:
    """The same of several joints at once, (time, joint, 3)."""
    model, seen = motions.model, motions.seen
    known = _tree(model, seen) | _closures(model, seen)
    for c, contact in enumerate(model.contacts[: model.arrays.size(m.N_SURFACES)]):
        moment, force = known.get(contact.name, (0.0, 0.0))  # what a clearance joint holds next to its contact
        push = seen.touch["force"][:, c]
        known[contact.name] = (moment + cross(seen.touch["point"][:, c], push), force + push)
    if any(name not in known for name in names):
        known |= _inside_groups(motions, known)
    moments, forces = (np.empty((len(seen.state), len(names), 3)) for _ in range(2))
    for k, name in enumerate(names):
        moments[:, k], forces[:, k] = known[name]
    arms = motions.positions([model.scene.joint[name].between[1] for name in names])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        moments[..., i] -= arms[..., j] * forces[..., k] - arms[..., k] * forces[..., j]
    return moments, forces


def path_wrenches(model: Model, seen: Observed) -> list[Acting]:
    """For every frame that a drive leads along a path: its name, moment about the kernels' origin, force."""
    tree, drives = _tree(model, seen), model.scene.drive
    paths = {f"drive.{name}": drive.frame for name, drive in drives.items() if isinstance(drive, PathDrive)}
    return [(frame, *tree[edge]) for edge, frame in paths.items() if edge in tree]


def on_frames(model: Model, seen: Observed, body: str) -> list[Acting]:
    """What acts on a body besides joints and paths: loads and effects."""
    on_each: list[Acting] = []
    if model.loads:
        from flexclear.pipeline.dynamics.record.loads import on_loaded_frames

        on_each += on_loaded_frames(model, seen)
    for on_its_frames in model.parts.functions("acts"):
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


class _Beyond(NamedTuple):
    """Bodies on the far side of a fixed joint within a link; sign: +1 where they are its second body's."""

    joint: str
    bodies: list[str]
    sign: float


def _inside_groups(motions: Motions, known: Mapping[str, Wrench]) -> dict[str, Wrench]:
    """Wrenches of the fixed joints inside each link, by Newton and Euler for the bodies beyond them."""
    model, rows, beyond, inside = motions.model, len(motions.seen.state), list[_Beyond](), dict[str, Wrench]()
    for link in model.links:
        others = {name: _joined(model, name) for name in model.scene.joint if name not in known}
        inner = [name for name, bodies in others.items() if link.places.keys() >= set(bodies)]
        # a second path between bodies that are joined already carries nothing here
        inside |= {name: (np.zeros((rows, 3)), np.zeros((rows, 3))) for name in inner}
        tree = _forest(model, inner, list(link.places))
        for name in tree:
            side, sign = _far_side(model, name, tree)
            bodies = [body for body in link.places if body in side and body in model.mechanism.moving_bodies]
            beyond += [_Beyond(name, bodies, sign)] if bodies else []
    acting = [(_joined(model, joint), wrench) for joint, wrench in known.items()]
    places = {name: k for k, name in enumerate(motions.moving_bodies)}
    for part in beyond:
        demand = np.sum([motions.seen.body_demand[:, places[body]] for body in part.bodies], axis=0)
        moment, force = demand[:, :3], demand[:, 3:]
        for (first, second), (n, f) in acting:
            out, into = first in part.bodies, second in part.bodies
            if out != into:
                moment, force = (moment + n, force + f) if out else (moment - n, force - f)
        for body in part.bodies:
            for _, n, f in on_frames(model, motions.seen, body):
                moment, force = moment - n, force - f
        inside[part.joint] = part.sign * moment, part.sign * force
    return inside


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

    tree = []
    for name in names:
        a, b = (top(model.mechanism.frames[f].body) for f in model.scene.joint[name].between)
        if a != b:
            root[a] = b
            tree.append(name)
    return tree


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
                for inner, far in ((x, y), (y, x)):
                    if inner == body and far not in reached:
                        reached.add(far)
                        stack.append(far)
        return reached

    side = reach(b)
    if any(scene.body[body].type == "ground" for body in side):
        return reach(a), -1.0
    return side, 1.0
