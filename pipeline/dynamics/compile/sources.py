"""Sources of the functions that are compiled for a mechanism, each in a file of its own: lists of parts.

A file composes exactly the kernels of the kinds present: what a scene does not call for is neither
imported nor compiled. Of no more than it needs, so that mechanisms share files: steps depend on
the integrator and on whether there are closures and contacts, not on joints or bodies.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from flexclear.pipeline.core.scene import integrators
from flexclear.pipeline.core.scene.events import with_switched
from flexclear.pipeline.core.scene.registry import listed
from flexclear.pipeline.core.workflow.fingerprint import TREE, source_file
from flexclear.pipeline.dynamics.compile import formulas
from flexclear.pipeline.dynamics.effects import (
    FORMS,
    FRICTION_LAWS,
    INTEGRATORS,
    JOINTS,
    LOADS,
    Parts,
    Scheme,
    most_parts,
    named,
    schemes,
)

if TYPE_CHECKING:
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.dynamics.specialise.wiring import Wiring

DYNAMICS = "flexclear.pipeline.dynamics"
#: what others are called by
CALLS = (f"{DYNAMICS}.compile", "calls")
Imports = list[tuple[str, str]]  #: (module, name) each


def sources(parts: Parts, scheme: Scheme) -> dict[str, str]:
    """Source by name of what it compiles, in the order of which calls which."""
    by_name = {"evaluate": _evaluate(parts)}
    if parts.closures:
        by_name["project"] = _project(parts)
    if integrators.INTEGRATORS[scheme.integrator].retracts:
        by_name["retract"] = _retract(parts)
    return by_name | {"observe": _observe(parts), "advance": _advance(parts, scheme)}


def modules(scene: Scene) -> tuple[str, ...]:
    """Modules that a run of the scene reaches by names: those of its parts, and those that its generated files import.

    Raises InputError when a name is not listed in its family.
    """
    scene = with_switched(scene) if scene.event else scene
    names, parts = {part.module for part in named(scene)}, most_parts(scene)
    either = (parts, replace(parts, articulated=True))  # which, only the tree decides
    return tuple(sorted(names.union(*(_composed(one, scheme) for one in either for scheme in schemes(scene)))))


@cache
def _composed(parts: Parts, scheme: Scheme) -> frozenset[str]:
    """Modules that the generated files of some parts import; many scenes share them, and each command asks of each."""
    texts = [*sources(parts, scheme).values(), specialised(parts, ()), specialised(parts, (), lanes=2)]
    texts.append(specialised(parts, (), changes=True))
    return frozenset().union(*map(_reached, texts))


@cache
def _reached(source: str) -> frozenset[str]:
    """Modules that a generated file imports; steps depend on few of the parts."""
    return frozenset(name for name in imported(source) if source_file(TREE, name))  # others are in modules


def imported(source: str) -> set[str]:
    """Modules and names that a generated file imports, as `fingerprint.imported` returns those of any other source."""
    lines = re.findall(r"^from (\S+) import (\S+)", source, re.MULTILINE)
    return {name for module, part in lines for name in (module, f"{module}.{part}")}


def specialised(parts: Parts, wiring: Wiring, lanes: int = 0, *, changes: bool = False) -> str:
    """Source of the right-hand side for one wiring.

    lanes: 0 for runs; of members of ensembles how many are evaluated at once, with equal bits whatever their number.
    changes: with its tangent, of one state.
    """
    given, imports = _equations(parts)
    maker = _import(imports, f"{DYNAMICS}.equations.right_hand_side", "make_rates")
    _import(imports, f"{DYNAMICS}.equations.prescribed_motion", "make_laws")
    function = LANES if lanes > 1 else SPECIALISED
    for name in (["exactly"] if lanes else []) + ["abreast" if lanes > 1 else "along" if changes else "straight"]:
        _import(imports, f"{DYNAMICS}.specialise.straight", name)
    if lanes > 1:
        _import(imports, f"{DYNAMICS}.compile.lanes", "make_lanes")
    harmonics = _import(imports, f"{DYNAMICS}.drives.oscillation", "oscillate") if parts.harmonics else ""
    laws = f"exactly(make_laws({harmonics}))" if lanes else f"make_laws({harmonics})"
    what = f"right-hand side of {', '.join(parts.joints)}, for one wiring"
    law_changes = ""
    if changes:
        function = CHANGES
        _import(imports, f"{DYNAMICS}.equations.prescribed_motion", "make_law_changes")
        _import(imports, f"{DYNAMICS}.fields", "data")
        change = _import(imports, f"{DYNAMICS}.drives.oscillation", "change_oscillation") if parts.harmonics else ""
        law_changes = f"make_law_changes({change})"
    wired = "".join(f"    {row},\n" for row in wiring)
    values = {"laws": laws, "wiring": wired, "lanes": lanes, "exact": bool(lanes), "law_changes": law_changes}
    return _file(what, imports, "rates", maker, given, function.format(**values), _formulas(parts))


def rates(parts: Parts) -> str:
    """Source of the kernel `rates` alone, which Python runs (`specialise.dual`), without friction of ideal joints."""
    given, imports = _equations(parts)
    maker = _import(imports, f"{DYNAMICS}.equations.right_hand_side", "make_rates")
    return _file("right-hand side for Python", imports, "rates", maker, given, "", _formulas(parts))


def _equations(parts: Parts) -> tuple[dict[str, str], Imports]:
    """What makes accelerations, but for friction of ideal joints."""
    given, imports = _forces(parts)
    given["tree"] = _tree(imports, parts)
    if parts.closures:
        given["closures"] = _closures(imports, parts)
    return given, imports


def _evaluate(parts: Parts) -> str:
    given, imports = _equations(parts)
    if parts.harmonics:
        given["harmonics"] = _import(imports, f"{DYNAMICS}.drives.oscillation", "oscillate")
    if parts.joint_frictions:
        given["friction"] = _joint_friction(imports, parts)
    maker = _import(imports, f"{DYNAMICS}.equations.right_hand_side", "make_right_hand_side")
    return _file(
        f"right-hand side of {', '.join(parts.joints)}",
        imports,
        "right_hand_side",
        maker,
        given,
        EVALUATE,
        _formulas(parts),
    )


def _project(parts: Parts) -> str:
    given, imports = _joints(parts)
    given = {"evaluate": "calls.evaluate", **given}
    given["closures"] = _closures(imports, parts)
    if parts.flexible:
        stiffen = _import(imports, f"{DYNAMICS}.equations.projection", "make_stiffen")
        given["stiffen"] = f"{stiffen}({given['closures']})"
        given["to_modes"] = _import(imports, f"{DYNAMICS}.bodies.interface", "to_modes")
    maker = _import(imports, f"{DYNAMICS}.equations.projection", "make_projection")
    return _file(f"projection with {', '.join(parts.joints)}", imports, "projection", maker, given, PROJECT)


def _retract(parts: Parts) -> str:
    given, imports = _joints(parts)
    maker = _import(imports, f"{DYNAMICS}.equations.retraction", "make_retraction")
    return _file(f"retraction of {', '.join(parts.joints)}", imports, "retraction", maker, given, RETRACT)


def _observe(parts: Parts) -> str:
    given, imports = _forces(parts)
    given = {"evaluate": "calls.evaluate", "project": _projection(imports, parts), **given}
    if parts.harmonics:
        given["harmonics"] = _import(imports, f"{DYNAMICS}.drives.oscillation", "oscillate")
    if parts.couplings:
        given["couplings"] = _import(imports, f"{DYNAMICS}.equations", "couplings")
    if parts.joint_frictions and parts.closures:
        given["friction"] = _import(imports, f"{DYNAMICS}.equations.joint_friction", "take_off_closures")
    maker = _import(imports, f"{DYNAMICS}.equations.observation", "make_observation")
    return _file(
        f"what is recorded of {', '.join(parts.joints)}",
        imports,
        "observation",
        maker,
        given,
        OBSERVE,
        _formulas(parts),
    )


def _advance(parts: Parts, scheme: Scheme) -> str:
    module, method = listed(INTEGRATORS, scheme.integrator, where="[solver.integrator]")
    imports: Imports = []
    given = {
        "evaluate": "calls.rates",
        "project": _projection(imports, parts),
        "retract": "calls.retract",
        "method": _import(imports, f"{INTEGRATORS}.{module}", method),
        "stepping": _import(imports, INTEGRATORS, "fixed" if scheme.fixed else "adaptive"),
    }
    if integrators.INTEGRATORS[scheme.integrator].reads_all:
        given["complete"] = "calls.evaluate"
    events = _events(imports, parts, scheme)
    if events:
        given["events"] = events
    if parts.closures:
        given["poses"] = _import(imports, f"{INTEGRATORS}.singular_step", "OVER_POSES")
    _import(imports, DYNAMICS, "memory as m")
    maker = _import(imports, f"{INTEGRATORS}.stepper", "make_advance")
    return _file(f"steps of {scheme}", imports, "steps", maker, given, ADVANCE)


def _events(imports: Imports, parts: Parts, scheme: Scheme) -> str:
    """What the stepper searches for in each step; nothing for the default, which is nothing."""
    touching, chosen = parts.surfaces or parts.stops, not scheme.fixed
    if touching and not scheme.located:
        return _import(imports, f"{INTEGRATORS}.step_end_events", "AT_STEP_ENDS")
    guarded = chosen and (parts.frictions or parts.joint_frictions or parts.load_kinks)
    if touching:
        located = _import(imports, f"{INTEGRATORS}.contact_events", "located")
        given = [_import(imports, f"{INTEGRATORS}.contact_phases", "regimes" if parts.frictions else "no_regimes")]
        if guarded:
            given.append(_import(imports, f"{INTEGRATORS}.guards", "AMONG_CONTACTS"))
        return f"{located}({', '.join(given)})"
    return _import(imports, f"{INTEGRATORS}.guards", "GUARDS") if guarded else ""


def _joints(parts: Parts) -> tuple[dict[str, str], Imports]:
    imports: Imports = []
    return {"joints": _family(imports, JOINTS, parts.joints)}, imports


def _forces(parts: Parts) -> tuple[dict[str, str], Imports]:
    """What acts in the mechanism: joints, flexible bodies, contacts, loads."""
    given, imports = _joints(parts)
    if parts.flexible:
        bodies = _import(imports, f"{DYNAMICS}.bodies.flexible", "flexible_bodies")
        shortening = _import(imports, f"{DYNAMICS}.bodies", "shortening") if parts.stiffening else ""
        given["flexible"] = f"{bodies}({shortening})"
    if parts.surfaces:
        surfaces = _family(imports, JOINTS, parts.surfaces, "CONTACTS")
        forms, frictions = _family(imports, FORMS, parts.forms), _family(imports, FRICTION_LAWS, parts.frictions)
        maker = _import(imports, f"{DYNAMICS}.contact.forces", "make_contacts")
        given["contacts"] = f"{maker}(surfaces={surfaces}, forms={forms}, frictions={frictions})"
        if parts.wear:
            given["contacts"] = f"{_import(imports, f'{DYNAMICS}.contact.wear', 'wearing')}({given['contacts']})"
    if parts.stops:
        forms = _family(imports, FORMS, parts.forms)
        given["stops"] = f"{_import(imports, f'{DYNAMICS}.contact.stops', 'make_stops')}({forms})"
    if parts.loads:
        kinds = "".join(f"{_load(imports, n, *kind.split(maxsplit=1))}, " for n, kind in enumerate(parts.loads))
        given["loads"] = f"{_import(imports, f'{DYNAMICS}.loads.composing', 'make_loads')}(({kinds}))"
    return given, imports


def _load(imports: Imports, number: int, name: str, formula: str = "") -> str:
    """The module of a kind of loads, or what it makes of the kernel of an expression (`_formulas`)."""
    module = _import(imports, LOADS, listed(LOADS, name, where="parts")[0])
    if not formula:
        return module
    _import(imports, f"{DYNAMICS}.kernels", "kernel")
    _import(imports, LOADS, "looks")
    return f"{module}.applying(formula{number})"


def _formulas(parts: Parts) -> str:
    """The kernels of the expressions of loads."""
    written = [(n, kind.split(maxsplit=1)) for n, kind in enumerate(parts.loads)]
    return "\n\n".join(formulas.source(f"formula{n}", kind[1]) for n, kind in written if len(kind) > 1)


def _joint_friction(imports: Imports, parts: Parts) -> str:
    """Friction of ideal joints: on accelerations, and on drives."""
    module = f"{DYNAMICS}.equations.joint_friction"
    laws = [listed(FRICTION_LAWS, law, where="parts")[0] for law in parts.joint_frictions]
    tractions = "".join(f"{_import(imports, FRICTION_LAWS, law)}.traction, " for law in laws)
    maker, drives = (_import(imports, module, name) for name in ("make_joint_friction", "load_drives"))
    return f"({maker}(({tractions}), {parts.closures}, {_tree(imports, parts)}), {drives})"


def _tree(imports: Imports, parts: Parts) -> str:
    """The module that factors the mass matrix."""
    return _import(imports, f"{DYNAMICS}.equations", "articulated" if parts.articulated else "composite")


def _closures(imports: Imports, parts: Parts) -> str:
    """The kernels of the closures: with couplings, or of joints alone."""
    if parts.couplings:
        maker = _import(imports, f"{DYNAMICS}.equations.couplings", "make_coupled_closing")
    else:
        maker = _import(imports, f"{DYNAMICS}.equations.closures", "make_closing")
    return f"{maker}({_tree(imports, parts)})"


def _projection(imports: Imports, parts: Parts) -> str:
    return "calls.project" if parts.closures else _import(imports, f"{DYNAMICS}.equations.projection", "no_projection")


def _family(imports: Imports, package: str, names: tuple[str, ...], table: str = "NAMES") -> str:
    """A tuple of the modules of a family's parts."""
    modules = [_import(imports, package, listed(package, name, where="parts", table=table)[0]) for name in names]
    return "(" + "".join(f"{module}, " for module in modules) + ")"


def _import(imports: Imports, module: str, name: str) -> str:
    """Note an import; the name."""
    others = {known for package, known in imports if package != module}
    assert name not in others, f"two parts of one mechanism are called {name}"
    imports.append((module, name))
    return name


def _file(
    what: str, imports: Imports, result: str, maker: str, given: dict[str, str], function: str, kernels: str = ""
) -> str:
    lines = sorted({f"from {module} import {name}" for module, name in [*([CALLS] if function else []), *imports]})
    arguments = [f"    {key}={value}," for key, value in given.items()]
    return "\n".join(
        [f'"""Generated: {what}."""', *lines, "", kernels, f"{result} = {maker}(", *arguments, ")", "", "", function]
    )


EVALUATE = """@calls.exported("evaluate")
def evaluate(h, f, w, n, t, y, dy):
    right_hand_side(h, f, w, n, t, y, dy)
    return 0
"""
# laws of time are looked up as ever: their pieces change with time, and their number with the scene's numbers
SPECIALISED = """WIRING = (
{wiring})
laws, along = {laws}, straight(rates, WIRING, exact={exact})


@calls.exported("evaluate")
def specialised(h, f, w, n, t, y, dy):
    laws(h, f, w, n, t)
    along(h, f, w, n, y, dy)
    return 0
"""
CHANGES = """WIRING = (
{wiring})
laws, law_changes, differentiated = {laws}, {law_changes}, along(rates, WIRING)


@calls.exported("evaluate")
def specialised(h, f, w, n, t, y, dy):
    laws(h, f, w, n, t)
    d = data(h, f, w, n)
    size = d.nq + d.nv + d.n_ledger
    for k in range(1, d.n_changes + 1):
        law_changes(d, t, k)
        differentiated(h, f, w, n, y, dy, k * d.f_change, k * d.w_change, y + k * size, dy + k * size)
    return 0
"""
LANES = """WIRING = (
{wiring})
run = make_lanes({laws}, *abreast(rates, WIRING, {lanes}), {lanes})


@calls.exported("lanes")
def lanes(table, places, numbers):
    run(table, places, numbers)
    return 0
"""
PROJECT = """@calls.exported("project")
def project(h, f, w, n, t, y, dy, tolerance):
    return projection(h, f, w, n, t, y, dy, tolerance)
"""
RETRACT = """@calls.exported("retract")
def retract(h, f, w, n, y, displacement, out, total):
    retraction(h, f, w, n, y, displacement, out, total)
    return 0
"""
OBSERVE = """@calls.exported("observe")
def observe(h, f, w, n, rows, count, width, pieces, lines, laws, tolerance, out, length):
    rows, out = calls.carray(rows, (count, width)), calls.carray(out, (length,))
    observation(h, f, w, n, rows, calls.carray(pieces, (lines, laws)), tolerance, out)
    return 0
"""
# one function for both tasks: each would be an object of its own to fetch
ADVANCE = """@calls.exported("advance")
def advance(h, f, w, n, t, repeat, outputs, times, rows, count, width, events, event_count, event_width):
    if repeat < 0:
        rows, events = calls.carray(rows, (count, width)), calls.carray(events, (event_count, event_width))
        outputs = calls.carray(outputs, (times,))
        while True:  # one call, whoever evaluates: a second one might be compiled to other bits
            if not steps(h, f, w, n, outputs, rows, events) or n[m.TOGETHER]:
                break
            calls.awaited(h, f, w, n)
    for _ in range(repeat):
        calls.evaluate(h, f, w, n, t, h[m.Y], h[m.SLOPES])
    return 0
"""
