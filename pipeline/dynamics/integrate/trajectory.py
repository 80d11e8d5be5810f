"""From a consistent start to the end, in segments between drive breaks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import SolverError
from pipeline.dynamics.integrate import state
from pipeline.dynamics.integrate.engine import Engine, Progress, overlapping
from pipeline.dynamics.tables import MODE

#: evaluations between two looks at the clock and the keyboard
SLICE = 20_000
#: events for which there is room at first
EVENT_ROWS = 4096
#: above this share of steps that stability limits, stiffness is named as the cause of a long run
STIFF_SHARE = 0.3


@dataclass(frozen=True)
class Trajectory:
    """What the stepper left. rows: time, modes, impact rates, state; events: columns of `state`, by time.

    drift, rate_drift: largest violation of a closure that a projection met [m or -], and of its rate [1/s of it].
    steepest: largest rate [1/s] of the equations that a step met, as the method estimates it.
    """

    rows: np.ndarray
    events: np.ndarray
    counters: dict[str, int]
    drift: float = 0.0
    rate_drift: float = 0.0
    steepest: float = 0.0

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s], strictly increasing."""
        return self.rows[:, 0]


@dataclass
class _Run:
    """The arrays of one integration; the record may be replaced by a larger one."""

    w: np.ndarray
    n: np.ndarray
    outputs: np.ndarray
    rows: np.ndarray
    events: np.ndarray


def output_times(breaks: np.ndarray, interval: float) -> np.ndarray:
    """Regular output times and all breaks, increasing; times nearer than rounding are one."""
    span = breaks[-1] - breaks[0]
    regular = breaks[0] + interval * np.arange(int(np.floor(span / interval * (1 + 1e-12))) + 1)
    after = np.clip(np.searchsorted(breaks, regular), 1, len(breaks) - 1)
    apart = np.minimum(np.abs(regular - breaks[after - 1]), np.abs(regular - breaks[after])) > 1e-9 * interval
    return np.union1d(regular[apart], breaks)


def integrate(engine: Engine, y: np.ndarray, progress: Progress) -> Trajectory:
    """The trajectory from a consistent start; SolverError when the stepper gives up."""
    run = _begin(engine, y)
    control = engine.view("CONTROL", state.N_CONTROLS)
    for a, b in zip(engine.breaks[:-1], engine.breaks[1:], strict=True):
        engine.select_pieces(0.5 * (a + b))
        control[state.END], run.n[state.FRESH] = b, 1
        _segment(engine, run, progress)
    return _collect(run, control)


def _begin(engine: Engine, y: np.ndarray) -> _Run:
    built, n = engine.built, engine.n
    scene, contacts = built.system.scene, built.packed.sizes["N_CONTACTS"]
    control = engine.view("CONTROL", state.N_CONTROLS)
    control[:] = 0.0
    control[state.TIME], control[state.SPAN] = engine.start, engine.end - engine.start
    control[state.RTOL], control[state.LENGTH] = engine.rtol, built.system.length
    control[state.FIXED], control[state.PARAMETER] = scene.solver.step or 0.0, built.method.parameter(scene.solver)
    n[state.STATUS : state.INTEGERS] = 0
    n[n[MODE] :] = 0
    n[state.CAP] = scene.solver.evaluations
    engine.view("Y", len(y))[:] = y
    engine.view("LATCHED", contacts)[:] = 0.0
    outputs = output_times(engine.breaks, scene.output.interval)
    room = EVENT_ROWS if contacts else state.ROOM
    rows = np.zeros((len(outputs) + room + state.ROOM, 1 + 2 * contacts + len(y)))
    rows[0, 0], rows[0, 1 + 2 * contacts :] = engine.start, y
    n[state.N_RECORDED], n[state.NEXT_OUTPUT] = 1, 1
    events = np.full((room + state.ROOM, state.EVENT_SIZE), np.nan)
    _begin_closed(engine, y, rows[0], events)
    return _Run(engine.w, n, outputs, rows, events)


def _begin_closed(engine: Engine, y: np.ndarray, row: np.ndarray, events: np.ndarray) -> None:
    """Contacts that the start already has begin there, at the approach speeds that the scene declares."""
    contacts = engine.built.system.contacts
    if not contacts:
        return
    n, count = engine.n, len(contacts)
    modes, latched = n[n[MODE] : n[MODE] + count], engine.view("LATCHED", count)
    watched = engine.view("WATCH", state.WATCH_SIZE * count).reshape(count, -1)
    watched[:] = 0.0
    for c in overlapping(engine, y):
        speed = contacts[c][1].initial_approach_speed
        if speed is None:
            continue  # a start that differs by a hair from one that touches: it closes at once
        modes[c], latched[c] = 1, speed
        event = events[n[state.N_EVENTS]]
        event[[state.EVENT_TIME, state.EVENT_CONTACT, state.EVENT_KIND]] = engine.start, c, state.CLOSING
        event[[state.SPEED, state.PEAK_FORCE, state.PEAK_DEPTH]] = speed, 0.0, 0.0
        watched[c, [state.EVENT_ROW, state.TREND0]] = n[state.N_EVENTS], 1.0
        n[state.N_EVENTS] += 1
    row[1 : 1 + count], row[1 + count : 1 + 2 * count] = modes, latched


def _segment(engine: Engine, run: _Run, progress: Progress) -> None:
    packed, n = engine.built.packed, run.n
    control = engine.view("CONTROL", state.N_CONTROLS)
    while True:
        n[state.BUDGET] = n[state.EVALUATIONS] + SLICE
        engine.entry.advance(packed.h, packed.f, run.w, n, run.outputs, run.rows, run.events)
        t = control[state.TIME]
        progress((t - engine.start) / control[state.SPAN], f"t = {t:.5f} s, {n[state.EVALUATIONS]} evaluations")
        status = n[state.STATUS]
        if status == state.SEGMENT_END:
            return
        if status == state.FULL:
            run.rows = np.concatenate([run.rows, np.zeros_like(run.rows)])
            run.events = np.concatenate([run.events, np.full_like(run.events, np.nan)])
        elif status != state.PAUSED:
            raise SolverError(_refusal(engine, run))


def _refusal(engine: Engine, run: _Run) -> str:
    control, n = engine.view("CONTROL", state.N_CONTROLS), run.n
    joints = ", ".join(e.name for e, _, _ in engine.built.system.closures) or "none"
    contacts = [name for name, *_ in engine.built.system.contacts]
    culprit = contacts[n[state.CULPRIT]] if contacts else ""
    reasons = {
        state.CAP_REACHED: f"the limit of {n[state.CAP]} evaluations is used up ([solver.evaluations]); "
        + _why_so_many(n, control),
        state.STEP_TOO_SMALL: f"the step shrank to {control[state.STEP]:.2g} s: the motion is singular here, "
        f"or stiffer than an explicit method can follow (loops closed at joints {joints})",
        state.NO_START: f"the equations are singular here (loops closed at joints {joints})",
        state.NOT_A_NUMBER: "the right-hand side is not a number here: a force or a law overflows or divides by zero"
        + (f", or the fixed step of {control[state.FIXED]:.2g} s is too long for it" if control[state.FIXED] else ""),
        state.NO_CONVERGENCE: f"Newton's iteration fails at the fixed step of {control[state.FIXED]:.2g} s: "
        "take a shorter step, or leave [solver.step] out",
        state.STUCK_EVENT: f"joint {culprit} opens and closes without end at one time",
        state.LOST_CLOSURE: f"the loops at joints {joints} cannot be kept closed: a singular configuration",
    }
    return f"at t = {control[state.TIME]:.6g} s: {reasons[int(n[state.STATUS])]}"


def _why_so_many(n: np.ndarray, control: np.ndarray) -> str:
    """What used the evaluations up."""
    if n[state.STIFF_STEPS] > STIFF_SHARE * max(1, n[state.STEPS]):
        return (
            f"{n[state.STIFF_STEPS]} of {n[state.STEPS]} steps were limited by stability: the equations have rates up "
            f"to {control[state.STEEPEST]:.2g} 1/s, as the slope of friction at small sliding speeds has; "
            "choose an implicit integrator, or a larger v_static"
        )
    return "contacts may be collapsing in time, or the tolerance is too tight"


def _collect(run: _Run, control: np.ndarray) -> Trajectory:
    n = run.n
    rows = run.rows[: n[state.N_RECORDED]]
    keep = np.append(np.diff(rows[:, 0]) > 0.0, True)  # an event on an output time is one row, the later
    counters = {
        "evaluations": int(n[state.EVALUATIONS]),
        "steps": int(n[state.STEPS]),
        "rejected_steps": int(n[state.REJECTED]),
        "projections": int(n[state.PROJECTIONS]),
        "stiff_steps": int(n[state.STIFF_STEPS]),
        "projection_evaluations": int(n[state.PROJECTION_EVALUATIONS]),
        "jacobians": int(n[state.JACOBIANS]),
    }
    events = run.events[: n[state.N_EVENTS]]
    # what happens inside a step is noted when the step is done: one contact after the other
    in_order = events[np.argsort(events[:, state.EVENT_TIME], kind="stable")]
    drift, rate_drift, steepest = (float(control[k]) for k in (state.DRIFT, state.RATE_DRIFT, state.STEEPEST))
    return Trajectory(rows[keep], in_order, counters, drift, rate_drift, steepest)
