"""Integration from a consistent start to the end, in segments between breaks; one method may hand over to another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.integrate.singular_step import NEVER, TOO_LITTLE
from flexclear.dynamics.run.controllers import sampler
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import NO_IMPACT, overlap_depths
from flexclear.dynamics.run.pieces import Handover, Jumps, Moment, Selections, Tape, by_time
from flexclear.dynamics.run.progress_rate import Judge, crawls, observe_progress
from flexclear.dynamics.run.refusals import refusal
from flexclear.dynamics.run.refusals.reach import require_shallow
from flexclear.dynamics.run.singular_poses import beginning, passing
from flexclear.system.errors import SolverError
from flexclear.system.progress import Progress
from flexclear.workflow import stopping

if TYPE_CHECKING:
    from flexclear.dynamics.run.singular_poses.collocation import Collocation
    from flexclear.dynamics.run.singular_poses.passing import Pass

#: of effects: makers of the state after a break of the run from the state before
SAMPLERS = {"controllers": sampler}
#: evaluations between two checks of the clock and of interrupts
SLICE = 20_000
#: initial capacity of the event table
EVENT_ROWS = 4096
#: statuses of the stepper that another selection of closure rows may resolve
STALLED = (m.STEP_TOO_SMALL, m.NO_START, m.LOST_CLOSURE)
#: statuses that a polynomial over a singular pose may resolve
STOPPED = (*STALLED, m.NO_CONVERGENCE, m.AT_SINGULAR)
#: control floats that the next method takes over
LASTING = [m.TIME, m.DRIFT, m.RATE_DRIFT, m.STEEPEST]

Stop = Callable[[np.ndarray], bool]


def never(rows: np.ndarray) -> bool:
    """Return False: the run continues to its end."""
    return False


def stop_requested(rows: np.ndarray) -> bool:
    """Return True on a request to stop: the run ends with its rows so far."""
    return bool(stopping.stop_reason())


@dataclass(frozen=True)
class Trajectory:
    """Result of an integration.

    rows: of the record, and those `between` them (see `integrate.recording`); events: of the event table, by time.
    contacts: number of clearance joints.  selections: selected closure rows, each from a time on.
    drift, rate_drift: largest residual of a closure before projection [m or -], and of its rate [1/s of it].
    steepest: largest rate [1/s] of the equations in any step, as the method estimates it.
    collocations: polynomial motions of the run, over singular poses and out of them.
    passes: the singular poses on them.
    """

    rows: np.ndarray
    between: np.ndarray
    events: np.ndarray
    contacts: int
    counters: dict[str, int]
    selections: Selections
    drift: float = 0.0
    rate_drift: float = 0.0
    steepest: float = 0.0
    collocations: tuple[Collocation, ...] = ()
    passes: tuple[Pass, ...] = ()

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s], strictly increasing."""
        return recording.record(self.rows, self.contacts).time

    @property
    def state(self) -> np.ndarray:
        """States, shape (rows, NY)."""
        return recording.record(self.rows, self.contacts).state

    def parts(self) -> list[tuple[slice, np.ndarray]]:
        """Return slices of rows, each with the closure rows that were selected for them."""
        starts = [start for start, _ in self.selections]
        firsts = np.searchsorted(self.time, starts, side="right")
        firsts[0] = 0
        ends = [*firsts[1:], len(self.rows)]
        return [(slice(a, b), selected) for a, b, (_, selected) in zip(firsts, ends, self.selections, strict=True)]

    def without(self, times: np.ndarray) -> Trajectory:
        """Return the trajectory without its rows at some times [s], except rows of events."""
        dropped = np.isin(self.time, times) & ~np.isin(self.time, self.events["time"])
        return replace(self, rows=self.rows[~dropped]) if dropped.any() else self


#: the engine at the end, its trajectory, and the reason if it is not the first engine
Followed = tuple[Engine, Trajectory, str]


class StiffError(SolverError):
    """Stability limits the steps of an explicit method; an implicit one may continue with long steps."""

    def __init__(self, text: str, handover: Handover) -> None:
        super().__init__(text)
        self.handover = handover


def integrate(
    engine: Engine,
    y: np.ndarray,
    progress: Progress,
    stop: Stop = never,
    left: Handover | None = None,
    outputs: np.ndarray | None = None,
    judge: Judge | None = None,
    jumps: Jumps | None = None,
) -> Trajectory:
    """Integrate from a consistent start, to the end or until `stop`; arguments and errors as of `in_parts`."""
    with stopping.heed_requests():
        return next(in_parts(engine, y, progress, stop, left, outputs, judge, jumps))


def in_parts(
    engine: Engine,
    y: np.ndarray,
    progress: Progress,
    stop: Stop = never,
    left: Handover | None = None,
    outputs: np.ndarray | None = None,
    judge: Judge | None = None,
    jumps: Jumps | None = None,
) -> Iterator[Trajectory]:
    """Integrate from a consistent start; yield the trajectory so far whenever `stop` asks for it, and at the end.

    The steps are the same whether it stops or not. Raise SolverError when the stepper gives up.
    stop: called periodically with the rows so far.
    left: handover of another method, from which this one continues.
    outputs: times of output [s], the start first; by default the scene's.
    judge: decides whether another method continues; by default when an explicit one would take far too long.
    jumps: changes of the state at events and breaks.
    Raises StoppedError on a request to stop, unless `stop` heeds it.
    """
    judge, begun = judge or Judge(SLICE, crawls), engine.start if left is None else left.time
    if outputs is None:
        outputs = engine.output_times(engine.model.scene.output.interval)
    stopping.check_stop()  # many short integrations never pause
    tape = begin(engine, y, outputs, progress) if left is None else resume(engine, left, outputs, progress)
    for _ in travel_in_parts(engine, tape, begun, engine.end, progress, stop, judge, jumps):
        yield _collect(engine, tape)
    yield _collect(engine, tape)


def travel(
    engine: Engine, tape: Tape, begun: float, until: float, progress: Progress, stop: Stop, judge: Judge
) -> None:
    """Integrate to a time [s] or until `stop`; arguments as of `travel_in_parts`."""
    next(travel_in_parts(engine, tape, begun, until, progress, stop, judge), None)


def travel_in_parts(
    engine: Engine,
    tape: Tape,
    begun: float,
    until: float,
    progress: Progress,
    stop: Stop,
    judge: Judge,
    jumps: Jumps | None = None,
) -> Iterator[None]:
    """Integrate to a time [s], from break to break; pause whenever `stop` asks for it.

    begun: breaks up to this time have been prepared.  Other arguments as of `in_parts`.
    """
    sample, control = _sampler(engine), engine.control
    for a, b in pairwise(engine.breaks):
        if b <= control[m.TIME] or a >= until:
            continue
        if a > begun:
            engine.view(m.Y)[:] = sample(engine.view(m.Y).copy(), a)
            if jumps is not None:
                jumps.at_break(engine, *engine.pieces[[engine.segments(a, after=side) for side in (False, True)]])
            engine.select_pieces_after(0.5 * (a + b))
            engine.n[m.FRESH] = 1
        control[m.END] = min(b, until)
        while _segment(engine, tape, progress, stop, judge, jumps):
            yield


def _sampler(engine: Engine) -> Callable[[np.ndarray, float], np.ndarray]:
    """Return a function that applies the effects' changes of state at a break [s]."""
    samplers = [make(engine) for make in engine.model.parts.functions(SAMPLERS)]
    return lambda y, t: reduce(lambda state, sample: sample(state, t), samplers, y)


def begin(engine: Engine, y: np.ndarray, outputs: np.ndarray, progress: Progress) -> Tape:
    """Return a tape with its first row; begin contacts that are closed at the start; prepare a singular start."""
    engine.specialised.begin()
    y = _sampler(engine)(y, engine.start)
    tape = _prepare(engine, y, engine.start, outputs)
    first = recording.record(tape.rows[:1], len(engine.model.contacts))
    first.time[:], first.state[:] = engine.start, y
    engine.n[m.N_RECORDED], engine.n[m.NEXT_OUTPUT] = 1, 1
    if engine.model.contacts:
        _begin_closed(engine, y, tape.events)
        first.modes[:], first.latched[:] = engine.modes, engine.latched
    if engine.mobility.singular_start:
        _leave_singular_start(engine, tape)
    return _ready(engine, tape, progress)


def _ready(engine: Engine, tape: Tape, progress: Progress) -> Tape:
    """Return the tape of an integration that is ready to step."""
    engine.n[m.FRESH] = 1
    engine.settle(progress)
    tape.looks.append(observe_progress(engine))
    return tape


def resume(engine: Engine, left: Handover, outputs: np.ndarray, progress: Progress) -> Tape:
    """Return a tape with another method's record, and set the engine to that method's last state."""
    engine.specialised.begin()
    here, before = left.here, left.tape
    tape, n = _prepare(engine, here.y, left.time, outputs), engine.n
    cap = n[m.CAP]
    n[m.STATUS : m.INTEGERS] = left.counters
    n[m.CAP] = cap
    here.enter(engine)
    engine.control[LASTING] = left.lasting
    tape.rows, tape.events = before.wider(n[m.N_RECORDED], tape.rows), np.concatenate([here.events, tape.events])
    same = np.array_equal(before.selections[-1][1], engine.selected)
    tape.selections = [*before.selections, *([] if same else tape.selections)]
    tape.collocations, tape.passes = [*before.collocations], [*before.passes]
    return _ready(engine, tape, progress)


def _prepare(engine: Engine, y: np.ndarray, t: float, outputs: np.ndarray) -> Tape:
    """Prepare work array and empty tape of an integration from state y at time t."""
    model, n, control = engine.model, engine.n, engine.control
    solver = model.scene.solver
    engine.select_pieces_after(t)
    engine.reset()
    control[m.TIME], control[m.SPAN] = t, engine.end - engine.start
    control[m.PASS_TIME] = control[m.MOST_REACH] = NEVER
    engine.view(m.INDEPENDENCE.at)[:] = 0.0
    for known in (*range(m.MEMORY, m.QUADRATURES.at + 1), m.EXCURSION.at):  # of another run: it would change last bits
        engine.view(known)[:] = 0.0
    control[m.FIXED], control[m.PARAMETER] = solver.step or 0.0, engine.method.parameter(solver)
    n[m.STATUS : m.INTEGERS] = 0
    n[m.CAP] = solver.evaluations
    engine.modes[:], engine.latched[:] = 0, 0.0
    return replace(blank(engine, outputs), selections=[(t, _select(engine, y, t))])


def blank(engine: Engine, outputs: np.ndarray) -> Tape:
    """Return an empty tape."""
    contacts = len(engine.model.contacts)
    room = EVENT_ROWS if contacts else m.ROOM
    rows = recording.empty_record(len(outputs) + room + m.ROOM + recording.BETWEEN, contacts, engine.model.ny)
    return Tape(outputs, rows, np.full((room + m.ROOM, m.EVENT.size), np.nan), [])


def _select(engine: Engine, y: np.ndarray, t: float) -> np.ndarray:
    """Select the closure rows in the state from which integration continues; return a copy of the selection."""
    ratio = closure_rows.select_rows(engine, y, t)
    engine.view(m.Y)[:] = y
    engine.view(m.PIVOT)[:] = 1.0, closure_rows.WORN * ratio if engine.mobility.redundant else 0.0
    return engine.selected.copy()


def _leave_singular_start(engine: Engine, tape: Tape) -> None:
    """Store a polynomial out of the singular start for the stepper, and set the speeds of its branch."""
    first = recording.record(tape.rows[:1], len(engine.model.contacts)).state[0]
    engine.select_pieces_after(engine.start)
    leaving = beginning.start_motion(engine, first.copy())
    leaving.lay(engine)
    first[:] = engine.view(m.Y)
    engine.view(m.PIVOT)[:] = 1.0, 0.0
    tape.collocations.append(leaving)
    tape.selections[:] = [(engine.start, engine.selected.copy())]


def _begin_closed(engine: Engine, y: np.ndarray, events: np.ndarray) -> None:
    """Begin the contacts that are closed at the start, at the approach speeds that the scene declares."""
    n, watched, event = engine.n, engine.table(m.WATCH), m.named(m.EVENT, events)[:, 0]
    engine.view(m.WATCH.at)[:] = 0.0
    for c in overlap_depths(engine, y):
        speed = engine.model.contacts[c].joint.initial_approach_speed
        if speed is None:
            continue  # a start that differs by a hair from one that touches: it closes at once
        engine.modes[c], engine.latched[c] = 1, speed or NO_IMPACT
        event[n[m.N_EVENTS]] = (c, m.CLOSING, engine.start, speed, 0.0, 0.0, np.nan)
        watched["event_row"][c], watched["trend0"][c] = n[m.N_EVENTS], m.STEEPLY
        n[m.N_EVENTS] += 1


def _segment(engine: Engine, tape: Tape, progress: Progress, stop: Stop, judge: Judge, jumps: Jumps | None) -> bool:
    """Integrate to the end of the segment; return True when `stop` ended it before."""
    n, control = engine.n, engine.control
    few = m.ROOM + m.EVENTS_OF_A_CONTACT * len(engine.model.contacts)
    while True:
        if n[m.EVALUATIONS] >= n[m.BUDGET]:  # segments may be so short that no pause falls into one
            n[m.BUDGET] = n[m.EVALUATIONS] + (judge.every or SLICE)
        if engine.h[m.N_CHANGES]:  # only the steps' own code for the rows solved for now has derivatives
            engine.settle(progress)
        known = n[m.N_EVENTS]  # with no more room than one step needs, the stepper returns after each event
        engine.advance(tape.outputs, tape.rows, tape.events if jumps is None else tape.events[: known + few])
        if jumps is not None and n[m.N_EVENTS] > known:
            jumps.at_events(engine, tape)
        t = float(control[m.TIME])
        progress((t - engine.start) / control[m.SPAN], f"t = {t:.5f} s, {n[m.EVALUATIONS]} evaluations")
        status = n[m.STATUS]
        if status == m.SEGMENT_END:
            return False
        if status == m.FULL:
            waiting = len(tape.outputs) - n[m.NEXT_OUTPUT]
            if n[m.N_RECORDED] + waiting + few + recording.BETWEEN > len(tape.rows) or n[m.N_EVENTS] + few > len(
                tape.events
            ):
                tape.rows = tape.wider(n[m.N_RECORDED], np.zeros_like(tape.rows))
                tape.events = np.concatenate([tape.events, np.full_like(tape.events, np.nan)])
        elif status == m.SINGULAR_AHEAD and engine.model.closures:
            _pass_over(engine, tape)
        elif status == m.WORN_ROWS or (status in STALLED and engine.mobility.redundant):
            if closure_rows.improve(engine, t):
                tape.selections.append((t, engine.selected.copy()))
            elif status != m.WORN_ROWS and not _rescue(engine, tape):
                raise SolverError(refusal.text(engine, tape.rows[: n[m.N_RECORDED]]))
        elif status != m.PAUSED:
            if not _rescue(engine, tape):
                raise SolverError(refusal.text(engine, tape.rows[: n[m.N_RECORDED]]))
        else:
            if engine.model.contacts:
                require_shallow(engine)
            tape.looks.append(observe_progress(engine))
            if reason := judge.verdict(engine, tape.looks):
                raise StiffError(f"at t = {t:.6g} s: {reason}", _hand_over(engine, tape))
            engine.settle(progress)
            _warn(engine, tape, progress)
            if stop(_so_far(engine, tape)):
                return True
            stopping.check_stop()


def _warn(engine: Engine, tape: Tape, progress: Progress) -> None:
    """Warn once for each flexible body that leaves the range of linear modes, before that may end the run."""
    if not engine.model.numbering.flexible:
        return
    from flexclear.dynamics.run.refusals.validity import doubts, flexibles

    tape.flexible = tape.flexible or flexibles(engine.model)
    for sentence in doubts(engine, tape.flexible):
        body = sentence.partition(":")[0]
        if body not in tape.doubted:
            tape.doubted.add(body)
            progress(None, f"warning: {sentence}")


def _pass_over(engine: Engine, tape: Tape) -> bool:
    """Continue when closure rows become dependent; return True on success.

    Other rows serve if only these are dependent; else a polynomial over the singular pose.
    """
    t = float(engine.control[m.TIME])
    if engine.mobility.redundant and closure_rows.improve(engine, t, closure_rows.CLEARLY):
        tape.selections.append((t, engine.selected.copy()))
        return True
    made, passes = passing.lay_over(engine)
    if made is not None:
        tape.collocations.append(made)
        known = tape.passes[-1].time if tape.passes else -np.inf
        tape.passes += [p for p in passes if p.time - known > passing.EQUAL_TIMES * made.span]
    return made is not None


def _rescue(engine: Engine, tape: Tape) -> bool:
    """Return True when a stepper that stopped gets a polynomial: a singular pose ahead may be the cause."""
    control, status = engine.control, engine.n[m.STATUS]
    if status not in STOPPED or not engine.model.closures or control[m.MOST_REACH] == 0.0:
        return False
    ahead = control[m.PASS_TIME] < NEVER or control[m.LEFT] < TOO_LITTLE
    return (ahead or passing.foresee_at_start(engine)) and _pass_over(engine, tape)


def _hand_over(engine: Engine, tape: Tape) -> Handover:
    """Return the handover of a paused integration to another method."""
    n = engine.n
    here = Moment.of(engine, engine.view(m.WATCH.at), tape.events[: n[m.N_EVENTS]].copy())
    return Handover(
        here, n[m.STATUS : m.INTEGERS].copy(), engine.control[LASTING], replace(tape, rows=tape.rows.copy())
    )


def _so_far(engine: Engine, tape: Tape) -> np.ndarray:
    """Return the rows recorded so far, by time."""
    return by_time(tape.rows[: engine.n[m.N_RECORDED]], len(engine.model.contacts))


def _collect(engine: Engine, tape: Tape) -> Trajectory:
    n, contacts = engine.n, len(engine.model.contacts)
    counters = {
        "evaluations": int(n[m.EVALUATIONS]),
        "steps": int(n[m.STEPS]),
        "rejected_steps": int(n[m.REJECTED]),
        "projections": int(n[m.PROJECTIONS]),
        "stiff_steps": int(n[m.STIFF_STEPS]),
        "projection_evaluations": int(n[m.PROJECTION_EVALUATIONS]),
        "jacobians": int(n[m.JACOBIANS]),
    }
    events = m.named(m.EVENT, tape.events[: n[m.N_EVENTS]])[:, 0]
    # events inside a step are recorded after the step, one contact after the other
    in_order = events[np.argsort(events["time"], kind="stable")]
    drift, rate_drift, steepest = (float(engine.control[k]) for k in (m.DRIFT, m.RATE_DRIFT, m.STEEPEST))
    laid = tuple(tape.collocations), tuple(tape.passes)
    rows = (
        _so_far(engine, tape),
        by_time(tape.rows[len(tape.rows) - min(n[m.N_BETWEEN], recording.BETWEEN) :], contacts),
    )
    return Trajectory(*rows, in_order, contacts, counters, tuple(tape.selections), drift, rate_drift, steepest, *laid)
