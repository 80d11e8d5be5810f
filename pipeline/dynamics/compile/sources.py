"""Sources of the functions that are compiled for a mechanism, each in a file of its own.

A file composes exactly the kernels of the kinds present: what a scene does not call for is neither
imported nor compiled. Of no more than it needs, so that mechanisms share files: steps depend on
the integrator and on whether there are closures and contacts, not on joints or bodies.
"""

from __future__ import annotations

from pipeline.core.registry import lookup, module_of
from pipeline.dynamics.integrate.method import Scheme
from pipeline.dynamics.model.contacts import ContactKinds
from pipeline.dynamics.model.model import Kinds

PACKAGES = {
    "joint": "pipeline.dynamics.joints",
    "form": "pipeline.dynamics.contact.form",
    "friction": "pipeline.dynamics.contact.friction",
    "load": "pipeline.dynamics.loads",
    "integrator": "pipeline.dynamics.integrate",
}


def sources(kinds: Kinds, scheme: Scheme) -> dict[str, str]:
    """Source by name of what it compiles, in the order of which calls which."""
    found = {"evaluate": _evaluate(kinds)}
    if kinds.closures:
        found["project"] = _project(kinds)
    if lookup(PACKAGES["integrator"], scheme.integrator, where="solver").retracts:
        found["retract"] = _retract(kinds)
    return found | {"observe": _observe(kinds), "advance": _advance(kinds, scheme)}


def _evaluate(kinds: Kinds) -> str:
    return _text(
        f"right-hand side of {kinds.joints}, {kinds.contacts}, loads {kinds.loads}",
        "from pipeline.dynamics.equations import choice, kinematics as motion, prescribed_motion",
        "from pipeline.dynamics.equations import right_hand_side as equations",
        "from pipeline.dynamics.bodies import rigid",
        *_joint_lines(kinds),
        *_flexible_lines(kinds.flexible, kinds.stiffening),
        *_contact_lines(kinds.contacts),
        *_law_lines(kinds.harmonics),
        *_load_lines(kinds),
        *_closure_lines(kinds.closures),
        _EVALUATE,
    )


def _project(kinds: Kinds) -> str:
    return _text(
        f"projection with {kinds.joints}",
        "from pipeline.dynamics.equations import choice, closures, projection",
        *_joint_lines(kinds),
        _PROJECT,
    )


def _retract(kinds: Kinds) -> str:
    return _text(
        f"retractions of {kinds.joints}",
        "from pipeline.dynamics.equations import choice, retraction",
        *_joint_lines(kinds),
        _RETRACT,
    )


def _observe(kinds: Kinds) -> str:
    return _text(
        f"what is recorded of {kinds.joints}, {kinds.contacts}, loads {kinds.loads}",
        "from pipeline.dynamics.equations import choice, kinematics as motion, observation",
        "from pipeline.dynamics.equations import right_hand_side as equations",
        "from pipeline.dynamics.bodies import rigid",
        *_joint_lines(kinds),
        *_flexible_lines(kinds.flexible, kinds.stiffening),
        *(
            ["flexible_observed, flexible_energy = observation.no_modal, observation.no_energy"]
            if not kinds.flexible
            else [
                "flexible_observed = observation.modal_inertias(body.inertia, body.modal_inertia)",
                "flexible_energy = observation.flexible_energies(body.energies)",
            ]
        ),
        *_contact_lines(kinds.contacts),
        *_load_lines(kinds),
        *_projection_lines(kinds.closures),
        _OBSERVE,
    )


def _advance(kinds: Kinds, scheme: Scheme) -> str:
    return _text(
        f"steps of {scheme}",
        "from pipeline.dynamics import memory as m",
        f"from pipeline.dynamics.integrate import stepper, {_stepping(scheme)} as stepping",
        f"from {module_of(PACKAGES['integrator'], scheme.integrator)} import METHOD",
        *_event_lines(kinds.contacts, scheme),
        *_projection_lines(kinds.closures),
        *_pose_lines(kinds.closures),
        _ADVANCE,
    )


def _text(what: str, *lines: str) -> str:
    imports = ("from numba import njit, types", "from pipeline.dynamics.compile import calls")
    return "\n".join([f'"""Generated: {what}."""', *imports, *lines]) + "\n"


def _joint_lines(kinds: Kinds) -> list[str]:
    return [
        *_imports("joint", kinds.joints, ("motion",)),
        f"joint_motion = choice.choose({_names('joint', 'motion', kinds.joints)})",
    ]


def _projection_lines(present: bool) -> list[str]:
    if present:
        return ["project = calls.project"]
    return ["from pipeline.dynamics.equations.projection import none as project"]


def _pose_lines(closures: bool) -> list[str]:
    return [f"from pipeline.dynamics.integrate.singular_step import {'POSES' if closures else 'NO_POSES'} as poses"]


def _imports(family: str, names: tuple[str, ...], functions: tuple[str, ...], table: str = "NAMES") -> list[str]:
    return [
        f"from {module_of(PACKAGES[family], name, table)} import "
        + ", ".join(f"{function} as {family}_{function}_{k}" for function in functions)
        for k, name in enumerate(names)
    ]


def _names(family: str, function: str, names: tuple[str, ...]) -> str:
    return "(" + "".join(f"{family}_{function}_{k}, " for k in range(len(names))) + ")"


def _flexible_lines(present: bool, stiffening: bool) -> list[str]:
    if not present:
        return [
            "port, inboard = motion.no_port, motion.no_inboard",
            "flexible_inertia, port_load, modal = equations.no_flexible, equations.no_port_load, equations.no_modal",
        ]
    plain = ["shorten, shorten_port = (flexible.straight, flexible.straight), flexible.straight"]
    forms = [
        "from pipeline.dynamics.bodies import shortening",
        "shorten, shorten_port = (shortening.first_moment, shortening.second_moment), shortening.at_port",
    ]
    return [
        "from pipeline.dynamics.bodies import flexible, ports",
        *(forms if stiffening else plain),
        "body = flexible.compose(*shorten)",
        "port, inboard = ports.compose(shorten_port)",
        "flexible_inertia = equations.flexible_inertia(body.inertia, body.mass_matrix)",
        "port_load, modal = equations.gather_port, equations.modal_forces",
    ]


def _stepping(scheme: Scheme) -> str:
    return "fixed" if scheme.fixed else "adaptive"


def _contact_lines(kinds: ContactKinds) -> list[str]:
    if not kinds.surfaces:
        return ["contacts = equations.no_contacts"]
    rub = "frictionless()"
    if kinds.frictions:
        rub = f"rubbing(choice.choose({_names('friction', 'traction', kinds.frictions)}))"
    return [
        "from pipeline.dynamics.contact import forces as contact_forces",
        *_imports("joint", kinds.surfaces, ("separation",), "CONTACTS"),
        *_imports("friction", kinds.frictions, ("traction",)),
        *_imports("form", kinds.forms, ("force", "stored")),
        f"separation = choice.choose({_names('joint', 'separation', kinds.surfaces)})",
        f"normal = choice.choose({_names('form', 'force', kinds.forms)})",
        f"stored = choice.choose({_names('form', 'stored', kinds.forms)})",
        f"contacts = contact_forces.compose(separation, normal, stored, contact_forces.{rub})",
    ]


def _event_lines(kinds: ContactKinds, scheme: Scheme) -> list[str]:
    if not kinds.surfaces:
        return ["events = (stepper.watch_nothing, stepper.settle_nothing, stepper.none_closed)"]
    if not scheme.located:
        return ["from pipeline.dynamics.integrate.step_ends import EVENTS_OF_CONTACTS as events"]
    return [
        "from pipeline.dynamics.integrate import events as contact_events, trace",
        f"events = contact_events.watching(trace.{'regimes' if kinds.frictions else 'no_regimes'})",
    ]


def _law_lines(harmonics: bool) -> list[str]:
    if not harmonics:
        return ["known_motion = prescribed_motion.compose(prescribed_motion.no_harmonics)"]
    return [
        "from pipeline.dynamics.drives.oscillation import oscillate",
        "known_motion = prescribed_motion.compose(oscillate)",
    ]


def _load_lines(kinds: Kinds) -> list[str]:
    if not kinds.loads:
        return []
    return [
        "from pipeline.dynamics.loads import composing",
        *_imports("load", kinds.loads, ("apply",)),
        f"loads = composing.compose({_names('load', 'apply', kinds.loads)})",
        "contacts = equations.both(contacts, loads)",
    ]


def _closure_lines(present: bool) -> list[str]:
    if not present:
        return ["close, known_forces = equations.no_closures, equations.no_known_forces"]
    return ["from pipeline.dynamics.equations.closures import close, known_forces"]


_EVALUATE = """kinematics = motion.compose(joint_motion, port, inboard)
right_hand_side = equations.compose(
    known_motion, kinematics, rigid.inertia, flexible_inertia, port_load, modal, contacts, close, known_forces
)


@calls.exported("evaluate")
def evaluate(h, f, w, n, t, y, dy):
    right_hand_side(h, f, w, n, t, y, dy)
    return 0
"""
_PROJECT = """correct = projection.compose(calls.evaluate, joint_motion, closures.correction)


@calls.exported("project")
def project(h, f, w, n, t, y, dy, tolerance):
    return correct(h, f, w, n, t, y, dy, tolerance)
"""
_RETRACT = """retracted = retraction.compose(joint_motion)


@calls.exported("retract")
def retract(h, w, y, displacement, out, total):
    retracted(h, w, y, displacement, out, total)
    return 0
"""
_OBSERVE = """kinematics = motion.compose(joint_motion, port, inboard)
observer = observation.compose(
    calls.evaluate,
    project,
    kinematics,
    (rigid.inertia, rigid.kinetic_energy),
    (flexible_observed, flexible_energy),
    contacts,
)


@njit(types.void(*calls.ARRAYS, calls.TABLE, calls.WHOLE_TABLE, types.float64, calls.TABLE), cache=True, nogil=True)
def observe(h, f, w, n, rows, pieces, tolerance, out):
    h, f, w, n = calls.flat(h), calls.flat(f), calls.flat(w), calls.flat(n)
    observer(h, f, w, n, rows, pieces, tolerance, out)
"""
# one function for both tasks: each would be an object of its own to fetch
_ADVANCE = """step = stepper.compose(calls.evaluate, project, calls.retract, METHOD, stepping.compose, events, poses)


@njit(
    types.void(*calls.ARRAYS, types.float64, types.int64, types.float64[::1], calls.TABLE, calls.TABLE),
    cache=True,
    nogil=True,
)
def advance(h, f, w, n, t, repeat, outputs, rows, events):
    h, f, w, n = calls.flat(h), calls.flat(f), calls.flat(w), calls.flat(n)
    if repeat < 0:
        step(h, f, w, n, outputs, rows, events)
    for _ in range(repeat):
        calls.evaluate(h, f, w, n, t, h[m.Y], h[m.SLOPES])
"""
