"""Contacts with wear, and their variables in the ledger."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics.contact.surfaces import profile
from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.contacts import part_of
from flexclear.dynamics.model.filling import Filling
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.scene.clearance import Shapes
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

#: fraction by which radii of a profile may differ from those of the joint
SAME = 1e-9


def _worn(mechanism: Mechanism) -> list[int]:
    names = [contact.name for contact in mechanism.contacts]
    return [names.index(name) for name in mechanism.scene.wearing_joints()]


def fill(filling: Filling) -> dict[str, Any]:
    """Tabulate the contacts with wear, and the profiles of their surfaces."""
    mechanism = filling.numbering.mechanism
    rows, values = list[tuple[int, ...]](), list[float]()
    for contact, name in zip(_worn(mechanism), mechanism.scene.wearing_joints(), strict=True):
        shapes, firsts = shapes_of(mechanism.scene, name), list[int]()
        halvings: tuple[int, ...] = (-1, 0)
        for depths in (shapes.outer, shapes.inner) if shapes else ((), ()):
            firsts.append(len(values))
            if depths:
                halvings, found = profile.numbers(np.array(depths))
                values += found
        rows.append((contact, *firsts, *(*halvings, 0)[:2]))
    return {"worn": rows, "profiles": [[value] for value in values]}


def shapes_of(scene: Scene, name: str) -> Shapes | None:
    """Return the worn surfaces of a joint; None for round ones. Raise InputError for those of another joint."""
    joint: Any = scene.joint[name]
    given, where = joint.wear.shapes, f"[joint.{name}.wear.profile]"
    if not given:
        return None
    file = joint.wear.profile or "the profile"
    if name not in given:
        raise InputError(where, f"{file} has no joint '{name}'", f"known: {', '.join(given)}")
    shapes: Shapes = given[name]
    ball, own = "ball_radius" in type(joint).model_fields, (joint.radius + joint.clearance, joint.radius)
    for side, radius, known in zip(joint.surfaces, own, shapes.radii, strict=True):
        if abs(radius - known) > SAME * radius:
            text = f"{file} is for a {side} with a radius of {known:.9g} m; this one has {radius:.9g} m"
            raise InputError(where, text, "compute the wear of this scene anew")
    if ball != (len(shapes.outer) > 1):
        raise InputError(where, f"{file} is for a {'pin' if ball else 'ball'}", "name a profile of this type of joint")
    if joint.friction is not None and joint.friction.law == "lugre":
        text = "the bristles of 'lugre' are of round surfaces"
        raise InputError(f"[joint.{name}.friction]", text, "choose another law, or leave out wear.profile")
    return shapes


def ledger(mechanism: Mechanism, energies: Floors, lengths: Floors) -> list[Group]:
    """Return the ledger groups, sliding distance and load path of each contact with wear."""
    parts = [part_of(mechanism, mechanism.contacts[k]) for k in _worn(mechanism)]
    return [(floor[part], 1, part) for part in parts for floor in (lengths, energies)]
