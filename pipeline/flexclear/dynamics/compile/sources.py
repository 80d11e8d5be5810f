"""Sources of the compiled functions of a mechanism, a file each.

A file composes exactly the kernels that a scene uses: others are neither imported nor compiled. It depends on no more
than it needs, so that mechanisms share files: steps depend on the integrator and on the presence of closures and
contacts, not on joints or bodies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flexclear.dynamics.effects import Parts, Scheme

if TYPE_CHECKING:
    from flexclear.dynamics.specialise.topology import Topology

DYNAMICS = "flexclear.dynamics"
INTEGRATE = f"{DYNAMICS}.integrate"
#: modules of calls by address, and of functions assembled from LLVM code
CALLS, FILES = (f"{DYNAMICS}.compile", "calls"), (f"{DYNAMICS}.compile", "files")
#: right-hand side of one topology, as steps call it
SPECIALISED = "specialised"
PROGRAM, BATCHED = f"{DYNAMICS}.specialise.program", (f"{DYNAMICS}.specialise", "batched")
PRESCRIBED = f"{DYNAMICS}.equations.prescribed_motion"


@dataclass
class Composition:
    """A generated file under construction for a mechanism's parts.

    what: description.  kernel: name of its kernel.  maker: module and name of the function that builds the kernel.
    given: arguments of the maker, by name.  imports: (module, name) each.
    """

    parts: Parts
    what: str
    kernel: str
    maker: tuple[str, str]
    given: dict[str, str] = field(default_factory=dict)
    imports: list[tuple[str, str]] = field(default_factory=list)

    def take(self, module: str, name: str) -> str:
        """Import a name and return it."""
        others = {known for package, known in self.imports if package != module}
        assert name not in others, f"two parts of one mechanism have the name {name}"
        self.imports.append((module, name))
        return name

    @property
    def harmonics(self) -> str:
        """Name of the kernel of harmonic laws; empty without harmonics."""
        return self.take(f"{DYNAMICS}.drives.oscillation", "oscillate") if self.parts.harmonics else ""

    @property
    def projection(self) -> str:
        """Expression for the kernel that projects states onto the closures."""
        return (
            "calls.project" if self.parts.closures else self.take(f"{DYNAMICS}.equations.projection", "no_projection")
        )

    def text(self, function: str) -> str:
        """Return the source; function: code to compile, which calls others by address; empty for none."""
        maker = self.take(*self.maker)
        lines = sorted(
            {f"from {module} import {name}" for module, name in [*([CALLS] if function else []), *self.imports]}
        )
        arguments = [f"    {key}={value}," for key, value in self.given.items()]
        made = [f"{self.kernel} = {maker}(", *arguments, ")", "", "", function]
        return "\n".join([f'"""Generated: {self.what}."""', *lines, "", *made])


def sources_of_functions(parts: Parts, scheme: Scheme) -> dict[str, str]:
    """Return the sources by function name, without those of one topology, in an order where callees come first."""
    by_name = {"prescribe": _laws(parts).text(PRESCRIBE)}
    if parts.closures:
        by_name["project"] = _projection(parts).text(PROJECT)
    if events := _events_of_steps(parts, scheme):
        by_name["resolve"] = events.text(RESOLVE)
    return by_name | {"observe": _observation(parts).text(OBSERVE), "advance": _advance(parts, scheme).text(ADVANCE)}


def _laws(parts: Parts) -> Composition:
    """Return a file for the laws of time."""
    file = Composition(parts, "laws of time", "laws", (PRESCRIBED, "make_laws"))
    if parts.harmonics:
        file.given["harmonics"] = file.harmonics
    return file


def source_of_steps(parts: Parts, topology: Topology, *, exact: bool = False) -> str:
    """Return the source of steps' right-hand side of one topology; exact: with the same bits as in each of several
    lanes."""
    longest = "LONGEST" if exact else "LONGEST_STRAIGHT"
    used = [FILES, (PROGRAM, "llvm_text"), (PROGRAM, "NAME")]
    return _of_topology(parts, topology, STRAIGHT, used, longest, exact=exact)


def source_of_lanes(parts: Parts, topology: Topology, lanes: int) -> str:
    """Return the source of the function that advances several steppers of one topology (`compile.lanes`)."""
    taken = [CALLS, (f"{DYNAMICS}.compile.lanes", "make_lanes"), BATCHED]
    return _of_topology(parts, topology, LANES, taken, "LONGEST", lanes=lanes)


def source_of_tangents(parts: Parts, topology: Topology) -> str:
    """Return the source of the right-hand side for one topology with its tangents."""
    taken, change = [CALLS, (f"{DYNAMICS}.fields", "data"), BATCHED, (PRESCRIBED, "make_law_changes")], ""
    if parts.harmonics:
        taken.append((f"{DYNAMICS}.drives.oscillation", change := "change_oscillation"))
    return _of_topology(parts, topology, CHANGES, taken, "LONGEST_DIFFERENTIATED", harmonics=change)


def _of_topology(
    parts: Parts,
    topology: Topology,
    template: str,
    taken: list[tuple[str, str]],
    longest: str,
    **values: object,
) -> str:
    """Return the source of code for steps; taken: modules and names that it imports; longest: name of its limit."""
    values["topology"] = "".join(f"    {row},\n" for row in topology)
    used = (PROGRAM, longest), (f"{DYNAMICS}.effects", "Parts"), (f"{DYNAMICS}.mechanics.of_topology", "program_of")
    imports = "".join(f"from {module} import {name}\n" for module, name in sorted([*taken, *used]))
    made = template.format(made=f"program_of(PARTS, TOPOLOGY, {longest})", **values)
    return f'"""Generated: right-hand side for one topology."""\n{imports}\nPARTS = {parts}\n{made}'


def for_python(parts: Parts, scheme: Scheme) -> Iterator[tuple[str, str]]:
    """Yield the name and the source of all kernels that Python evaluates in place of functions; they use `calls`."""
    events = _events_of_steps(parts, scheme)
    files = [_laws(parts), _observation(parts), _advance(parts, scheme), *([events] if events else [])]
    for file in [*files, *([_projection(parts)] if parts.closures else [])]:
        yield file.kernel, file.text("")


def _projection(parts: Parts) -> Composition:
    """Return a file for the projection onto the closures."""
    file = Composition(parts, "projection", "projection", (f"{DYNAMICS}.equations.projection", "make_projection"))
    file.given = {"rates": "calls.rates", "correct": "calls.correct"}
    return file


def _observation(parts: Parts) -> Composition:
    """Return a file for the record of states."""
    file = Composition(parts, "record", "observation", (f"{DYNAMICS}.equations.observation", "make_observation"))
    file.given = {"evaluate": "calls.evaluate", "project": file.projection}
    return file


def _events_of_steps(parts: Parts, scheme: Scheme) -> Composition | None:
    """Return a file for the events in steps; None without these."""
    file = _steps(parts, scheme, f"events in steps of {scheme}", "resolution", "make_resolution")
    file.take(f"{DYNAMICS}.fields", "data")
    return file if "events" in file.given else None


def _advance(parts: Parts, scheme: Scheme) -> Composition:
    """Return a file for steps."""
    file = _steps(parts, scheme, f"steps of {scheme}", "steps", "make_advance")
    file.given["stepping"] = file.take(INTEGRATE, "fixed" if scheme.fixed else "adaptive")
    if "events" in file.given:
        file.given["resolve"] = "calls.resolve"
    file.take(DYNAMICS, "memory as m")
    return file


def _steps(parts: Parts, scheme: Scheme, what: str, kernel: str, maker: str) -> Composition:
    """Return a file for steps, or for the events in them."""
    file = Composition(parts, what, kernel, (f"{INTEGRATE}.stepper", maker))
    file.given = {
        "evaluate": "calls.rates",
        "project": file.projection,
        "lists": "calls",
        "method": f'{file.take(INTEGRATE, "METHODS")}["{scheme.integrator}"]',
    }
    events = _events(file, scheme)
    if events:
        file.given["events"] = events
    if parts.closures:
        file.given["poses"] = file.take(INTEGRATE, "singular_step")
    return file


def _events(file: Composition, scheme: Scheme) -> str:
    """Return the expression for the events that the stepper locates in each step; empty for the default: none."""
    parts, chosen = file.parts, not scheme.fixed
    touching = parts.surfaces or any(effect.touches for effect in parts.present)
    if touching and not scheme.located:
        return file.take(f"{INTEGRATE}.step_end_events", "AT_STEP_ENDS")
    guarded = chosen and (parts.frictions or parts.load_kinks or any(effect.guards for effect in parts.present))
    if touching:
        located = file.take(f"{INTEGRATE}.contact_events", "located")
        given = [file.take(f"{INTEGRATE}.contact_phases", "regimes" if parts.frictions else "no_regimes")]
        if guarded:
            given.append(file.take(f"{INTEGRATE}.guards", "AMONG_CONTACTS"))
        return f"{located}({', '.join(given)})"
    return file.take(f"{INTEGRATE}.guards", "GUARDS") if guarded else ""


# laws of time are not specialised: their pieces change with time, and their number with the scene's numbers
STRAIGHT = """TOPOLOGY = (
{topology})
files.assembles(__name__, NAME, lambda: llvm_text({made}, exact={exact}), 3)
"""
CHANGES = """TOPOLOGY = (
{topology})
law_changes, differentiated = make_law_changes({harmonics}), batched.differentiated(lambda: {made})


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
LANES = """TOPOLOGY = (
{topology})
run = make_lanes(*batched.batched(lambda: {made}, {lanes}), {lanes})


@calls.exported("lanes")
def lanes(table, places, numbers):
    run(table, places, numbers)
    return 0
"""
PRESCRIBE = """@calls.exported("prescribe")
def prescribe(h, f, w, n, t):
    laws(h, f, w, n, t)
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
# one function for both tasks: each function is an object of its own to load
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
