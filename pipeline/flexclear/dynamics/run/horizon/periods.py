"""Motion of period after period, and the growth rate of its distance from a neighbouring motion.

The laws of one period hold in each, so the run's time starts over while its state continues: neither memory nor the
rounding of the time grows with the number of periods. The neighbour starts a small distance away and is moved back to
that distance, in its own direction, at every waypoint; the largest Lyapunov exponent is the mean logarithm of the
distance's growth per time. The neighbour is an ordinary motion, so impacts, which it begins earlier or later, need no
additional equations.

Source: Benettin, Galgani, Giorgilli & Strelcyn (1980), Lyapunov characteristic exponents for smooth dynamical systems,
Meccanica 15, 9-30 (rescaled neighbours); Mueller (1995), Calculation of Lyapunov exponents for dynamic systems with
discontinuities, Chaos, Solitons & Fractals 5, 1671-1681 (what a neighbour does at an impact).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import rows_of
from flexclear.dynamics.run.evaluation.start import project
from flexclear.dynamics.run.horizon.horizon import asymmetric
from flexclear.dynamics.run.pieces import Handover, Moment, Tape
from flexclear.dynamics.run.trajectory import LASTING, Trajectory, integrate
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent

#: number of waypoints per period: impacts may separate two motions a hundredfold, and they must stay close
WAYPOINTS = 16
#: distance of the neighbour in units of the relative tolerance: errors of steps are then a thousandth of the distance
NEIGHBOUR = 1e3


@dataclass(frozen=True)
class Cursor:
    """State of the iteration between two periods: number of the next period, motion, and neighbour."""

    number: int = 0
    here: Moment | None = None
    neighbour: Moment | None = None

    def packed(self) -> dict[str, np.ndarray]:
        """Return all values as arrays; motion and neighbour have none where they do not exist."""
        moments = {"here": self.here, "neighbour": self.neighbour}
        arrays = {f"{name}.{k}": v for name, one in moments.items() if one is not None for k, v in vars(one).items()}
        return {**arrays, "number": np.array(self.number)}

    @staticmethod
    def unpacked(arrays: Mapping[str, np.ndarray]) -> Cursor:
        """Return the cursor from the arrays of `packed`."""

        def moment(name: str) -> Moment | None:
            mine = {k.removeprefix(f"{name}."): v for k, v in arrays.items() if k.startswith(f"{name}.")}
            return Moment(**mine) if mine else None

        return Cursor(int(arrays["number"]), moment("here"), moment("neighbour"))


@dataclass(frozen=True)
class Period:
    """One period of the motion, and the growth of the neighbour's distance.

    parts: the stretches between waypoints; times start over with each period.
    growth: logarithm of the distance's growth, 0 where no neighbour is followed.  lost: number of waypoints at which it
    failed or was not linear.  after: cursor from which the next period begins.
    """

    number: int
    parts: tuple[Trajectory, ...]
    growth: float
    lost: int
    after: Cursor


def parts_of_period(engine: Engine, period: float, phase: float) -> list[Engine]:
    """Return the engine for each stretch between waypoints of a period, one at `phase`; all share the work space."""
    regular = period * np.linspace(0.0, 1.0, WAYPOINTS + 1)
    # the phase replaces a regular waypoint next to it
    inner = regular[1:-1][np.abs(regular[1:-1] - phase) > 0.25 * period / WAYPOINTS]
    times = engine.start + np.unique([0.0, *inner, phase, period])
    return [replace(engine, start=float(a), end=float(b)) for a, b in pairwise(times)]


def periods(parts: list[Engine], y: np.ndarray, followed: range, begin: Cursor) -> Iterator[Period]:
    """Yield period after period from a consistent start y, without end.

    parts: stretches of a period.  followed: numbers of the periods in which a neighbour is followed.
    begin: cursor from which the motion continues.
    Raises SolverError where the run cannot continue.
    """
    period = parts[-1].end - parts[0].start
    scales = state_scales(parts[0], period)
    separation = NEIGHBOUR * parts[0].rtol
    number, here, neighbour = begin.number, begin.here, begin.neighbour
    while True:
        done, growth, lost = list[Trajectory](), 0.0, 0
        if number not in followed:
            neighbour = None
        for part in parts:
            trajectory, there = _integrate_part(part, y, here)
            if neighbour is not None:
                after = _follow(part, neighbour)
                neighbour, grown = rescale_neighbour(part, scales, there, after, separation)
                growth, lost = growth + grown[0], lost + grown[1]
            elif number in followed:
                neighbour = _set_neighbour(part, scales, there, separation)
            done.append(trajectory)
            here = there
        here, neighbour = (None if moment is None else _earlier(moment, period) for moment in (here, neighbour))
        number += 1
        yield Period(number - 1, tuple(done), growth, lost, Cursor(number, here, neighbour))


def state_scales(engine: Engine, period: float) -> np.ndarray:
    """Return the size of each state variable, for speeds per period; infinite for the ledger, which has no feedback."""
    floors = engine.magnitudes
    floors[engine.model.speeds] /= period
    floors[engine.model.speeds.stop :] = np.inf
    return floors


def _integrate_part(part: Engine, y: np.ndarray, here: Moment | None) -> tuple[Trajectory, Moment]:
    """Integrate over one stretch, from the run's start where no moment exists; return the trajectory and its end."""
    left = None if here is None else handover(part, here)
    trajectory = integrate(part, y, silent, left=left)
    return trajectory, _moment(part, trajectory)


def _follow(part: Engine, here: Moment) -> Moment | None:
    """Return the neighbour at the end of a stretch; None where it cannot be followed."""
    try:
        return _integrate_part(part, here.y, here)[1]
    except SolverError:
        return None


def handover(part: Engine, here: Moment) -> Handover:
    """Return a moment as the handover of another method at the start of this stretch, with one row."""
    counters = np.zeros(m.INTEGERS - m.STATUS, dtype=np.int64)
    for index, value in ((m.N_RECORDED, 1), (m.NEXT_OUTPUT, 1), (m.N_EVENTS, len(here.events))):
        counters[index - m.STATUS] = value
    lasting = np.zeros(len(LASTING))
    lasting[0] = part.start
    rows = rows_of(part, here.y[None], part.start, here.modes, here.latched)
    recorded = Tape(np.zeros(0), rows, here.events, [(part.start, part.selected.copy())])
    return Handover(here, counters, lasting, recorded)


def _moment(part: Engine, trajectory: Trajectory) -> Moment:
    """Return the moment at the end of a stretch from the work space."""
    watched, events = part.view(m.WATCH.at).copy(), list[np.ndarray]()
    table = m.named(m.WATCH, watched)
    for c in range(len(part.model.contacts)):
        if part.modes[c]:
            mine = (trajectory.events["contact"] == c) & (trajectory.events["kind"] == m.CLOSING)
            begun = trajectory.events[np.flatnonzero(mine)[-1]]
            table["event_row"][c] = len(events)
            events.append(np.array([float(begun[name]) for name in begun.dtype.names]))
    begun = np.array(events).reshape(len(events), m.EVENT.size)
    return replace(Moment.of(part, watched, begun), y=trajectory.state[-1].copy())


def _earlier(moment: Moment, period: float) -> Moment:
    """Return the moment with the start times of its contacts a period earlier, since time has started over."""
    events = moment.events.copy()
    m.named(m.EVENT, events)["time"] -= period
    return replace(moment, events=events)


def _set_neighbour(part: Engine, scales: np.ndarray, here: Moment, separation: float) -> Moment:
    """Return a neighbour in a direction that no symmetry of a mechanism has."""
    direction = np.where(np.isfinite(scales), asymmetric(len(scales)), 0.0)
    unit = direction / np.linalg.norm(direction)
    moved = here.y + separation * unit * np.where(np.isfinite(scales), scales, 0.0)
    return replace(here, y=_state_with_closed_loops(part, moved))


def rescale_neighbour(
    part: Engine, scales: np.ndarray, here: Moment, neighbour: Moment | None, separation: float
) -> tuple[Moment, tuple[float, int]]:
    """Return the neighbour at its distance again, the logarithm of its growth, and 1 if it failed or was not linear.

    Where the closed contacts of the two differ, both stay as they are until they agree: a state between them would have
    surfaces that overlap without an impact.
    """
    if neighbour is None:
        return _set_neighbour(part, scales, here, separation), (0.0, 1)
    if not np.array_equal(here.modes, neighbour.modes):
        return neighbour, (0.0, 0)
    difference = neighbour.y - here.y
    distance = float(np.linalg.norm(difference / scales))
    if distance == 0.0:
        return _set_neighbour(part, scales, here, separation), (0.0, 1)
    fraction = separation / distance
    y = _state_with_closed_loops(part, here.y + fraction * difference)
    latched = here.latched + fraction * (neighbour.latched - here.latched)
    # 1e4: growth of the distance between two waypoints above which it is not linear, which is reported
    return replace(neighbour, y=y, latched=latched), (-float(np.log(fraction)), int(distance > 1e4 * separation))


def _state_with_closed_loops(part: Engine, y: np.ndarray) -> np.ndarray:
    """Return the state at the end of a stretch, with closed loops."""
    return project(replace(part, start=part.end), y)
