"""The engine: a model with compiled functions and a work array; evaluation, closure rows, pieces of laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions
from flexclear.dynamics.effects import scheme_of
from flexclear.dynamics.equations.prescribed_motion import SHORTEST
from flexclear.dynamics.integrate import METHODS
from flexclear.dynamics.integrate.method import Method
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.driving import coordinate_of
from flexclear.dynamics.model.initial import given_rates
from flexclear.dynamics.model.mobility import Mobility, analyse, moves
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.plausibility import start_errors
from flexclear.dynamics.run import bushings, joint_friction
from flexclear.dynamics.run.evaluation import table_ranges
from flexclear.dynamics.run.evaluation.specialised_code import (
    SpecialisedCode,
    address_for_rows,
    call_list,
    code_address,
)
from flexclear.dynamics.run.evaluation.without_compiler import IN_PYTHON, Uncompiled
from flexclear.scene.loads import SampledPid
from flexclear.system.errors import InputError, SolverError, refuse
from flexclear.system.progress import Progress, silent

#: of effects: why a run stopped, in words
EXPLANATIONS = {"bushings": bushings.explanation, "joint_friction": joint_friction.explanation}
#: first selections of closure rows of an integration, whose steps are specialised; those of others run lists
SELECTIONS = 4
#: evaluations after which specialised code pays: it takes LLVM a second and saves up to a fifth of an evaluation
LONG = 100_000


@dataclass(frozen=True)
class Engine:
    """An engine; each run has its own, since the work array is not shared.

    h: topology with the selected rows.  w, n: floats and integers of the work array.  lengths: of the sections of w.
    selected: per closure row, whether it is solved for.  mobility: counts at the start.  start, end: of the run [s].
    specialised: specialised code for this topology.
    """

    model: Model
    entry: functions.Entry
    method: Method
    h: np.ndarray
    w: np.ndarray
    n: np.ndarray
    lengths: Mapping[int, int]
    selected: np.ndarray
    mobility: Mobility
    start: float
    end: float
    specialised: SpecialisedCode

    @cached_property
    def breaks(self) -> np.ndarray:
        """Return start, jumps of laws, samples, end [s]; times that differ only by rounding are merged."""
        starts = self.model.arrays.table(m.PIECES)["start"]
        inner = {float(t) for begun in self._begun for t in starts[begun[1:]]}
        for period in {load.period for load in self.model.scene.load.values() if isinstance(load, SampledPid)}:
            inner |= set((self.start + period * np.arange(1, np.ceil((self.end - self.start) / period))).tolist())
        shortest = SHORTEST * (self.end - self.start)
        times = [self.start]
        for t in sorted(inner):
            if t - times[-1] > shortest and self.end - t > shortest:
                times.append(t)
        return np.array([*times, self.end])

    @property
    def _begun(self) -> list[np.ndarray]:
        """First piece of each law and those where value, rate or second rate jump."""
        last = self.model.arrays.table(m.PIECE_HARMONICS)["last"]
        return [
            np.unique([first, *(1 + last[first : first + count])])[:-1]
            for first, count in self.model.arrays.table(m.LAWS)
        ]

    @cached_property
    def pieces(self) -> np.ndarray:
        """Piece with which every law goes on between each break and the next, shape (breaks - 1, laws)."""
        starts, middles = self.model.arrays.table(m.PIECES)["start"], 0.5 * (self.breaks[:-1] + self.breaks[1:])
        passed = [begun[np.searchsorted(starts[begun[1:]], middles, side="right")] for begun in self._begun]
        return np.array(passed, dtype=int).reshape(len(passed), len(middles)).T

    def piece(self, law: int, t: float) -> int:
        """Return the piece of a law that holds right after `t`."""
        first, count = self.model.arrays.table(m.LAWS)[law]
        passed = np.searchsorted(self.model.arrays.table(m.PIECES)["start"][first : first + count], t, side="right")
        return int(first + max(passed - 1, 0))

    def segments(self, times: np.ndarray | float, *, after: bool) -> np.ndarray:
        """Return the segment that contains each time; on a break, the one before it, or the one `after` it."""
        index = np.searchsorted(self.breaks, times, side="right" if after else "left") - 1
        return np.asarray(np.minimum(np.maximum(index, 0), len(self.breaks) - 2))

    def output_times(self, interval: float, origin: float | None = None) -> np.ndarray:
        """Return regular output times and all breaks [s], increasing; times that differ only by rounding are merged.

        origin: from which the regular ones are counted [s]; the first break by default.
        """
        breaks, origin = self.breaks, self.breaks[0] if origin is None else origin
        first, last = (np.ceil((breaks[0] - origin) / interval), (breaks[-1] - origin) / interval * (1 + 1e-12))
        regular = origin + interval * np.arange(int(first), int(np.floor(last)) + 1)
        after = np.clip(np.searchsorted(breaks, regular), 1, len(breaks) - 1)
        distinct = np.minimum(np.abs(regular - breaks[after - 1]), np.abs(regular - breaks[after])) > 1e-9 * interval
        return np.union1d(regular[distinct], breaks)

    def select_pieces_after(self, t: float) -> None:
        """Select the pieces of laws that hold right after `t`, since an earlier run leaves those of its end."""
        first = self.n[m.ACTIVE]
        self.n[first : first + self.model.arrays.size(m.N_LAWS)] = self.pieces[self.segments(t, after=True)]

    def keep(self, rows: np.ndarray) -> None:
        """Select these closure rows; the others must follow from them."""
        if not np.array_equal(self.selected, rows):
            self.selected[:] = rows
            selection.write(self.model, self.h, self.selected)
        self.view(m.ROW_SCALE)[: len(rows)] = 0.0
        self.h[m.EVALUATE] = 0

    def connect(self, progress: Progress = silent) -> None:
        """Connect functions for the selected rows: lists of calls, and for steps specialised code where it exists."""
        if not self.entry.compiled:
            return self.entry.connect(self.h)
        rows, known = self.selected.tobytes(), self.specialised
        for where, at in self._lists.items():
            calls = call_list(self.model, self.h, known, rows, progress, where)
            self.h[at], self.h[where] = calls.loaded.interpreter, calls.words.ctypes.data
        self.h[m.RATES], met = self.h[m.EVALUATE], rows in known.rows
        if met and not (self._specialises(rows) and address_for_rows(self.model, self.h, known, rows, progress)):
            calls = call_list(self.model, self.h, known, rows, progress)
            self.h[m.RATES], self.h[m.CALLS] = calls.loaded.interpreter, calls.words.ctypes.data
        elif met:
            self.h[m.RATES] = known.addresses[rows]
        self.n[m.TOGETHER] = bool(met and known.group and known.group.rows == rows)

    def _specialises(self, rows: bytes) -> bool:
        """Return True when steps for closure rows that the integration has met use specialised code, if that exists."""
        known = self.specialised
        worthwhile = (known.exact or known.worthwhile) and known.rows.index(rows) < SELECTIONS
        return bool(worthwhile or self.h[m.N_CHANGES])

    @property
    def _lists(self) -> dict[int, int]:
        """Lists that compiled functions run besides the steps': their places in h, and those of their interpreters."""
        size, method = self.model.arrays.size, self.method
        used = {m.CLOSE: size(m.N_CLOSURES), m.MOVE: method.traits.retracts, m.SPRINGS: method.room.oscillations}
        return {m.RECORD_CALLS: m.EVALUATE, **{where: m.RUN for where, needed in used.items() if needed}}

    @property
    def staged(self) -> bool:
        """True when the engine can step together with others."""
        return bool(self.method.staged and self.entry.compiled)

    def settle(self, progress: Progress) -> None:
        """Let further steps use specialised code or routines for the selected rows, at a place together with others.

        The selections that the integration has met, and the number of its evaluations, decide; so an interrupted
        integration continues with the same code as an uninterrupted one.
        """
        specialised, rows = self.specialised, self.selected.tobytes()
        specialised.worthwhile |= bool(self.n[m.EVALUATIONS] >= LONG)
        if specialised.place is not None and specialised.group is None and self.staged:
            where = code_address(
                self.model, self.h, rows, progress, lanes=specialised.place.width, exact=specialised.exact
            )
            specialised.group = specialised.place.group(rows, where, len(self.model.arrays.f)) if where else None
        if rows not in specialised.rows:
            specialised.rows.append(rows)
        self.connect(progress)

    def observe(self, rows: np.ndarray, pieces: np.ndarray, tolerance: float, out: np.ndarray) -> None:
        """Evaluate the outputs of every row, in this thread."""
        rows, pieces = (np.ascontiguousarray(array) for array in (rows, pieces))
        self.entry.observe(self._arrays(), rows, pieces, tolerance, out)

    def advance(self, outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> None:
        """Step to the end of the segment or of the budget, in this thread or in the engine's group."""
        group, record = self.specialised.group, (outputs, rows, events)
        if group is not None and self.n[m.TOGETHER]:  # one word per argument except t and repeat
            words = [*functions.addresses_of_arrays(self._arrays()), *functions.record(*record)]
            group.advance(self.entry.addresses["advance"], words)
        else:
            self.entry.advance(self._arrays(), *record)

    def evaluate(self, t: float, repeat: int = 1) -> None:
        """Store the rate of the state in Y at time t in the first row of SLOPES; repeat: number of evaluations."""
        self.entry.evaluate(self._arrays(), t, repeat)

    def evaluate_laws(self, t: float) -> None:
        """Store the values and rates of all laws at time t."""
        self.entry.evaluate_laws(self._arrays(), t)

    def _arrays(self) -> functions.Arrays:
        """Return h, f, w and n, with the functions connected that others call."""
        if not self.h[m.EVALUATE]:
            self.connect()
        return self.h, self.model.arrays.f, self.w, self.n

    def view(self, index: int) -> np.ndarray:
        """Return a section of the work array, not copied."""
        o = self.h[index]
        return self.w[o : o + self.lengths[index]]

    def table(self, table: Any) -> np.ndarray:
        """Return a table of the work array with named fields, not copied, shape (rows,)."""
        return m.named(table, self.view(table.at))

    @property
    def control(self) -> np.ndarray:
        """Control floats of the stepper, not copied; m.TIME is the index of the time."""
        return self.view(m.CONTROL)

    def reset(self) -> None:
        """Set the control floats to those of no step, with the tolerance and the size of the mechanism."""
        self.control[:] = 0.0
        self.control[m.RTOL], self.control[m.LENGTH] = self.model.scene.solver.rtol, self.model.length

    @property
    def rtol(self) -> float:
        """Relative tolerance."""
        return float(self.control[m.RTOL])

    @property
    def slope(self) -> np.ndarray:
        """Rates of the state from the last evaluation, not copied."""
        return self.view(m.SLOPES)[: self.model.ny]

    @property
    def magnitudes(self) -> np.ndarray:
        """Typical magnitude of each variable of the state, shape (NY,)."""
        arrays = self.model.arrays
        return np.asarray(arrays.table(m.FLOORS)["magnitude"][arrays.table(m.GROUPS)["group"]])

    @property
    def modes(self) -> np.ndarray:
        """Modes of the contacts, 1 closed and 0 open, not copied."""
        return self.n[self.n[m.MODE] :]

    @property
    def latched(self) -> np.ndarray:
        """Impact rates of the contacts [m/s], not copied."""
        return self.view(m.LATCHED)

    def explained(self) -> str | None:
        """Reason for which an effect, or a table, ends the run; None when none does."""
        explains = [table_ranges.explanation, *self.model.parts.functions(EXPLANATIONS)]
        reasons = (explain(self) for explain in explains)
        return next((why for why in reasons if why is not None), None)

    def attempt(self, y: np.ndarray, t: float, repeat: int = 1) -> bool:
        """Evaluate f(t, y) in the work array; return True on success."""
        self.view(m.Y)[:] = y
        self.evaluate(t, repeat)
        return bool(self.n[m.EVALUATION] == m.OK)

    def complete(self) -> None:
        """Evaluate the state at the end of the last step again, unless the work array has all intermediate results."""
        if self.n[m.ABRIDGED]:
            self.evaluate(float(self.control[m.TIME]))

    def independence(self) -> np.ndarray:
        """Return the independence of each selected closure row from those before it, at the state evaluated last."""
        return 1.0 / np.abs(self.view(m.ROOTS)[: self.h[m.N_KEPT_ROWS]])

    @property
    def jacobian(self) -> np.ndarray:
        """Jacobian of the closures at the state evaluated last, shape (selected rows, free coordinates)."""
        return selection.dense_rows(self.model, self.h, self.view(m.JACOBIAN))


def prepare(model: Model, progress: Progress) -> Engine:
    """Return the engine of a model, its kernels compiled or loaded unless Python evaluates them (`IN_PYTHON`).

    Raises SolverError for an impossible start.
    """
    refuse(start_errors(model.mechanism, final=False))
    solver, mobility = model.scene.solver, analyse(model)
    progress(None, mobility.text())
    refuse_singular(model, mobility)
    if IN_PYTHON.get():
        return engine_in_python(model, mobility)
    entry = functions.entry(model.parts, scheme_of(solver), lambda text: progress(None, text))
    engine = assemble(model, entry, METHODS[solver.integrator], mobility)
    if not mobility.redundant:
        engine.connect(progress)
    return engine


def engine_in_python(model: Model, mobility: Mobility) -> Engine:
    """Return the engine of a model that Python evaluates."""
    return assemble(model, Uncompiled.of(model), METHODS[model.scene.solver.integrator], mobility)


def assemble(model: Model, entry: functions.Entry, method: Method, mobility: Mobility) -> Engine:
    """Return an engine with a new work array for a model whose functions are compiled."""
    space = model.arrays.work_space(method.room)
    entry.connect(space.h)
    selected, time = np.ones(model.arrays.size(m.N_CLOSURE_ROWS), dtype=bool), model.scene.time
    engine = Engine(model, entry, method, *space, selected, mobility, time.start, time.end, SpecialisedCode())
    engine.reset()
    return engine


def copy_of_engine(engine: Engine) -> Engine:
    """Return a new engine of the same model, in the state before any run."""
    made = assemble(engine.model, engine.entry, engine.method, engine.mobility)
    made.specialised.exact = engine.specialised.exact
    made.specialised.addresses = engine.specialised.addresses.copy()
    made.specialised.lists = engine.specialised.lists.copy()
    return made


def may_start_singular(model: Model) -> bool:
    """Return True when a run may start in a singular pose: the branch is determined, and no contact interferes."""
    bodies = model.scene.body.values()
    given = [v for b in bodies for v in (getattr(b, "velocity", None), getattr(b, "angular_velocity", None))]
    moved = any(v is not None and np.any(np.asarray(v) != 0.0) for v in given) or bool(given_rates(model))
    moved = moved or (model.scene.start is not None and bool(model.scene.start.branch))
    return not model.contacts and (moved or any(moves(model, name) for name in model.drives))


def refuse_singular(model: Model, mobility: Mobility) -> None:
    """Raise SolverError for a start whose branch is not determined, and InputError when `[start] branch` is given
    without a choice, or names an unknown coordinate."""
    if mobility.singular_start and not may_start_singular(model):
        raise SolverError(mobility.start_refusal)
    if model.scene.start is None or not model.scene.start.branch:
        return
    for choice in model.scene.start.branch:
        coordinate_of(model.scene, choice.joint, choice.coordinate, "[start.branch]")
    if not mobility.singular_start:
        raise InputError(
            "[start.branch]", "the mechanism does not start in a change point and has no branches", "remove it"
        )
