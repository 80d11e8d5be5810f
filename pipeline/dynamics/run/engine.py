"""A system with its compiled entry: evaluate a state, integrate a trajectory, observe its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.core.errors import InputError, SolverError
from pipeline.core.progress import Progress
from pipeline.core.registry import lookup
from pipeline.dynamics import memory as m
from pipeline.dynamics.compile import functions
from pipeline.dynamics.effects import scheme_of
from pipeline.dynamics.equations import observation as observing
from pipeline.dynamics.integrate.method import Method
from pipeline.dynamics.model import initial, selection
from pipeline.dynamics.model.mobility import Mobility, analyse
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.run import singular

INTEGRATORS = "pipeline.dynamics.integrate"

#: two breaks nearer than this share of the run are the same instant, written or summed up in two ways
SHORTEST_SEGMENT = 1e-12
#: recorded states are projected to this share of rtol times the mechanism's size, and at least to rounding
RECORD_SHARE, ROUNDING = 1e-3, 1e-14


@dataclass(frozen=True)
class Engine:
    """One per run: the work space w, the integers n and the wiring h with the rows solved for are not shared.

    kept: per closure row, whether it is solved for.  mobility: counts at the start.
    """

    model: Model
    entry: functions.Entry
    method: Method
    h: np.ndarray
    kept: np.ndarray
    mobility: Mobility
    w: np.ndarray
    n: np.ndarray
    start: float
    end: float
    rtol: float

    @property
    def breaks(self) -> np.ndarray:
        """Start, breaks of drives and loads in between, end; breaks that only rounding sets apart are one."""
        starts, found = self.model.arrays.table(m.PIECES)["start"], set()
        for first, count in self.model.arrays.table(m.LAWS):
            found |= {float(t) for t in starts[first + 1 : first + count]}
        shortest = SHORTEST_SEGMENT * (self.end - self.start)
        times = [self.start]
        for t in sorted(found):
            if t - times[-1] > shortest and self.end - t > shortest:
                times.append(t)
        return np.array([*times, self.end])

    def select_pieces(self, inside: float) -> None:
        """Put the pieces of the laws in force that hold at `inside`, which is no break."""
        first = self.n[m.ACTIVE]
        self.n[first : first + self.model.arrays.size(m.N_LAWS)] = pieces_at(self.model, inside)

    def select_pieces_after(self, t: float) -> None:
        """Put the pieces in force that hold right after `t`; an earlier run leaves those of its end."""
        k = int(np.clip(np.searchsorted(self.breaks, t, side="right"), 1, len(self.breaks) - 1))
        self.select_pieces(0.5 * (self.breaks[k - 1] + self.breaks[k]))

    def keep(self, rows: np.ndarray) -> None:
        """Solve for these closure rows from now on; the others must follow from them."""
        self.kept[:] = rows
        selection.write(self.model, self.h, self.kept)
        self.view(m.ROW_SCALE, len(rows))[:] = 0.0

    def view(self, place: int, length: int) -> np.ndarray:
        """A stretch of the work space, not copied."""
        o = self.h[place]
        return self.w[o : o + length]

    def table(self, table: Any, count: int) -> np.ndarray:
        """Rows of a table of the work space with named fields, not copied, shape (count,)."""
        return m.named(table, self.view(table.place, table.size * count))

    @property
    def control(self) -> np.void:
        """The stepper's floats with named fields, not copied."""
        return self.table(m.CONTROL, 1)[0]

    def evaluate(self, y: np.ndarray, t: float, repeat: int = 1) -> np.ndarray:
        """f(t, y) with the contacts' present modes; SolverError where the equations are singular."""
        if not self.attempt(y, t, repeat):
            raise SolverError(f"at t = {t:.6g} s: the equations are singular in this pose: {singular.diagnosis(self)}")
        return self.view(m.SLOPES, len(y)).copy()

    def attempt(self, y: np.ndarray, t: float, repeat: int = 1) -> bool:
        """Evaluate f(t, y) in the work space; whether it could be."""
        self.view(m.Y, len(y))[:] = y
        self.entry.evaluate(self.h, self.model.arrays.f, self.w, self.n, t, repeat)
        return bool(self.n[m.EVALUATION] == m.OK)

    def mass_factor(self) -> np.ndarray:
        """L of the mass matrix M = L L^T that the last evaluation left in its envelope, shape (nv, nv)."""
        arrays, nv = self.model.arrays, self.model.numbering.nv
        L, entries = np.zeros((nv, nv)), self.view(m.MASS, arrays.size(m.MASS_SIZE))
        for i, (first, start) in enumerate(arrays.table(m.ENVELOPE)):
            L[i, first : i + 1] = entries[start : start + i + 1 - first]
        return L

    def rows(self, stored: int) -> np.ndarray:
        """JACOBIAN or SPREAD of the last evaluation, shape (kept rows, free coordinates)."""
        size = self.model.arrays.size(m.JACOBIAN_SIZE)
        return selection.dense(self.model, self.h, self.view(stored, size))


def pieces_at(model: Model, inside: float) -> np.ndarray:
    """Piece of every law that holds at a time which is no break."""
    starts, found = model.arrays.table(m.PIECES)["start"], []
    for first, count in model.arrays.table(m.LAWS):
        found.append(first + max(int(np.searchsorted(starts[first : first + count], inside, side="right")) - 1, 0))
    return np.array(found, dtype=np.int64)


def prepare(model: Model, progress: Progress) -> Engine:
    """The engine of a system, its kernels compiled or fetched from disk."""
    scene, mobility = model.scene, analyse(model)
    progress(None, mobility.text())
    if mobility.singular_start and not may_depart(model):
        raise SolverError(mobility.singular_start)
    scheme = scheme_of(scene.solver)
    entry = functions.entry(model.parts, scheme, lambda text: progress(None, text))
    method = lookup(INTEGRATORS, scene.solver.integrator, where="[solver.integrator]")
    h, w, n = model.arrays.work_space(method.room)
    kept = np.ones(model.arrays.size(m.N_CLOSURE_ROWS), dtype=bool)
    entry.connect(h)
    end, rtol = scene.time.end, scene.solver.rtol
    engine = Engine(model, entry, method, h, kept, mobility, w, n, scene.time.start, end, rtol)
    engine.control["length"] = model.mechanism.length
    return engine


def consistent_start(engine: Engine) -> tuple[np.ndarray, float]:
    """State at the start with its loops closed, and the joints' largest residual as the scene gives them [m]."""
    model = engine.model
    engine.select_pieces_after(engine.start)
    y = initial.start_state(model)
    singular.select_rows(engine, y, engine.start)
    if not engine.mobility.singular_start:
        y = _closed(engine, y)
    links, rows = model.arrays.size(m.N_LINKS), model.arrays.size(m.N_CLOSURE_ROWS)

    def motion(state_vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _look(engine, state_vector)
        frames = engine.view(m.LINK_FRAMES.place, m.FRAME.size * links).reshape(links, m.FRAME.size)
        return frames, engine.view(m.RESIDUAL_RATE, rows).copy()

    y = initial.given_velocities(model, motion, y)
    if not engine.mobility.singular_start:
        y = project(engine, y)
    if model.parts.loads:
        y = _start_loads(engine, y)
    _refuse_penetration(engine, y)
    return y, model.mechanism.start_residual


def _closed(engine: Engine, y: np.ndarray) -> np.ndarray:
    """`project` of a start that only the engine can close: with paths, or with flexible bodies."""
    try:
        return project(engine, y)
    except SolverError as error:
        paths = [name for name, drive in engine.model.scene.drive.items() if hasattr(drive, "frame")]
        place = f"[drive.{paths[0]}]" if paths else "[joint]"
        what = "correct where the path starts, or the poses" if paths else "correct lengths, frames or poses"
        raise InputError(place, f"the mechanism cannot be assembled: {error}", what) from None


def _look(engine: Engine, y: np.ndarray) -> None:
    """Evaluate at the start what does not take accelerations, which a singular pose does not have."""
    if engine.mobility.singular_start:
        engine.attempt(y, engine.start)
    else:
        engine.evaluate(y, engine.start)


def may_depart(model: Model) -> bool:
    """Whether a run may start in a singular pose: bodies are given velocities, and no contact may interfere."""
    bodies = model.scene.body.values()
    given = [v for b in bodies for v in (getattr(b, "velocity", None), getattr(b, "angular_velocity", None))]
    return not model.mechanism.contacts and any(v is not None and np.any(np.asarray(v) != 0.0) for v in given)


def _start_loads(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Y with the angles that loads follow as they are at the start; InputError for a spring without direction."""
    _look(engine, y)
    loads = engine.table(m.LOAD, engine.model.arrays.size(m.N_LOADS))
    return initial.start_loads(engine.model, y, loads.copy())


def project(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Y at the start with the loops closed and their rates zero; SolverError when that fails."""
    contacts = engine.model.arrays.size(m.N_CONTACTS)
    row = np.concatenate([[engine.start], np.zeros(2 * contacts), y])
    seen = observe(engine, row[None, :])
    if seen["status"][0, 0] != m.OK:
        raise SolverError(
            f"at t = {engine.start:.6g} s: the loops cannot be closed from the start that the scene gives"
        )
    return seen["state"][0].copy()


def overlapping(engine: Engine, y: np.ndarray) -> dict[int, float]:
    """Contacts whose surfaces overlap at the start, by number, and how deep [m]."""
    contacts = engine.model.mechanism.contacts
    if not contacts:
        return {}
    engine.evaluate(y, engine.start)
    gaps = engine.table(m.TOUCH, len(contacts))["gap"]
    return {c: -float(gaps[c]) for c, (_, joint, _, _) in enumerate(contacts) if gaps[c] < -1e-9 * joint.clearance}


def _refuse_penetration(engine: Engine, y: np.ndarray) -> None:
    for c, depth in overlapping(engine, y).items():
        name, joint, _, _ = engine.model.mechanism.contacts[c]
        if joint.initial_approach_speed is None:
            raise InputError(
                f"[joint.{name}]",
                f"its surfaces start {depth:.3g} m deep in each other (clearance {joint.clearance:.3g} m)",
                "move a body, enlarge the clearance, or declare the speed at which this contact began as "
                "initial_approach_speed",
            )


def observe(engine: Engine, rows: np.ndarray, *, after: bool = False) -> dict[str, np.ndarray]:
    """What is recorded of rows (time, modes, impact rates, state), whose states are projected first.

    On a break the laws hold as before it, or as after it.
    Fields and widths: `pipeline.dynamics.equations.observation`; shape (rows, width) each.
    """
    model = engine.model
    arrays, segments = model.arrays, engine.breaks
    sides = np.clip(np.searchsorted(segments, rows[:, 0], side="right" if after else "left"), 1, len(segments) - 1)
    middles = 0.5 * (segments[sides - 1] + segments[sides])
    per_segment = {x: pieces_at(model, x) for x in set(middles.tolist())}
    pieces = np.array([per_segment[x] for x in middles.tolist()], dtype=np.int64).reshape(
        len(rows), arrays.size(m.N_LAWS)
    )
    widths = observing.widths(arrays.size)
    out = np.zeros((len(rows), sum(widths.values())))
    tolerance = max(RECORD_SHARE * engine.rtol, ROUNDING) * model.mechanism.length
    engine.entry.observe(engine.h, arrays.f, engine.w, engine.n, np.ascontiguousarray(rows), pieces, tolerance, out)
    ends = np.cumsum(list(widths.values()))
    return {name: out[:, end - widths[name] : end] for name, end in zip(widths, ends, strict=True)}
