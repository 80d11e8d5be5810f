"""Effects of a scene: the parts that its machine code is composed of.

This package compiles nothing and imports nothing that compiles. An effect is a declaration here (`effect`) and modules
of the same name in the folders of the engine that work for it: `model`, `equations`, `contact`, `run`, `record`. Tables
there list their functions by effect. A load that comes with an effect is among the `loads`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.dynamics.effects.effect import Effect
from flexclear.scene import integrators
from flexclear.scene.drives import PathDrive
from flexclear.scene.films import actions_of

if TYPE_CHECKING:
    from flexclear.scene.schema import Scene

#: joints that are always one link; others may become chains of joints in CHAIN (see `model.chain`)
WHOLE = ("fixed", "prismatic", "revolute", "spherical", "rotation-vector", "free")
CHAIN = ("fixed", "prismatic", "revolute", "rotation-vector", "spherical")
#: compiled forms of normal laws (`contact.form`) that every scene with contacts may have
FORMS = ("elastic", "hysteretic", "linear-damper")
#: laws of time that are polynomials throughout, or composed of other laws
WITHOUT_SINES = {"constant", "step", "polynomial", "spline", "table", "sum", "piecewise", "repeated", "delayed"}


@dataclass(frozen=True)
class Parts:
    """Kinds of parts of a mechanism, each sorted by name: all that the code of its equations depends on.

    surfaces, forms, frictions: of contacts.  loads: their kinds (`load_kind`).
    effects: names, each followed by the kinds of which its code is composed.  harmonics: True when a law of time has
    some.  load_kinks: True when loads have kinks.
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

    @property
    def present(self) -> list[Effect]:
        """Effects of the parts, in the order of their declarations."""
        names = {one.partition(" ")[0] for one in self.effects}
        return [effect for effect in EFFECTS if effect.name in names]

    def functions(self, table: Mapping[str, Any]) -> list[Any]:
        """Return the functions that a table lists for the effects."""
        return [table[effect.name] for effect in self.present if effect.name in table]

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
    contacts = scene.contacts()
    ideal: set[str] = {joint.type for name, joint in scene.joint.items() if name not in contacts}
    ideal |= {joint.held for joint in contacts.values() if joint.held is not None}
    paths = any(not hasattr(drive, "joint") for drive in scene.drive.values())
    kinds = {effect.name: effect.kinds(scene) for effect in EFFECTS}
    chained = set(CHAIN) if paths or ideal - set(WHOLE) else set()
    return Parts(
        joints=tuple(sorted({"free", *ideal, *chained})),
        surfaces=tuple(sorted({pair.contact.type for pair in scene.pairs().values()})),
        forms=(*FORMS, *_own_forms(scene)) if _touches(scene) else (),
        frictions=tuple(sorted({j.friction.kind for j in contacts.values() if j.friction is not None})),
        loads=tuple(sorted({load_kind(scene, name) for name in actions_of(scene)})),
        effects=tuple(sorted(" ".join([name, *known]) for name, known in kinds.items() if known is not None)),
        closures=_loops(scene),
        flexible=bool(scene.flexible()),
        harmonics=bool(_laws(scene) - WITHOUT_SINES),
        load_kinks=any(getattr(load, "bends", False) for load in scene.load.values()),
    )


def _touches(scene: Scene) -> bool:
    """Return True when the scene has contacts, or effects with contacts."""
    return bool(scene.contacts()) or any(effect.touches and effect.kinds(scene) is not None for effect in EFFECTS)


def _own_forms(scene: Scene) -> list[str]:
    """Return the forms of tight fits, and the structures of expressions, of the scene's normal laws."""
    laws = [joint.normal for joint in scene.contacts().values()] + [end.end_law for end in scene.stops().values()]
    return sorted({law.kind for law in laws} - {""})


def _loops(scene: Scene) -> bool:
    """Return True when joints, contacts, paths or gears close loops; the tree may break some loops of shared bodies."""
    if scene.rigid_gears():
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
    """Return the kind of a load by which its code is composed: its type, with a film's model or the structure
    of an expression."""
    from flexclear.scene.formulas import formula

    load, written = actions_of(scene)[name], formula(scene, name)
    structure = written.code if written else getattr(load, "kind", "")
    return f"{load.type} {structure}".strip()


def _laws(scene: Scene) -> set[str]:
    from flexclear.scene.laws import law_types

    return {law for part in (*scene.drive.values(), *scene.load.values()) for law in law_types(part)}


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
    return integrators.selectable_integrators(bool(scene.flexible())) if scene.by_need() else (scene.solver.integrator,)
