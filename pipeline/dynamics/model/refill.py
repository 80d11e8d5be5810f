"""The model of an edited scene from that of another one, where only numbers of contacts, loads, laws or masses differ.

Placing the links, finding the tree and judging the mobility take most of the time in which a model is made, and none
of it depends on a clearance, a contact law, a load, the tolerance, the length of the run, or a mass of rigid bodies
whose poses fit as they are given.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.drives import JointDrive
from flexclear.pipeline.core.scene.loads import Gravity
from flexclear.pipeline.core.scene.parts import RigidBody
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.drives.pieces import pieces_of
from flexclear.pipeline.dynamics.model.closing import EXACT
from flexclear.pipeline.dynamics.model.driving import Prescribed, prescribed
from flexclear.pipeline.dynamics.model.mechanism import Mechanism, sizes
from flexclear.pipeline.dynamics.model.merge import rigid_inertia
from flexclear.pipeline.dynamics.model.model import Model, filled

#: least principal moment as fraction of the largest with which no motion of a link can be without inertia
SLENDER = 1e-6


def refilled(model: Model, scene: Scene) -> Model | None:
    """The model of `scene`, equal to the one that would be made from scratch; None when it must be made so.

    model: of a scene without laws given from outside.  Raises InputError as `tabulate` does.
    """
    if not _same_structure(model, scene) or not _same_start(model, scene):
        return None
    clearances = scene.contacts()
    contacts = [c._replace(joint=clearances[c.name]) if c.name in clearances else c for c in model.contacts]
    mechanism = replace(model.mechanism, contacts=contacts)
    weighed = _weighed(mechanism, scene) if scene.body != model.scene.body else mechanism
    if weighed is None:
        return None
    mechanism = replace(weighed, scene=scene)
    old = model.numbering
    numbering = replace(old, mechanism=mechanism, sites=list(old.sites), ports=list(old.ports))
    made = filled(mechanism, numbering, like=model)
    # other kinds of laws are other kernels, and a drive that begins to move may contradict another one
    return made if made.parts == model.parts and _moving(made) == _moving(model) else None


def _same_structure(model: Model, scene: Scene) -> bool:
    old = model.scene
    if not _same_bodies(model, scene) or scene.time.start != old.time.start:
        return False
    if (scene.stop, scene.gear, scene.start) != (old.stop, old.gear, old.start):
        return False
    if list(scene.joint) != list(old.joint) or list(scene.drive) != list(old.drive):
        return False
    if list(scene.load) != list(old.load):
        return False
    contacts, clearances = scene.contacts(), [joint.clearance for joint in old.contacts().values()]
    if contacts.keys() != old.contacts().keys():
        return False
    # the mechanism's size is that of its points, unless a clearance is larger
    least = min(model.mechanism.components.lengths)
    if any(c >= least for c in [*clearances, *(joint.clearance for joint in contacts.values())]):
        return False
    pairs = zip(scene.joint.items(), old.joint.values(), strict=True)
    if any(new is not was and (name not in contacts or _held(new) != _held(was)) for (name, new), was in pairs):
        return False
    loads = zip(scene.load.values(), old.load.values(), strict=True)
    if any(new is not was and not _acts_alike(new, was) for new, was in loads):
        return False
    drives = zip(scene.drive.values(), old.drive.values(), strict=True)
    return all(new is was or _drives_alike(new, was) for new, was in drives)


def _same_bodies(model: Model, scene: Scene) -> bool:
    """Whether no body differs in more than its mass, centre and inertia, which decide but the links' numbers."""
    old = model.scene.body
    if [*scene.body] != [*old]:
        return False
    changed = [(new, was) for new, was in zip(scene.body.values(), old.values(), strict=True) if new is not was]
    return all(new == was or _shape(new) == _shape(was) for new, was in changed)


def _shape(body: Any) -> Any:
    """What a rigid body is besides its mass, centre and inertia; of any other body nothing that equals another's."""
    if not isinstance(body, RigidBody):
        return object()
    return [value for name, value in body if name not in ("mass", "com", "inertia", "source")]


def _weighed(mechanism: Mechanism, scene: Scene) -> Mechanism | None:
    """The mechanism with the masses of a scene; None where they decide more than numbers.

    They do so where a link has its frame at its centre of mass, where closing moves it, and where it has hardly any
    inertia: then a motion may be without mass.
    """
    old = mechanism.scene.body
    changed = {name for name, body in scene.body.items() if body is not old[name]}
    links = list(mechanism.links)
    for i, link in enumerate(links):
        if link.inertia is not None and changed & link.places.keys():
            now = rigid_inertia(scene, link.places)
            if link.branch.edge is None and not np.array_equal(now.com, link.inertia.com):
                return None
            links[i] = replace(link, inertia=now)
    principal = np.linalg.eigvalsh(np.array([link.inertia.moments for link in links if link.inertia is not None]))
    if not np.all(principal[:, 0] > SLENDER * principal[:, -1]):
        return None
    placed = [replace(link, start=start) for link, start in zip(links, mechanism.placed, strict=True)]
    length, parts = sizes(scene, placed, mechanism.link_of, mechanism.frames)
    if not mechanism.start_residual < 0.5 * EXACT * min(1.0, length) or mechanism.choice or mechanism.has_paths:
        return None
    if any(joint.clearance >= min(parts.lengths) for joint in scene.contacts().values()) or not mechanism.all_rigid:
        return None
    return replace(mechanism, links=links, length=length, components=parts)


def _held(joint: Any) -> tuple[str, tuple[str, str]]:
    """What a clearance joint holds next to its contact."""
    return joint.type, tuple(joint.between)


def _acts_alike(new: Any, was: Any) -> bool:
    """Whether two loads are of one kind and act between the same frames or coordinates."""
    return _words(new) == _words(was) or (isinstance(new, Gravity) and isinstance(was, Gravity))


def _words(load: Any) -> dict[str, Any]:
    """What a load says in words: its type, frames, joint and coordinate; the rest of it are numbers and laws."""
    values = {name: value for name, value in load if name != "source"}
    return {
        n: v for n, v in values.items() if isinstance(v, str) or (isinstance(v, tuple) and v and isinstance(v[0], str))
    }


def _drives_alike(new: Any, was: Any) -> bool:
    both = isinstance(new, JointDrive) and isinstance(was, JointDrive)
    return both and (new.joint, new.coordinate) == (was.joint, was.coordinate)


def _same_start(model: Model, scene: Scene) -> bool:
    """Whether the drives start where they started before: then the links do, too."""
    pairs = zip(prescribed(model.scene), prescribed(scene), strict=True)
    changed = [(was, new) for was, new in pairs if was.law is not new.law]
    try:
        return all(_at_start(was, scene) == _at_start(new, scene) for was, new in changed)
    except ValueError:
        return False  # a law that cannot be had, as is reported when the model is made from scratch


def _at_start(one: Prescribed, scene: Scene) -> float:
    return pieces_of(one.law, one.dimension).value(scene.time.start)


def _moving(model: Model) -> tuple[bool, ...]:
    """Which of the drives are not constant."""
    tables, moving = model.arrays.table(m.PIECES), list[bool]()
    harmonics = model.arrays.table(m.PIECE_HARMONICS)["n_harmonics"]
    for first, count in model.arrays.table(m.LAWS)[: len(model.drives)]:
        values = tables["coefficients"][first : first + count]
        changes = np.any(values[:, 1:] != 0.0) or np.ptp(values[:, 0]) > 0.0
        moving.append(bool(changes or np.any(harmonics[first : first + count] > 0)))
    return tuple(moving)
