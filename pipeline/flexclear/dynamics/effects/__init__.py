"""Effects of a scene: the parts that its machine code is composed of, and the modules that hold these parts.

This package compiles nothing and imports nothing that compiles. Generated files (`compile.sources`), lazy imports
(`core.scene.registry`) and the keys of results (`compile.reach.modules`) all read the tables of the family folders and
the declarations of the effects.

An effect is a folder here. Its declaration is in `effect`. Its other modules do the work of a folder of the tower for
the effect and have that folder's name and imports: `model`, `equations`, `contact`, `run`, `record`. A load that comes
with an effect is a module in the effect's folder, named like the load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.dynamics.effects.effect import Effect
from flexclear.scene import integrators
from flexclear.scene.drives import PathDrive
from flexclear.scene.registry import lookup, module_of
from flexclear.scene.variants import loose
from flexclear.workflow.encounters import meet

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

JOINTS, CONTACT = "flexclear.dynamics.joints", "flexclear.dynamics.contact"
SURFACES, NORMAL_LAWS, FORMS, FRICTION_LAWS = (
    f"{CONTACT}.{family}" for family in ("surfaces", "normal", "form", "friction")
)
LOADS, LAWS = "flexclear.dynamics.loads", "flexclear.dynamics.drives"
RECORDS = "flexclear.dynamics.record"
EVENTS, RUNS = "flexclear.dynamics.events", "flexclear.dynamics.run"
INTEGRATORS, STARTS = "flexclear.dynamics.integrate", "flexclear.dynamics.starts"
#: ways that start at singular poses and pass over them, and the word for them: only runs with loops may need them
POSES, SINGULAR = ("beginning", "collocation", "passing"), "singular poses"
#: words for what a run encounters: a deep tree, or an integration method
DEEP, METHOD = "a deep tree", "the method {}"
#: laws of time that are polynomials throughout, or composed of other laws
WITHOUT_SINES = {"constant", "step", "polynomial", "spline", "table", "sum", "piecewise", "repeated", "delayed"}


@dataclass(frozen=True)
class Parts:
    """Kinds of parts of a mechanism, each sorted by name: all that the code of its equations depends on.

    surfaces, forms, frictions: of contacts.  loads: their types, with the structure of expressions.
    effects: names, each followed by the kinds of which its code is composed.  harmonics: True when a law of time has
    some.  load_kinks: True when loads have kinks.
    articulated: True when the tree is so deep that articulated inertias factor its mass matrix.
    """

    joints: tuple[str, ...]
    surfaces: tuple[str, ...] = ()
    forms: tuple[str, ...] = ()
    frictions: tuple[str, ...] = ()
    loads: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    closures: bool = False
    flexible: bool = False
    harmonics: bool = False
    load_kinks: bool = False
    articulated: bool = False

    @property
    def present(self) -> list[Effect]:
        """Effects of the parts, in the order of their declarations."""
        names = {one.partition(" ")[0] for one in self.effects}
        return [effect for effect in EFFECTS if effect.name in names]

    def functions(self, kind: str) -> list[Any]:
        """Return the functions that the effects declare under a field name of `Effect`; import them."""
        return [effect.load(getattr(effect, kind)) for effect in self.present if getattr(effect, kind)]

    def kinds(self, name: str) -> tuple[str, ...]:
        """Return the kinds of which the code of an effect is composed."""
        return next((tuple(kinds) for first, *kinds in map(str.split, self.effects) if first == name), ())


@dataclass(frozen=True)
class Scheme:
    """Variant of the stepper: method, fixed or adaptive steps, events located or noticed at step ends."""

    integrator: str
    fixed: bool = False
    located: bool = True


def scheme_of(solver: Any) -> Scheme:
    """Return the scheme that a scene's solver table requests."""
    return Scheme(solver.integrator, solver.step is not None, solver.events == "located")


def most_parts(scene: Scene) -> Parts:
    """Return all parts that the machine code of a scene may have, as far as the scene alone decides."""
    contacts, joints = scene.contacts(), import_module(JOINTS)
    ideal: set[str] = {joint.type for name, joint in scene.joint.items() if name not in contacts}
    ideal |= {joint.held for joint in contacts.values() if joint.held is not None}
    paths = any(not hasattr(drive, "joint") for drive in scene.drive.values())
    kinds = {effect.name: effect.kinds(scene) for effect in EFFECTS}
    chained = set(joints.CHAIN) if paths or ideal - set(joints.WHOLE) else set()
    return Parts(
        joints=tuple(sorted({"free", *ideal, *chained})),
        surfaces=tuple(sorted({joint.type for joint in contacts.values()})),
        forms=tuple(sorted(import_module(FORMS).NAMES)) if _touches(scene) else (),
        frictions=tuple(sorted({j.friction.law for j in contacts.values() if j.friction is not None})),
        loads=tuple(sorted({load_kind(scene, name) for name in scene.forces()})),
        effects=tuple(sorted(" ".join([name, *known]) for name, known in kinds.items() if known is not None)),
        closures=_loops(scene),
        flexible=bool(scene.flexible()),
        harmonics=bool(_laws(scene) - WITHOUT_SINES),
        load_kinks=any(getattr(load, "bends", False) for load in scene.load.values()),
    )


def _touches(scene: Scene) -> bool:
    """Return True when the scene has contacts, or effects with contacts."""
    return bool(scene.contacts()) or any(effect.touches and effect.kinds(scene) is not None for effect in EFFECTS)


def _loops(scene: Scene) -> bool:
    """Return True when joints, contacts, paths or gears close loops; the tree may break some loops of shared bodies."""
    if scene.gear:
        return True
    paths = [("", drive.frame) for drive in scene.drive.values() if isinstance(drive, PathDrive)]
    joined: dict[str, str] = {name: "" for name, body in scene.body.items() if body.type == "ground"}

    def end(body: str) -> str:
        while body in joined:
            body = joined[body]
        return body

    for one, other in [*(joint.between for joint in scene.joint.values()), *paths]:
        first, second = (end(frame.partition(".")[0]) for frame in (one, other))
        if first == second:
            return True
        joined[second if second else first] = first if second else second
    return False


def load_kind(scene: Scene, name: str) -> str:
    """Return the kind of a load by which its code is composed: its type, with the structure of its expression."""
    from flexclear.scene.formulas import formula

    written = formula(scene, name)
    return f"{scene.forces()[name].type} {written.code}" if written else str(scene.forces()[name].type)


def _laws(scene: Scene) -> set[str]:
    from flexclear.scene.laws import law_types

    return {law for part in (*scene.drive.values(), *scene.load.values()) for law in law_types(part)}


def named(scene: Scene) -> set[str]:
    """Return modules of the family members that a scene names; raise InputError for names outside their family."""
    contacts, laws = scene.contacts(), sorted(_laws(scene))
    parts = [(INTEGRATORS, integrator, "[solver]") for integrator in _integrators(scene)]
    for name, joint in scene.joint.items():
        parts.append((SURFACES if name in contacts else JOINTS, joint.type, f"[joint.{name}]"))
    for name, contact in contacts.items():
        parts.append((NORMAL_LAWS, contact.normal.law, f"[joint.{name}.normal]"))
        if contact.friction is not None:
            parts.append((FRICTION_LAWS, contact.friction.law, f"[joint.{name}.friction]"))
    for effect in EFFECTS:
        parts += [(f"flexclear.dynamics.{family}", name, at) for family, name, at in effect.named(scene)]
    parts += [(LOADS, load.type, f"[load.{name}]") for name, load in scene.load.items()]
    if scene.start is not None and scene.start.begins is not None:
        parts.append((STARTS, scene.start.begins, "[start.at]"))
        laws += ["constant", "polynomial"] if scene.start.joint else []  # which hold given positions
        parts += [(JOINTS, str(one.ideal), f"[joint.{name}]") for name, one in loose(scene).items()]
    parts += [(RECORDS, name, "[output]") for name in scene.output.requests()]
    if scene.event:
        parts.append((EVENTS, "phases", "[event]"))
        laws += ["constant", "delayed", "sum"]
    parts += [(LAWS, law, "law") for law in laws]
    return {module_of(package, name, where=where) for package, name, where in parts}


def ways(scene: Scene) -> list[str]:
    """Return the ways of a run (`dynamics.run`) that this scene may need and others do not."""
    found = []
    if any(isinstance(drive, PathDrive) and drive.actuators for drive in scene.drive.values()):
        found.append("inverse dynamics")
    if scene.accuracy.quantities if scene.accuracy is not None else scene.solver.by_need:
        found += ["accuracy", *(["method selection"] if scene.by_need() else [])]
    found += ["horizon"] if _touches(scene) else []
    # plans make bodies with recipes rigid, whose frames are then as exact as the mesh has them
    if scene.recipes() or any(body.frame_tolerance for body in scene.rigid().values()):
        found.append("frames to a tolerance")
    if any(" " in load_kind(scene, name) for name in scene.forces()):
        found.append("expressions")
    return found + ([*POSES] if _loops(scene) else [])


def way(scene: Scene, name: str) -> Any:
    """Import and return the way that `dynamics.run` lists under a name where the scene needs it; else None.

    Only then the key of a run contains it.
    """
    if name not in ways(scene):
        return None
    if name in POSES:
        meet(SINGULAR)
    return lookup(RUNS, name, where="run")


def schemes(scene: Scene) -> list[Scheme]:
    """Return the requested scheme, and that of the method which takes over where the requested one becomes too slow.

    Where the scene leaves the method open, return the schemes of all candidate methods.
    """
    scheme = scheme_of(scene.solver)
    if scene.by_need():
        return [replace(scheme, integrator=name) for name in _integrators(scene)]
    heir = integrators.INTEGRATORS[scheme.integrator].hands_over_to
    return [scheme, *([Scheme(heir)] if heir and not scheme.fixed else [])]


def _integrators(scene: Scene) -> tuple[str, ...]:
    return integrators.by_need(bool(scene.flexible())) if scene.by_need() else (scene.solver.integrator,)
