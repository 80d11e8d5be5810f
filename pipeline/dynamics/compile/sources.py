"""Sources of the functions that are compiled for a mechanism, each in a file of its own: lists of parts.

A file composes exactly the kernels of the kinds present: what a scene does not call for is neither
imported nor compiled. Of no more than it needs, so that mechanisms share files: steps depend on
the integrator and on whether there are closures and contacts, not on joints or bodies.

What effects add to a file they declare (`effects.effect`), at four points: "forces", "closures", "evaluate" (the
right-hand side) and "observe" (what is recorded).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flexclear.pipeline.core.scene import integrators
from flexclear.pipeline.core.scene.registry import listed, lookup
from flexclear.pipeline.dynamics.effects import (
    FORMS,
    FRICTION_LAWS,
    INTEGRATORS,
    JOINTS,
    LOADS,
    RUNS,
    SURFACES,
    Parts,
    Scheme,
)
from flexclear.pipeline.dynamics.effects.effect import PACKAGE, Effect

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.specialise.wiring import Wiring

DYNAMICS = "flexclear.pipeline.dynamics"
#: what others are called by, and what takes LLVM's text
CALLS, FILES = (f"{DYNAMICS}.compile", "calls"), (f"{DYNAMICS}.compile", "files")
#: straight code: the right-hand side as steps call it, the same with all that it leaves, and what is recorded
SPECIALISED, WHOLE, DESCRIBED = "specialised", "whole", "described"
PRESCRIBED = f"{DYNAMICS}.equations.prescribed_motion"


@dataclass
class Composition:
    """A file in the making for a mechanism's parts.

    given: arguments of what makes its function, by name.  imports: (module, name) each.
    """

    parts: Parts
    given: dict[str, str] = field(default_factory=dict)
    imports: list[tuple[str, str]] = field(default_factory=list)

    def take(self, module: str, name: str) -> str:
        """Import a name, which is returned."""
        others = {known for package, known in self.imports if package != module}
        assert name not in others, f"two parts of one mechanism are called {name}"
        self.imports.append((module, name))
        return name

    def part(self, package: str, name: str) -> str:
        """A family's part: a module, or what it holds."""
        module, attribute = listed(package, name, where="parts")
        below, _, own = module.rpartition(".")
        return f"{self.take(below, own)}.{attribute}".rstrip(".")

    def family(self, package: str, names: Iterable[str]) -> str:
        """A tuple of a family's parts."""
        return "(" + "".join(f"{self.part(package, name)}, " for name in names) + ")"

    @property
    def tree(self) -> str:
        """The module that factors the mass matrix."""
        return self.take(f"{DYNAMICS}.equations", "articulated" if self.parts.articulated else "composite")

    @property
    def forms(self) -> str:
        """The forms of normal forces."""
        return self.family(FORMS, self.parts.forms)

    def add_effects(self, point: str) -> None:
        """Add what the effects present declare for a point."""
        for effect in self.parts.present:
            self.given |= {name: self._of(effect, text) for name, text in effect.compose.get(point, {}).items()}

    def _of(self, effect: Effect, text: str) -> str:
        """An argument that an effect declares, its own names imported."""
        kinds, own = self.parts.kinds(effect.name), f"{PACKAGE}.{effect.name}"
        text = re.sub(r"<(?:(\w+)\.)?(\w+)>", lambda m: self.take(f"{own}.{m[1]}" if m[1] else own, m[2]), text)
        chosen = self.family(f"{DYNAMICS}.{effect.family}", kinds) if kinds and "{kinds}" in text else ""
        return text.format(file=self, kinds=chosen)


def sources(parts: Parts, scheme: Scheme) -> dict[str, str]:
    """Source by name of what it compiles besides the right-hand side, in the order of which calls which."""
    by_name = {"prescribe": _prescribe(parts)}
    if parts.closures:
        by_name["project"] = _project(parts)
    if integrators.INTEGRATORS[scheme.integrator].retracts:
        by_name["retract"] = _retract(parts)
    steps = _steps(parts, scheme)
    if "events" in steps.given:
        by_name["resolve"] = _resolve(steps, scheme)
    return by_name | {"observe": _observe(parts), "advance": _advance(parts, scheme)}


def kernels(parts: Parts) -> dict[str, str]:
    """Source by name of what a mechanism of these parts calls whose wiring has no code of its own."""
    return {
        "evaluate": _evaluate(parts),
        "describe": _text(*_description(parts), _calling("describe", "description"), _formulas(parts)),
    }


def straight(parts: Parts, wiring: Wiring, name: str = SPECIALISED, *, exact: bool = False) -> str:
    """Source of straight code for one wiring.

    name: of the right-hand side as steps call it, of the same with all that it leaves, or of what is recorded.
    exact: with the bits that it gives to each of several lanes.
    """
    file, what, kernel, maker = _description(parts) if name == DESCRIBED else _equations(parts)
    for taken in ("straight", "NAME"):
        file.take(f"{DYNAMICS}.specialise.straight", taken)
    options = {SPECIALISED: f"exact={exact}", WHOLE: "whole=True", DESCRIBED: "describes=True"}[name]
    function = STRAIGHT.format(
        wiring=_rows(wiring), kernel=kernel, options=options, level=3 if name == SPECIALISED else 0
    )
    return _text(file, f"{what}, for one wiring", kernel, maker, function, _formulas(parts), using=FILES)


def abreast(parts: Parts, wiring: Wiring, lanes: int) -> str:
    """Source of what lets so many steppers of one wiring proceed (`compile.lanes`)."""
    file, what, kernel, maker = _equations(parts)
    file.take(f"{DYNAMICS}.specialise", "abreast")
    file.take(f"{DYNAMICS}.compile.lanes", "make_lanes")
    function = LANES.format(wiring=_rows(wiring), lanes=lanes)
    return _text(file, f"{what}, for one wiring", kernel, maker, function, _formulas(parts))


def along(parts: Parts, wiring: Wiring) -> str:
    """Source of the right-hand side for one wiring with its tangent."""
    file, what, kernel, maker = _equations(parts)
    file.take(f"{DYNAMICS}.specialise", "abreast")
    file.take(f"{DYNAMICS}.fields", "data")
    change = file.take(f"{DYNAMICS}.drives.oscillation", "change_oscillation") if parts.harmonics else ""
    law_changes = f"{file.take(PRESCRIBED, 'make_law_changes')}({change})"
    function = CHANGES.format(wiring=_rows(wiring), law_changes=law_changes)
    return _text(file, f"{what}, for one wiring", kernel, maker, function, _formulas(parts))


def _rows(wiring: Wiring) -> str:
    return "".join(f"    {row},\n" for row in wiring)


def rates(parts: Parts) -> str:
    """Source of the kernel `rates` alone, which Python runs (`specialise.dual`), without friction of ideal joints."""
    return _text(*_equations(parts, whole=False), "", _formulas(parts))


def _equations(parts: Parts, *, whole: bool = True) -> tuple[Composition, str, str, str]:
    """A file for the right-hand side, with what it is, the name of its kernel, and what makes that.

    whole: with friction of ideal joints.
    """
    file = _forces(parts)
    file.given["tree"] = file.tree
    if parts.closures:
        _close(file)
    if whole:
        file.add_effects("evaluate")
    maker = file.take(f"{DYNAMICS}.equations.right_hand_side", "make_rates")
    return file, f"right-hand side of {', '.join(parts.joints)}", "rates", maker


def _evaluate(parts: Parts) -> str:
    file, what, _, _ = _equations(parts)
    file.given["laws"] = f"{file.take(PRESCRIBED, 'make_laws')}({_harmonics(file)})"
    maker = file.take(f"{DYNAMICS}.equations.right_hand_side", "make_right_hand_side")
    return _text(
        file, what, "right_hand_side", maker, _calling("evaluate", "right_hand_side", "t, y, dy"), _formulas(parts)
    )


def _prescribe(parts: Parts) -> str:
    file = Composition(parts)
    if parts.harmonics:
        file.given["harmonics"] = _harmonics(file)
    return _text(file, "laws of time", "laws", file.take(PRESCRIBED, "make_laws"), _calling("prescribe", "laws", "t"))


def _harmonics(file: Composition) -> str:
    return file.take(f"{DYNAMICS}.drives.oscillation", "oscillate") if file.parts.harmonics else ""


def _project(parts: Parts) -> str:
    file = _joints(parts)
    file.given["evaluate"] = "calls.evaluate"
    _close(file)
    if parts.flexible:
        stiffen = file.take(f"{DYNAMICS}.equations.projection", "make_stiffen")
        file.given["stiffen"] = f"{stiffen}({file.given['closures']}, {file.tree}, {_flexible(file)})"
        file.given["to_modes"] = file.take(f"{DYNAMICS}.bodies.interface", "to_modes")
    maker = file.take(f"{DYNAMICS}.equations.projection", "make_projection")
    return _text(file, f"projection with {', '.join(parts.joints)}", "projection", maker, PROJECT)


def _retract(parts: Parts) -> str:
    file = _joints(parts)
    maker = file.take(f"{DYNAMICS}.equations.retraction", "make_retraction")
    return _text(
        file,
        f"retraction of {', '.join(parts.joints)}",
        "retraction",
        maker,
        _calling("retract", "retraction", "y, displacement, out, total"),
    )


def _description(parts: Parts) -> tuple[Composition, str, str, str]:
    """A file for what is recorded of an evaluation, with what it is, the name of its kernel, and what makes that."""
    file = _forces(parts)
    file.add_effects("observe")
    if parts.closures:
        file.add_effects("observe closures")
    maker = file.take(f"{DYNAMICS}.equations.observation", "make_description")
    return file, f"what is recorded of {', '.join(parts.joints)}", "description", maker


def _observe(parts: Parts) -> str:
    file = Composition(parts)
    file.given = {"evaluate": "calls.evaluate", "laws": "calls.laws", "describe": "calls.describe"}
    file.given["project"] = _projection(file)
    maker = file.take(f"{DYNAMICS}.equations.observation", "make_observation")
    return _text(file, "record", "observation", maker, OBSERVE)


def _advance(parts: Parts, scheme: Scheme) -> str:
    file = _steps(parts, scheme)
    file.given["stepping"] = file.take(INTEGRATORS, "fixed" if scheme.fixed else "adaptive")
    if "events" in file.given:
        file.given["resolve"] = "calls.resolve"
    file.take(DYNAMICS, "memory as m")
    maker = file.take(f"{INTEGRATORS}.stepper", "make_advance")
    return _text(file, f"steps of {scheme}", "steps", maker, ADVANCE)


def _resolve(file: Composition, scheme: Scheme) -> str:
    file.take(f"{DYNAMICS}.fields", "data")
    maker = file.take(f"{INTEGRATORS}.stepper", "make_resolution")
    return _text(file, f"events in steps of {scheme}", "resolution", maker, RESOLVE)


def _steps(parts: Parts, scheme: Scheme) -> Composition:
    """What steps, and the events in them, are made of."""
    module, method = listed(INTEGRATORS, scheme.integrator, where="[solver.integrator]")
    file = Composition(parts)
    file.given = {
        "evaluate": "calls.rates",
        "project": _projection(file),
        "retract": "calls.retract",
        "method": file.take(module, method),
    }
    if integrators.INTEGRATORS[scheme.integrator].reads_all:
        file.given["complete"] = f"(calls.evaluate, {file.tree})"
    events = _events(file, scheme)
    if events:
        file.given["events"] = events
    if parts.closures:
        file.given["poses"] = file.take(INTEGRATORS, "singular_step")
    return file


def _events(file: Composition, scheme: Scheme) -> str:
    """What the stepper searches for in each step; nothing for the default, which is nothing."""
    parts, chosen = file.parts, not scheme.fixed
    touching = parts.surfaces or any(effect.touches for effect in parts.present)
    if touching and not scheme.located:
        return file.take(f"{INTEGRATORS}.step_end_events", "AT_STEP_ENDS")
    guarded = chosen and (parts.frictions or parts.load_kinks or any(effect.guards for effect in parts.present))
    if touching:
        located = file.take(f"{INTEGRATORS}.contact_events", "located")
        given = [file.take(f"{INTEGRATORS}.contact_phases", "regimes" if parts.frictions else "no_regimes")]
        if guarded:
            given.append(file.take(f"{INTEGRATORS}.guards", "AMONG_CONTACTS"))
        return f"{located}({', '.join(given)})"
    return file.take(f"{INTEGRATORS}.guards", "GUARDS") if guarded else ""


def _joints(parts: Parts) -> Composition:
    file = Composition(parts)
    file.given["joints"] = file.family(JOINTS, parts.joints)
    return file


def _forces(parts: Parts) -> Composition:
    """What acts in the mechanism: joints, flexible bodies, contacts, loads."""
    file = _joints(parts)
    if parts.flexible:
        file.given["flexible"] = _flexible(file)
    if parts.surfaces:
        surfaces = file.family(SURFACES, parts.surfaces)
        maker, frictions = (
            file.take(f"{DYNAMICS}.contact.forces", "make_contacts"),
            file.family(FRICTION_LAWS, parts.frictions),
        )
        file.given["contacts"] = f"{maker}(surfaces={surfaces}, forms={file.forms}, frictions={frictions})"
    if parts.loads:
        kinds = "".join(f"{_load(file, n, *kind.split(maxsplit=1))}, " for n, kind in enumerate(parts.loads))
        file.given["loads"] = f"{file.take(f'{DYNAMICS}.loads.composing', 'make_loads')}(({kinds}))"
    file.add_effects("forces")
    return file


def _flexible(file: Composition) -> str:
    """What makes the kernels of the flexible bodies, unless an effect brings more."""
    return f"{file.take(f'{DYNAMICS}.bodies.flexible', 'flexible_bodies')}()"


def _load(file: Composition, number: int, name: str, formula: str = "") -> str:
    """The module of a kind of loads, or what it makes of the kernel of an expression (`_formulas`)."""
    module = file.part(LOADS, name)
    if not formula:
        return module
    file.take(f"{DYNAMICS}.kernels", "kernel")
    file.take(LOADS, "looks")
    return f"{module}.applying(formula{number})"


def _formulas(parts: Parts) -> str:
    """The kernels of the expressions of loads."""
    written = [(n, kind.split(maxsplit=1)) for n, kind in enumerate(parts.loads)]
    texts = [(f"formula{n}", kind[1]) for n, kind in written if len(kind) > 1]
    if not texts:
        return ""
    formulas = lookup(RUNS, "expressions", where="parts")  # as `effects.ways` has it of scenes with such loads
    return "\n\n".join(formulas.source(*text) for text in texts)


def _close(file: Composition) -> None:
    """Add the kernels of the closures: of joints, unless an effect brings more."""
    file.add_effects("closures")
    if "closures" not in file.given:
        file.given["closures"] = f"{file.take(f'{DYNAMICS}.equations.closures', 'make_closing')}({file.tree})"


def _projection(file: Composition) -> str:
    return "calls.project" if file.parts.closures else file.take(f"{DYNAMICS}.equations.projection", "no_projection")


def _calling(name: str, kernel: str, arguments: str = "") -> str:
    """The function that others call by its address for a kernel that returns nothing."""
    given = ", ".join(["h, f, w, n", *([arguments] if arguments else [])])
    return f'@calls.exported("{name}")\ndef {name}({given}):\n    {kernel}({given})\n    return 0\n'


def _text(
    file: Composition,
    what: str,
    result: str,
    maker: str,
    function: str,
    kernels: str = "",
    using: tuple[str, str] = CALLS,
) -> str:
    lines = sorted({f"from {module} import {name}" for module, name in [*([using] if function else []), *file.imports]})
    arguments = [f"    {key}={value}," for key, value in file.given.items()]
    return "\n".join(
        [f'"""Generated: {what}."""', *lines, "", kernels, f"{result} = {maker}(", *arguments, ")", "", "", function]
    )


# laws of time are looked up as ever: their pieces change with time, and their number with the scene's numbers
STRAIGHT = """WIRING = (
{wiring})
files.assembles(__name__, NAME, lambda: straight({kernel}, WIRING, {options}), {level})
"""
CHANGES = """WIRING = (
{wiring})
law_changes, differentiated = {law_changes}, abreast.along(rates, WIRING)


@calls.exported("evaluate")
def specialised(h, f, w, n, t, y, dy):
    calls.laws(h, f, w, n, t)
    d = data(h, f, w, n)
    size = d.nq + d.nv + d.n_ledger
    for k in range(1, d.n_changes + 1):
        law_changes(d, t, k)
        differentiated(h, f, w, n, y, dy, k * d.f_change, k * d.w_change, y + k * size, dy + k * size)
    return 0
"""
LANES = """WIRING = (
{wiring})
run = make_lanes(*abreast.abreast(rates, WIRING, {lanes}), {lanes})


@calls.exported("lanes")
def lanes(table, places, numbers):
    run(table, places, numbers)
    return 0
"""
PROJECT = """@calls.exported("project")
def project(h, f, w, n, t, y, dy, tolerance):
    return projection(h, f, w, n, t, y, dy, tolerance)
"""
OBSERVE = """@calls.exported("observe")
def observe(h, f, w, n, rows, count, width, pieces, lines, laws, tolerance, out, length):
    rows, out = calls.carray(rows, (count, width)), calls.carray(out, (length,))
    observation(h, f, w, n, rows, calls.carray(pieces, (lines, laws)), tolerance, out)
    return 0
"""
RESOLVE = """@calls.exported("resolve")
def resolve(h, f, w, n, step, t_new, rows, count, width, events, event_count, event_width):
    rows, events = calls.carray(rows, (count, width)), calls.carray(events, (event_count, event_width))
    return resolution(data(h, f, w, n), step, t_new, rows, events)
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
