"""The model of an edited scene from that of another one, when only numbers of contacts, loads, laws or masses differ.

Most of a model's time goes into the positions of the links, the tree and the mobility. None of these depends on a
clearance, a contact law, a load, the tolerance, the length of the run, or the mass of rigid bodies whose given poses
fit. The saving is two thirds of a point's time in rigid sweeps (`ideal`: 16 ms of 24), 8 to 20 % in sweeps over
contacts (`csj`, the slider-crank), and 2 to 12 % in flexible ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.dynamics.drives.pieces import pieces_of
from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.dynamics.model.closing import CLOSED_EXACTLY
from flexclear.dynamics.model.driving import Prescribed, prescribed_coordinates
from flexclear.dynamics.model.mechanism import Mechanism, sizes
from flexclear.dynamics.model.merge import rigid_inertia
from flexclear.dynamics.model.mobility import moves
from flexclear.dynamics.model.model import Model, fill_model
from flexclear.scene.fields import Part
from flexclear.scene.formulas import formula
from flexclear.scene.loose_joints import CONTACTS
from flexclear.scene.schema import Scene

#: keys of a table, or of its parts, that change numbers of a model but neither its links nor its topology
KEYS = {
    "time": "end",
    "body": "mass com inertia",
    "joint": " ".join({key for kind in CONTACTS for key in kind.model_fields} - {"type", "between", "source", "wear"}),
    "drive": "law",
    "load": "acceleration force torque stiffness damping free_length rest viscous coulomb values",
}
#: keys of a scene that may differ, as ``table`` or ``table.key``; all others must be the same
CHANGEABLE = {f"{table}.{key}" for table, keys in KEYS.items() for key in keys.split()}
CHANGEABLE |= {key for effect in EFFECTS for key in effect.changeable}
CHANGEABLE |= {"title", "description", "solver", "output", "ensemble", "sections", "accuracy", "limits", "view"}


def refill_model(model: Model, scene: Scene) -> Model | None:
    """Return the model of `scene`, equal to a new one; None when it must be built anew.

    model: of a scene without laws given from outside.  Raises InputError as `tabulate` does.
    """
    if not _same_structure(model, scene) or not _same_start(model, scene):
        return None
    pairs, known = scene.pairs(), model.scene.pairs()
    if [pair.between for pair in pairs.values()] != [pair.between for pair in known.values()]:
        return None
    contacts = [c._replace(joint=pairs[c.name].contact) if c.name in pairs else c for c in model.contacts]
    mechanism = replace(model.mechanism, contacts=contacts)
    weighed = _with_masses(mechanism, scene) if scene.body != model.scene.body else mechanism
    if weighed is None:
        return None
    mechanism = replace(weighed, scene=scene)
    old = model.numbering
    numbering = replace(old, mechanism=mechanism, sites=list(old.sites), ports=list(old.ports))
    made = fill_model(mechanism, numbering, like=model)
    # other kinds of laws need other code, other variables have other indices in the state, and a drive that begins
    # to move may contradict another one
    alike = (made.parts, made.ny, _drives_vary(made)) == (model.parts, model.ny, _drives_vary(model))
    return made if alike else None


def _same_structure(model: Model, scene: Scene) -> bool:
    old = model.scene
    if not all(
        _differ_only_in_changeable(getattr(scene, table), getattr(old, table), table) for table in Scene.model_fields
    ):
        return False
    # the mechanism's size is that of its points, unless a clearance is larger
    clearances = [joint.clearance for one in (old, scene) for joint in one.contacts().values()]
    return all(clearance < min(model.mechanism.components.lengths) for clearance in clearances)


def _differ_only_in_changeable(new: Any, was: Any, path: str) -> bool:
    """Return True when two values differ only in keys of `CHANGEABLE`, which neither appear nor disappear.

    Texts name frames and coordinates, or write formulas.
    """
    whole = path in Scene.model_fields or not (new is None or was is None or _is_text(new) or _is_text(was))
    if new is was or (path in CHANGEABLE and whole):
        return True
    if type(new) is not type(was):
        return False
    if isinstance(was, Part):
        return all(
            _differ_only_in_changeable(getattr(new, key), value, f"{path}.{key}")
            for key, value in was
            if key != "source"
        )
    if isinstance(was, dict):
        return [*new] == [*was] and all(
            _differ_only_in_changeable(new[name], value, path) for name, value in was.items()
        )
    return bool(new == was)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, tuple) and any(isinstance(one, str) for one in value))


def _names_read(scene: Scene, load: str) -> set[str]:
    """Return the names of bodies and frames that a load's expression reads."""
    written = formula(scene, load)
    return {name for _, name in written.reads} if written else set()


def _with_masses(mechanism: Mechanism, scene: Scene) -> Mechanism | None:
    """Return the mechanism with the masses of a scene; None when these change more than numbers.

    They do when a link has its frame at its centre of mass, when closing moves the link, when an expression reads the
    centre, which is a site then, and when the link has hardly any inertia, so that a motion may be without mass.
    """
    old = mechanism.scene.body
    changed = {name for name, body in scene.body.items() if body is not old[name]}
    if changed & {name for load in scene.load for name in _names_read(scene, load)}:
        return None
    links = list(mechanism.links)
    for i, link in enumerate(links):
        if link.inertia is not None and changed & link.placements.keys():
            now = rigid_inertia(scene, link.placements)
            if link.branch.edge is None and not np.array_equal(now.com, link.inertia.com):
                return None
            links[i] = replace(link, inertia=now)
    principal = np.linalg.eigvalsh(np.array([link.inertia.moments for link in links if link.inertia is not None]))
    # least principal moment, as fraction of the largest, with which every motion of a link has inertia
    if not np.all(principal[:, 0] > 1e-6 * principal[:, -1]):
        return None
    placed = [replace(link, start=start) for link, start in zip(links, mechanism.placed, strict=True)]
    length, parts = sizes(scene, placed, mechanism.link_of, mechanism.frames)
    if (
        not mechanism.start_residual < 0.5 * CLOSED_EXACTLY * min(1.0, length)
        or mechanism.choice
        or mechanism.has_paths
    ):
        return None
    if any(joint.clearance >= min(parts.lengths) for joint in scene.contacts().values()) or not mechanism.all_rigid:
        return None
    return replace(mechanism, links=links, length=length, components=parts)


def _same_start(model: Model, scene: Scene) -> bool:
    """Return True when the drives have the same start as before, so that the links do, too."""
    pairs = zip(prescribed_coordinates(model.scene), prescribed_coordinates(scene), strict=True)
    changed = [(was, new) for was, new in pairs if was.law is not new.law]
    try:
        return all(_law_at_start(was, scene) == _law_at_start(new, scene) for was, new in changed)
    except ValueError:
        return False  # an impossible law, which a new model reports


def _law_at_start(one: Prescribed, scene: Scene) -> float:
    return pieces_of(one.law, one.dimension).value(scene.time.start)


def _drives_vary(model: Model) -> tuple[bool, ...]:
    """Return for each drive whether its law varies."""
    return tuple(moves(model, name) for name in model.drives)
