"""One compiled entry per set of part kinds, cached on disk across processes.

The entry is a generated file that composes exactly the kernels of the kinds present: what a scene
does not call for is neither imported nor compiled. Its name is a digest of the sources of all
kernels it can reach and of the versions of the compiler, because Numba's own cache looks at the
entry's file alone and would keep stale callees.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType

import llvmlite
import numba
from numba.core.bytecode import FunctionIdentity

from pipeline.core.artifacts.paths import kernel_root
from pipeline.core.registry import module_of
from pipeline.core.workflow.fingerprint import Sources, imported
from pipeline.dynamics.assembly.contact_numbers import ContactKinds
from pipeline.dynamics.assembly.numbers import Kinds
from pipeline.dynamics.integrate.method import Scheme

#: how compiled functions are named (see `compiling`); part of the digest
NAMING = "counters by entry"
SOURCES = Sources(Path(__file__).resolve().parents[3])
PACKAGES = {
    "joint": "pipeline.dynamics.joints",
    "form": "pipeline.dynamics.contact.form",
    "friction": "pipeline.dynamics.contact.friction",
    "load": "pipeline.dynamics.loads",
    "integrator": "pipeline.dynamics.integrate",
}


def entry(kinds: Kinds, scheme: Scheme) -> ModuleType:
    """The module with the compiled functions `advance`, `observe` and `evaluate` for these kinds."""
    source = _source(kinds, scheme)
    name = f"flexclear_kernels_{_digest(source)}"
    if name in sys.modules:
        return sys.modules[name]
    path = _folder() / f"{name}.py"
    if not path.exists():
        _write(path, source)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def compiling(kinds: Kinds, scheme: Scheme) -> Iterator[None]:
    """Held while an entry may be compiled: of two processes the second waits for the first's code.

    Numba names the code of a function by its qualified name and a counter of the process. Entries
    that two processes compiled would share names for different code, and a third process that
    loads both would mix them up (numba issue 10486); so each entry counts from its own number.
    """
    digest = _digest(_source(kinds, scheme))
    with (_folder() / f"{digest}.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        FunctionIdentity._unique_ids = itertools.count(int(digest[:12], 16) << 16)
        yield


def is_compiled(kinds: Kinds, scheme: Scheme) -> bool:
    """Whether the machine code of this entry is on disk already."""
    name = f"flexclear_kernels_{_digest(_source(kinds, scheme))}"
    return any((_folder() / "__pycache__").glob(f"{name}.enter*.nbc"))


def _folder() -> Path:
    folder = kernel_root()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _write(path: Path, source: str) -> None:
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    temporary.write_text(source)
    os.replace(temporary, path)


@cache
def _digest(source: str) -> str:
    """Digest of the entry, of the kernel sources that it reaches, and of the compiler."""
    digest = hashlib.sha256(source.encode())
    digest.update(f"{NAMING} {numba.__version__} {llvmlite.__version__} {sys.version_info[:2]}".encode())
    roots = imported(source.encode(), "entry", package=False)[0]
    for name, source_digest in sorted(_reached(roots).items()):
        digest.update(f"{name} {source_digest}".encode())
    return digest.hexdigest()[:20]


def _reached(roots: set[str]) -> dict[str, str]:
    """Digests of this tower's modules that the entry imports, directly or not.

    Packages on the way do not count: their ``__init__`` modules hold no kernel, but reach everything.
    """
    found: dict[str, str] = {}
    waiting = sorted(roots)
    while waiting:
        name = waiting.pop()
        module = SOURCES.module(name)
        package = (SOURCES.root / Path(*name.split("."))).is_dir()
        if module is None or name in found or not name.startswith("pipeline.dynamics"):
            continue
        if not package:
            found[name] = module.digest
            waiting.extend(module.own)
    return found


def _source(kinds: Kinds, scheme: Scheme) -> str:
    lines = [
        f'"""Generated: joints {kinds.joints}, {kinds.contacts}."""',
        *([f"# loads {kinds.loads}"] if kinds.loads else []),
        "import numpy as np",
        "from numba import njit",
        "from pipeline.dynamics.tables import SLOPES, Y",
        "from pipeline.dynamics.assembly import dispatch, equations, known, kinematics as motion",
        "from pipeline.dynamics.bodies import rigid",
        "from pipeline.dynamics.integrate import displace as displacing, observe as observing, project as projecting",
        f"from pipeline.dynamics.integrate import stepper, {_stepping(scheme)} as stepping",
        f"from {module_of(PACKAGES['integrator'], scheme.integrator)} import METHOD",
    ]
    lines += _imports("joint", kinds.joints, ("motion",))
    lines.append(f"joint_motion = dispatch.choose({_names('joint', 'motion', kinds.joints)})")
    lines += _flexible_lines(kinds.flexible, kinds.stiffening)
    lines += _contact_lines(kinds.contacts, scheme)
    lines += _law_lines(kinds.harmonics)
    lines += _load_lines(kinds)
    lines += _closure_lines(kinds.closures)
    lines += [_BODY, _ENTRIES]
    return "\n".join(lines) + "\n"


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
            "flexible_observed, flexible_energy = observing.no_modal, observing.no_energy",
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
        "flexible_observed = observing.modal_inertias(body.inertia, body.modal_inertia)",
        "flexible_energy = observing.flexible_energies(body.energies)",
    ]


def _stepping(scheme: Scheme) -> str:
    return "fixed" if scheme.fixed else "adaptive"


def _contact_lines(kinds: ContactKinds, scheme: Scheme) -> list[str]:
    if not kinds.surfaces:
        return ["contacts = equations.no_contacts", "events = (stepper.watch_nothing, stepper.settle_nothing)"]
    rub, regimes = "frictionless()", "no_regimes"
    if kinds.frictions:
        rub, regimes = f"rubbing(dispatch.choose({_names('friction', 'traction', kinds.frictions)}))", "regimes"
    events = [
        "from pipeline.dynamics.integrate import events as contact_events, trace",
        f"events = contact_events.watching(trace.{regimes})",
    ]
    if not scheme.located:
        events = ["from pipeline.dynamics.integrate.step_ends import EVENTS_OF_CONTACTS as events"]
    return [
        "from pipeline.dynamics.contact import forces as contact_forces",
        *_imports("joint", kinds.surfaces, ("separation",), "CONTACTS"),
        *_imports("friction", kinds.frictions, ("traction",)),
        *_imports("form", kinds.forms, ("force", "stored")),
        f"separation = dispatch.choose({_names('joint', 'separation', kinds.surfaces)})",
        f"normal = dispatch.choose({_names('form', 'force', kinds.forms)})",
        f"stored = dispatch.choose({_names('form', 'stored', kinds.forms)})",
        f"contacts = contact_forces.compose(separation, normal, stored, contact_forces.{rub})",
        *events,
    ]


def _law_lines(harmonics: bool) -> list[str]:
    if not harmonics:
        return ["known_motion = known.compose(known.no_harmonics)"]
    return [
        "from pipeline.dynamics.drives.oscillation import oscillate",
        "known_motion = known.compose(oscillate)",
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
        return ["close, known_forces, correction = equations.no_closures, equations.no_known_forces, None"]
    return [
        "from pipeline.dynamics.assembly import closures",
        "close, known_forces, correction = closures.close, closures.known_forces, closures.correction",
    ]


_BODY = """kinematics = motion.compose(joint_motion, port, inboard)
rhs = equations.compose(
    known_motion, kinematics, rigid.inertia, flexible_inertia, port_load, modal, contacts, close, known_forces
)
project = projecting.compose(rhs, joint_motion, correction) if correction else projecting.none
displace = displacing.compose(joint_motion)
step = stepper.compose(rhs, project, displace, METHOD, stepping.compose, events)
observer = observing.compose(
    rhs, project, kinematics, (rigid.inertia, rigid.kinetic_energy), (flexible_observed, flexible_energy), contacts
)
"""

# One function for all three tasks: the right-hand side is then compiled once, not once for each.
_ENTRIES = '''
@njit(cache=True, nogil=True)
def enter(task, h, f, w, n, t, number, outputs, rows, events, pieces, out):
    """0: evaluate `number` times; 1: advance; 2: observe."""
    if task == 0:
        for _ in range(int(number)):
            rhs(h, f, w, n, t, h[Y], h[SLOPES])
    elif task == 1:
        step(h, f, w, n, outputs, rows, events)
    else:
        observer(h, f, w, n, rows, pieces, number, out)


_FLOATS, _TABLE, _INTEGERS = np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0), dtype=np.int64)


def evaluate(h, f, w, n, t, repeat=1):
    """Slope of the state in Y at time t, into the first row of SLOPES."""
    enter(0, h, f, w, n, t, float(repeat), _FLOATS, _TABLE, _TABLE, _INTEGERS, _TABLE)


def advance(h, f, w, n, outputs, rows, events):
    """Step to the end of the segment or of the budget."""
    enter(1, h, f, w, n, 0.0, 0.0, outputs, rows, events, _INTEGERS, _TABLE)


def observe(h, f, w, n, rows, pieces, tolerance, out):
    """Evaluate what is recorded of every row."""
    enter(2, h, f, w, n, 0.0, tolerance, _FLOATS, rows, _TABLE, pieces, out)
'''
