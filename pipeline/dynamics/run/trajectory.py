"""From a consistent start to the end, in segments between drive breaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import SolverError
from pipeline.dynamics import memory as m
from pipeline.dynamics.run import refusal, singular
from pipeline.dynamics.run.engine import Engine, Progress, overlapping
from pipeline.dynamics.run.handover import Handover, StiffError, hand_over, take_over
from pipeline.dynamics.run.singular_start import depart

#: evaluations between two looks at the clock and the keyboard
SLICE = 20_000
#: events for which there is room at first
EVENT_ROWS = 4096
#: why the stepper stops that another choice of closure rows may mend
STALLED = (m.STEP_TOO_SMALL, m.NO_START, m.LOST_CLOSURE)
#: an explicit method is given up when it is stiff after so many evaluations and would need so many in all
TRIAL, HOPELESS = 400_000, 10_000_000


Stop = Callable[[np.ndarray], bool]


def never(rows: np.ndarray) -> bool:
    """A run goes to its end."""
    return False


@dataclass(frozen=True)
class Trajectory:
    """What the stepper left. rows: time, modes, impact rates, state; events: columns of `state`, by time.

    selections: closure rows solved for, each from a time on.
    drift, rate_drift: largest violation of a closure that a projection met [m or -], and of its rate [1/s of it].
    steepest: largest rate [1/s] of the equations that a step met, as the method estimates it.
    """

    rows: np.ndarray
    events: np.ndarray
    counters: dict[str, int]
    selections: tuple[tuple[float, np.ndarray], ...]
    drift: float = 0.0
    rate_drift: float = 0.0
    steepest: float = 0.0

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s], strictly increasing."""
        return self.rows[:, 0]

    def parts(self) -> list[tuple[slice, np.ndarray]]:
        """Stretches of rows, each with the closure rows that were solved for to reach them."""
        starts = [start for start, _ in self.selections]
        firsts = np.searchsorted(self.time, starts, side="right")
        firsts[0] = 0
        ends = [*firsts[1:], len(self.rows)]
        return [(slice(a, b), kept) for a, b, (_, kept) in zip(firsts, ends, self.selections, strict=True)]

    def selection(self, row: int) -> np.ndarray:
        """Closure rows that were solved for to reach a row."""
        return next(kept for part, kept in self.parts() if part.start <= row < part.stop)


@dataclass
class _Run:
    """The arrays of one integration; the record may be replaced by a larger one."""

    w: np.ndarray
    n: np.ndarray
    outputs: np.ndarray
    rows: np.ndarray
    events: np.ndarray
    selections: list[tuple[float, np.ndarray]]


def output_times(breaks: np.ndarray, interval: float) -> np.ndarray:
    """Regular output times and all breaks, increasing; times nearer than rounding are one."""
    span = breaks[-1] - breaks[0]
    regular = breaks[0] + interval * np.arange(int(np.floor(span / interval * (1 + 1e-12))) + 1)
    after = np.clip(np.searchsorted(breaks, regular), 1, len(breaks) - 1)
    apart = np.minimum(np.abs(regular - breaks[after - 1]), np.abs(regular - breaks[after])) > 1e-9 * interval
    return np.union1d(regular[apart], breaks)


def integrate(
    engine: Engine, y: np.ndarray, progress: Progress, stop: Stop = never, left: Handover | None = None
) -> Trajectory:
    """The trajectory from a consistent start; SolverError when the stepper gives up.

    stop: asked now and then with the rows recorded so far, whether they are enough.
    left: what another method left of this run; it is gone on with from there.
    """
    run = _begin(engine, y) if left is None else _resume(engine, left)
    if left is None and engine.mobility.singular_start:
        _depart(engine, run)
    control = engine.control
    for a, b in zip(engine.breaks[:-1], engine.breaks[1:], strict=True):
        if b <= control["time"]:
            continue
        engine.select_pieces(0.5 * (a + b))
        control["end"], run.n[m.FRESH] = b, 1
        if _segment(engine, run, progress, stop):
            break
    return _collect(run, control)


def _begin(engine: Engine, y: np.ndarray) -> _Run:
    run = _prepare(engine, y, engine.start)
    run.rows[0, 0], run.rows[0, 1 + 2 * engine.model.arrays.size(m.N_CONTACTS) :] = engine.start, y
    run.n[m.N_RECORDED], run.n[m.NEXT_OUTPUT] = 1, 1
    _begin_closed(engine, y, run.rows[0], run.events)
    return run


def _resume(engine: Engine, left: Handover) -> _Run:
    run = _prepare(engine, left.y, left.time)
    take_over(engine, left)
    run.rows, run.events = np.concatenate([left.rows, run.rows]), np.concatenate([left.events, run.events])
    same = np.array_equal(left.selections[-1][1], engine.kept)
    run.selections = [*left.selections, *([] if same else run.selections)]
    return run


def _prepare(engine: Engine, y: np.ndarray, t: float) -> _Run:
    """Work space and record of an integration from state y at time t, nothing recorded yet."""
    model, n = engine.model, engine.n
    scene, contacts = model.scene, model.arrays.size(m.N_CONTACTS)
    control = engine.control
    engine.select_pieces_after(t)
    engine.view(m.CONTROL.place, m.CONTROL.size)[:] = 0.0
    control["time"], control["span"] = t, engine.end - engine.start
    control["rtol"], control["length"] = engine.rtol, model.mechanism.length
    control["fixed"], control["parameter"] = scene.solver.step or 0.0, engine.method.parameter(scene.solver)
    n[m.STATUS : m.INTEGERS] = 0
    n[n[m.MODE] :] = 0
    n[m.CAP] = scene.solver.evaluations
    engine.view(m.Y, len(y))[:] = y
    engine.view(m.LATCHED, contacts)[:] = 0.0
    outputs = output_times(engine.breaks, scene.output.interval)
    room = EVENT_ROWS if contacts else m.ROOM
    rows = np.zeros((len(outputs) + room + m.ROOM, 1 + 2 * contacts + len(y)))
    ratio = singular.select_rows(engine, y, t)
    engine.view(m.Y, len(y))[:] = y
    engine.view(m.PIVOT, m.PIVOT_SIZE)[:] = 1.0, singular.WORN * ratio if engine.mobility.redundant else 0.0
    events = np.full((room + m.ROOM, m.EVENT.size), np.nan)
    return _Run(engine.w, n, outputs, rows, events, [(t, engine.kept.copy())])


def _depart(engine: Engine, run: _Run) -> None:
    """Lay the way out of a singular start, and choose the closure rows at its end."""
    n, control, first = run.n, engine.control, 1
    way = depart(engine, run.rows[0, first:])
    passed = run.outputs[(run.outputs > engine.start) & (run.outputs < engine.start + way.span)]
    times = np.concatenate([[engine.start], passed, [engine.start + way.span]])
    run.rows[: len(times), 0] = times
    run.rows[: len(times), first:] = np.vstack([way.y0, way.states(passed - engine.start), way.y])
    n[m.N_RECORDED], n[m.NEXT_OUTPUT] = len(times), 1 + len(passed)
    n[m.EVALUATIONS] += way.evaluations
    control["time"] = times[-1]
    ratio = singular.select_rows(engine, way.y, float(times[-1]))
    engine.view(m.Y, len(way.y))[:] = way.y
    engine.view(m.PIVOT, m.PIVOT_SIZE)[:] = 1.0, singular.WORN * ratio if engine.mobility.redundant else 0.0
    run.selections[:] = [(engine.start, engine.kept.copy())]


def _begin_closed(engine: Engine, y: np.ndarray, row: np.ndarray, events: np.ndarray) -> None:
    """Contacts that the start already has begin there, at the approach speeds that the scene declares."""
    contacts = engine.model.mechanism.contacts
    if not contacts:
        return
    n, count = engine.n, len(contacts)
    modes, latched = n[n[m.MODE] : n[m.MODE] + count], engine.view(m.LATCHED, count)
    watched = engine.table(m.WATCH, count)
    engine.view(m.WATCH.place, m.WATCH.size * count)[:] = 0.0
    for c in overlapping(engine, y):
        speed = contacts[c][1].initial_approach_speed
        if speed is None:
            continue  # a start that differs by a hair from one that touches: it closes at once
        modes[c], latched[c] = 1, speed
        event = events[n[m.N_EVENTS]]
        event[[m.EVENT.time, m.EVENT.contact, m.EVENT.kind]] = engine.start, c, m.CLOSING
        event[[m.EVENT.speed, m.EVENT.peak_force, m.EVENT.peak_depth]] = speed, 0.0, 0.0
        watched["event_row"][c], watched["trend0"][c] = n[m.N_EVENTS], m.STEEPLY
        n[m.N_EVENTS] += 1
    row[1 : 1 + count], row[1 + count : 1 + 2 * count] = modes, latched


def _segment(engine: Engine, run: _Run, progress: Progress, stop: Stop) -> bool:
    """To the end of the segment; True when it was stopped before."""
    arrays, n = engine.model.arrays, run.n
    control = engine.control
    while True:
        n[m.BUDGET] = n[m.EVALUATIONS] + SLICE
        engine.entry.advance(engine.h, arrays.f, run.w, n, run.outputs, run.rows, run.events)
        t = control["time"]
        progress((t - engine.start) / control["span"], f"t = {t:.5f} s, {n[m.EVALUATIONS]} evaluations")
        status = n[m.STATUS]
        if status == m.SEGMENT_END:
            return False
        if status == m.FULL:
            run.rows = np.concatenate([run.rows, np.zeros_like(run.rows)])
            run.events = np.concatenate([run.events, np.full_like(run.events, np.nan)])
        elif status == m.WORN_ROWS or (status in STALLED and engine.mobility.redundant):
            if singular.improve(engine, float(t)):
                run.selections.append((float(t), engine.kept.copy()))
            elif status != m.WORN_ROWS:
                raise SolverError(refusal.text(engine))
        elif status != m.PAUSED:
            raise SolverError(refusal.text(engine))
        elif _crawls(engine, run):
            left = hand_over(engine, run.rows, run.events, run.selections)
            raise StiffError(f"at t = {t:.6g} s: {refusal.stiffness(n, control)}", left)
        elif stop(run.rows[: n[m.N_RECORDED]]):
            return True


def _crawls(engine: Engine, run: _Run) -> bool:
    """Whether stability limits the steps so much that the run would take far too long."""
    n, control = run.n, engine.control
    if not engine.method.traits.hands_over_to or control["fixed"] or n[m.EVALUATIONS] < TRIAL:
        return False
    done = max((control["time"] - engine.start) / control["span"], 1e-12)
    too_many = min(HOPELESS, n[m.CAP])
    return bool(n[m.STIFF_STEPS] > refusal.STIFF_SHARE * n[m.STEPS] and n[m.EVALUATIONS] / done > too_many)


def _collect(run: _Run, control: np.void) -> Trajectory:
    n = run.n
    rows = run.rows[: n[m.N_RECORDED]]
    keep = np.append(np.diff(rows[:, 0]) > 0.0, True)  # an event on an output time is one row, the later
    counters = {
        "evaluations": int(n[m.EVALUATIONS]),
        "steps": int(n[m.STEPS]),
        "rejected_steps": int(n[m.REJECTED]),
        "projections": int(n[m.PROJECTIONS]),
        "stiff_steps": int(n[m.STIFF_STEPS]),
        "projection_evaluations": int(n[m.PROJECTION_EVALUATIONS]),
        "jacobians": int(n[m.JACOBIANS]),
    }
    events = run.events[: n[m.N_EVENTS]]
    # what happens inside a step is noted when the step is done: one contact after the other
    in_order = events[np.argsort(events[:, m.EVENT.time], kind="stable")]
    drift, rate_drift, steepest = (float(control[name]) for name in ("drift", "rate_drift", "steepest"))
    return Trajectory(rows[keep], in_order, counters, tuple(run.selections), drift, rate_drift, steepest)
