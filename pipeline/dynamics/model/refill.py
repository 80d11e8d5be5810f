"""The model of an edited scene from that of another one, where only numbers of contacts, loads, laws or masses differ.

Placing the links, finding the tree and judging the mobility take most of the time in which a model is made, and none
of it depends on a clearance, a contact law, a load, the tolerance, the length of the run, or a mass of rigid bodies
whose poses fit as they are given.

Of a point's time it saves two thirds in rigid sweeps (`ideal`: 16 ms of 24), 8 to 20 % in those over contacts (`csj`,
the slider-crank), 2 to 12 % in flexible ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.fields import Part
from flexclear.pipeline.core.scene.formulas import formula
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.drives.pieces import pieces_of
from flexclear.pipeline.dynamics.effects.declared import EFFECTS
from flexclear.pipeline.dynamics.model.closing import CLOSED_EXACTLY
from flexclear.pipeline.dynamics.model.driving import Prescribed, prescribed
from flexclear.pipeline.dynamics.model.mechanism import Mechanism, sizes
from flexclear.pipeline.dynamics.model.merge import rigid_inertia
from flexclear.pipeline.dynamics.model.mobility import moves
from flexclear.pipeline.dynamics.model.model import Model, filled

#: keys of a table, or of its parts, that decide numbers of a model but neither its links nor what is wired to what
KEYS = {
    "time": "end",
    "body": "mass com inertia",
    "joint": "clearance ball_radius pin_radius length travel ball_material socket_material pin_material "
    "journal_material slot_material plane_material normal friction floor initial_approach_speed",
    "drive": "law",
    "load": "acceleration force torque stiffness damping free_length rest viscous coulomb values",
}
#: what may change of a scene for which a model is refilled, as ``table`` or ``table.key``; whatever is not listed must
#: be the same
CHANGEABLE = {f"{table}.{key}" for table, keys in KEYS.items() for key in keys.split()}
CHANGEABLE |= {key for effect in EFFECTS for key in effect.changeable}
CHANGEABLE |= {"title", "description", "solver", "output", "ensemble", "sections", "accuracy", "limits", "view"}
#: least principal moment as fraction of the largest with which no motion of a link can be without inertia
SLENDER_INERTIA = 1e-6


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
    # other kinds of laws are other kernels, other variables have other places in the state, and a drive that begins to
    # move may contradict another one
    alike = (made.parts, made.ny, _moving(made)) == (model.parts, model.ny, _moving(model))
    return made if alike else None


def _same_structure(model: Model, scene: Scene) -> bool:
    old = model.scene
    if not all(_alike(getattr(scene, table), getattr(old, table), table) for table in Scene.model_fields):
        return False
    # the mechanism's size is that of its points, unless a clearance is larger
    clearances = [joint.clearance for one in (old, scene) for joint in one.contacts().values()]
    return all(clearance < min(model.mechanism.components.lengths) for clearance in clearances)


def _alike(new: Any, was: Any, path: str) -> bool:
    """Whether two values differ in nothing but what `CHANGEABLE` lists, which neither appears nor is a text.

    Texts name frames and coordinates, or write formulas.
    """
    whole = path in Scene.model_fields or not (new is None or was is None or _is_text(new) or _is_text(was))
    if new is was or (path in CHANGEABLE and whole):
        return True
    if type(new) is not type(was):
        return False
    if isinstance(was, Part):
        return all(_alike(getattr(new, key), value, f"{path}.{key}") for key, value in was if key != "source")
    if isinstance(was, dict):
        return [*new] == [*was] and all(_alike(new[name], value, path) for name, value in was.items())
    return bool(new == was)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, tuple) and any(isinstance(one, str) for one in value))


def _read(scene: Scene, load: str) -> set[str]:
    """Names of bodies and frames that a load's expression reads."""
    written = formula(scene, load)
    return {name for _, name in written.reads} if written else set()


def _weighed(mechanism: Mechanism, scene: Scene) -> Mechanism | None:
    """The mechanism with the masses of a scene; None where they decide more than numbers.

    They do so where a link has its frame at its centre of mass, where closing moves it, where an expression reads the
    centre, which then is another site, and where it has hardly any inertia: then a motion may be without mass.
    """
    old = mechanism.scene.body
    changed = {name for name, body in scene.body.items() if body is not old[name]}
    if changed & {name for load in scene.load for name in _read(scene, load)}:
        return None
    links = list(mechanism.links)
    for i, link in enumerate(links):
        if link.inertia is not None and changed & link.places.keys():
            now = rigid_inertia(scene, link.places)
            if link.branch.edge is None and not np.array_equal(now.com, link.inertia.com):
                return None
            links[i] = replace(link, inertia=now)
    principal = np.linalg.eigvalsh(np.array([link.inertia.moments for link in links if link.inertia is not None]))
    if not np.all(principal[:, 0] > SLENDER_INERTIA * principal[:, -1]):
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
    return tuple(moves(model, name) for name in model.drives)
