r"""Runs with their derivatives along directions: variational equations in the same steps, with jumps at impacts.

Along a direction, a change :math:`S` of the state obeys :math:`\dot S = g_yS + g_f\dot f`, with :math:`\dot f` the
change of the numbers. It is part of the state: the same method steps it, to the same tolerance. At an event of time
:math:`t_e`, where a function :math:`\varphi` passes zero, equations :math:`g^-` give way to :math:`g^+`, and

.. math:: S^+ = R\,(S^- + g^-t_e') - g^+t_e', \qquad t_e' = -\dot\varphi / (\mathrm d\varphi/\mathrm dt),

where :math:`R` is the derivative of the event's reset of the state (bristles begin without deflection). The impact rate
that a contact stores at its closing changes by its own tangent and by that of the time. Steps that end on a kink of
friction need no jump: forces are continuous there.

Source: Hiskens & Pai (2000), IEEE Trans. Circuits Syst. I 47, 204-220; Leine & Nijmeijer (2004), *Dynamics and
Bifurcations of Non-Smooth Mechanical Systems*, ch. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.model.arrays import Arrays, pack
from flexclear.dynamics.run.evaluation.engine import Engine, assemble
from flexclear.dynamics.run.pieces import Tape
from flexclear.dynamics.run.trajectory import Trajectory, integrate
from flexclear.dynamics.specialise.tape import UnsuitedError
from flexclear.scene.loads import SampledPid
from flexclear.system.errors import SolverError
from flexclear.system.progress import Progress

# N_CHANGES in the header: number of directions; F_CHANGE, W_CHANGE: lengths of f and w, which are each followed by
# their changes along the directions, in the same layout

#: factors of the tolerance of changes, and of the floors of changes of accumulated variables such as energies: their
#: rates jump where a force has a kink, and steps would vanish there
LOOSER, COARSER = 1e2, 1e4


class Direction(NamedTuple):
    """A direction of change; numbers: of the model's f, (len(f),); start: of the start's state, (NY,)."""

    numbers: np.ndarray
    start: np.ndarray


@dataclass(frozen=True)
class Differentiated:
    """A trajectory with its derivatives.

    trajectory: without derivatives.  changes: of the states, (rows, directions, NY).  impact_rates: changes of the
    impact rates, (rows, directions, contacts).  event_times: changes of the events' times [s], (events, directions),
    NaN for events that are no change of mode.
    """

    trajectory: Trajectory
    changes: np.ndarray
    impact_rates: np.ndarray
    event_times: np.ndarray


def differentiate(
    engine: Engine,
    y: np.ndarray,
    directions: Sequence[Direction],
    progress: Progress,
) -> Differentiated:
    """Run from a consistent start with derivatives along directions; raise SolverError where they do not exist."""
    model, count, ny = engine.model, len(directions), engine.model.ny
    mine, jumps = differentiated_engine(engine, directions), _Jumps(ny, count)
    start = np.concatenate([y, *(direction.start for direction in directions)])
    try:
        whole = integrate(mine, start, progress, jumps=jumps)
    except UnsuitedError as error:
        raise SolverError(f"the equations of this mechanism cannot be differentiated: {error}") from None
    if whole.collocations:
        raise SolverError("the motion passes a singular pose, across which it has no derivative")
    kept, contacts = whole.rows.shape[1] - count * ny, len(model.contacts)
    rows, between = (np.ascontiguousarray(part[:, :kept]) for part in (whole.rows, whole.between))
    trajectory = replace(whole, rows=rows, between=between)
    times = np.full((len(whole.events), count), np.nan)
    rates = np.zeros((len(whole.rows), count, contacts))
    for change in jumps.made:
        same = (whole.events["time"] == change.time) & (whole.events["contact"] == change.contact)
        times[same & np.isin(whole.events["kind"], (m.CLOSING, m.OPENING))] = change.times
        rates[whole.time >= change.time, :, change.contact] = change.impact_rates
    return Differentiated(trajectory, whole.rows[:, kept:].reshape(-1, count, ny), rates, times)


def differentiated_engine(engine: Engine, directions: Sequence[Direction]) -> Engine:
    """Return an engine whose state is followed by its changes along directions.

    Raises SolverError for a mechanism that is not differentiated.
    """
    model, count = engine.model, len(directions)
    if not engine.entry.compiled:
        raise SolverError("derivatives need compiled code: unset NUMBA_DISABLE_JIT")
    if any(isinstance(load, SampledPid) for load in model.scene.load.values()):
        raise SolverError("derivatives do not support sampled controllers: use a continuous 'pid'")
    if engine.method.traits.implicit:
        raise SolverError("derivatives need an explicit method: choose 'dop853'")
    wide = _with_room_for_changes(model.arrays, model.arrays.f, count)
    changes = [_with_room_for_changes(model.arrays, direction.numbers, count).f for direction in directions]
    wide = replace(wide, f=np.concatenate([wide.f, *changes]))
    made = assemble(
        replace(model, arrays=wide, ny=(1 + count) * model.ny), engine.entry, engine.method, engine.mobility
    )
    room = len(made.w)
    made.h[[m.N_CHANGES, m.F_CHANGE, m.W_CHANGE]] = count, len(wide.f) // (1 + count), room
    made = replace(made, w=np.concatenate([made.w, np.zeros(count * room)]))
    return made


def _with_room_for_changes(arrays: Arrays, f: np.ndarray, count: int) -> Arrays:
    """Return arrays with numbers f whose state has room for changes, in error groups of their own."""
    given = Arrays(arrays.h, f)
    tables = {table: given.rows(table) for table in (*m.TABLES["h"], *m.TABLES["f"])}
    groups, floors = tables[m.GROUPS], tables[m.FLOORS]
    tables[m.GROUPS] = np.concatenate([groups + k * len(floors) for k in range(1 + count)])
    coarser = floors.copy()
    coarser[np.unique(groups[_accumulated_variables(arrays)]), :2] *= COARSER
    coarser[:, 2] *= LOOSER
    tables[m.FLOORS] = np.concatenate([floors, *[coarser] * count])
    own = (m.NY, m.N_GROUPS)
    return pack({k: arrays.size(k) for k in range(m.ADDRESSES[0]) if k not in own}, tables)


def _accumulated_variables(arrays: Arrays) -> np.ndarray:
    """Return True for each state variable that is an accumulated one of the ledger, on which no rate depends, (NY,)."""
    first, end = arrays.size(m.NQ) + arrays.size(m.NV), arrays.size(m.NY) - arrays.size(m.N_INTERNAL)
    summed = (np.arange(arrays.size(m.NY)) >= first) & (np.arange(arrays.size(m.NY)) < end)
    for bristle in arrays.table(m.CONTACTS)["bristle"]:
        summed[bristle : bristle + 3] &= bristle < 0
    return summed


class _Change(NamedTuple):
    """A change of mode; times, impact_rates: changes of its time and of the impact rate from then on, (directions,)."""

    time: float
    contact: int
    times: np.ndarray
    impact_rates: np.ndarray


@dataclass
class _Jumps:
    """Jumps at events of the changes along `count` directions of a state with `ny` variables."""

    ny: int
    count: int
    seen: int = 0
    made: list[_Change] = field(default_factory=list)

    def at_events(self, engine: Engine, tape: Tape) -> None:
        events = m.named(m.EVENT, tape.events[self.seen : engine.n[m.N_EVENTS]])[:, 0]
        self.seen = int(engine.n[m.N_EVENTS])
        for event in events[np.isin(events["kind"], (m.CLOSING, m.OPENING)) & (events["time"] > engine.start)]:
            self._change_mode(engine, int(event["contact"]), closes=event["kind"] == m.CLOSING)
        last = recording.record(tape.rows[: engine.n[m.N_RECORDED]][-1:], len(engine.model.contacts))
        if last.time[0] == engine.control[m.TIME]:
            last.state[0, self.ny :] = engine.view(m.Y)[self.ny :]

    def at_break(self, engine: Engine, before: np.ndarray, after: np.ndarray) -> None:
        moved = self._starts(engine)[:, after[before != after]]
        if not np.any(moved):
            return
        if np.any(moved != moved[:, :1]):
            raise SolverError(
                "laws with simultaneous kinks that the parameters move differently have no derivative at this time"
            )
        t, first = float(engine.control[m.TIME]), engine.n[m.ACTIVE]
        rates = []
        for pieces in (before, after):
            engine.n[first : first + len(pieces)] = pieces
            rates.append(self._evaluate(engine, t)[: self.ny])
        self._state(engine)[:] += np.outer(moved[:, 0], rates[0] - rates[1])

    def _change_mode(self, engine: Engine, c: int, *, closes: bool) -> None:
        """Jump where contact c has closed or opened, at the engine's state."""
        t, state = float(engine.control[m.TIME]), self._state(engine)
        engine.modes[c] = not closes
        before = self._evaluate(engine, t)[: self.ny]
        gap, rate = (self._touch(engine, c, name) for name in (m.TOUCH.gap, m.TOUCH.rate))
        speed = engine.table(m.TOUCH)["rate"][c]  # at which the gap falls
        times = gap / speed
        rates = rate + times * self._acceleration(engine, t, c, before) if closes else np.zeros(self.count)
        state += np.outer(times, before)
        bristle = int(engine.model.arrays.table(m.CONTACTS)["bristle"][c])
        if closes and bristle >= 0:
            state[:, bristle : bristle + 3] = 0.0
        engine.modes[c] = closes
        self._work(engine)[:, engine.h[m.LATCHED] + c] = rates
        state -= np.outer(times, self._evaluate(engine, t)[: self.ny])
        self.made.append(_Change(t, c, times, rates))

    def _acceleration(self, engine: Engine, t: float, c: int, rates: np.ndarray) -> float:
        """Return the second rate at which the gap of contact c falls [m/s^2]: time is a direction like others."""
        first, numbers, work = self._state(engine)[0], self._numbers(engine)[0], self._work(engine)[0]
        kept = first.copy(), numbers.copy(), work.copy()
        first[:], numbers[:], work[:] = rates, 0.0, 0.0
        self._starts(engine)[0] = -1.0
        self._evaluate(engine, t)
        result = float(self._touch(engine, c, m.TOUCH.rate)[0])
        first[:], numbers[:], work[:] = kept
        return result

    def _evaluate(self, engine: Engine, t: float) -> np.ndarray:
        """Return rates of the state with its changes, by the code that steps use."""
        generic, engine.h[m.EVALUATE] = int(engine.h[m.EVALUATE]), engine.h[m.RATES]
        engine.evaluate(t)
        engine.h[m.EVALUATE] = generic
        return engine.slope.copy()

    def _state(self, engine: Engine) -> np.ndarray:
        """Return the changes of the state, not copied, (directions, NY)."""
        return engine.view(m.Y)[self.ny :].reshape(self.count, self.ny)

    def _numbers(self, engine: Engine) -> np.ndarray:
        """Return the changes of the numbers, not copied, (directions, len(f))."""
        return engine.model.arrays.f.reshape(1 + self.count, -1)[1:]

    def _work(self, engine: Engine) -> np.ndarray:
        """Return the changes of the work space, not copied, (directions, len(w))."""
        return engine.w.reshape(1 + self.count, -1)[1:]

    def _starts(self, engine: Engine) -> np.ndarray:
        """Return the changes of the start times of laws' pieces, not copied, (directions, pieces)."""
        begin, pieces = engine.h[m.PIECES.at] + m.PIECES.start, len(engine.model.arrays.table(m.PIECES))
        return self._numbers(engine)[:, begin : begin + m.PIECES.size * pieces : m.PIECES.size]

    def _touch(self, engine: Engine, c: int, offset: int) -> np.ndarray:
        """Return the changes of a field of a contact's row in TOUCH, (directions,)."""
        return self._work(engine)[:, engine.h[m.TOUCH.at] + m.TOUCH.size * c + offset].copy()
