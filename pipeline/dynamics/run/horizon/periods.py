"""A motion followed period after period, and a neighbour that shows at what rate such motions part.

The laws of one period hold in each, so that the run's time starts over while its state continues: memory does not grow
with the number of periods, and neither does the rounding of the time. The neighbour starts a small distance away and is
brought back to that distance, in its own direction, at every waypoint; the mean of the logarithms of what it went
astray in between is the largest Lyapunov exponent. It is a motion like any other, so that what impacts do to it, which
begin earlier or later in it, needs no equations of its own.

Source: Benettin, Galgani, Giorgilli & Strelcyn (1980), Lyapunov characteristic exponents for smooth dynamical systems,
Meccanica 15, 9-30 (rescaled neighbours); Mueller (1995), Calculation of Lyapunov exponents for dynamic systems with
discontinuities, Chaos, Solitons & Fractals 5, 1671-1681 (what a neighbour does at an impact).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.model.driving import prescribed
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.observation import rows_of
from flexclear.pipeline.dynamics.run.evaluation.start import project
from flexclear.pipeline.dynamics.run.horizon.horizon import askew
from flexclear.pipeline.dynamics.run.pieces import Handover, Moment, Tape
from flexclear.pipeline.dynamics.run.trajectory import LASTING, Trajectory, integrate

#: waypoints of a period: impacts may part two motions a hundredfold, and they must stay close together
WAYPOINTS = 16
#: the neighbour's distance in units of the relative tolerance: what steps differ by is then a thousandth of it
NEIGHBOUR = 1e3
#: a neighbour that went this many times as far between two waypoints was beyond what is linear; that is reported
NOT_LINEAR = 1e4
#: laws repeat when they end a period as they began it, but for this fraction
EQUAL_LAWS = 1e-6


@dataclass(frozen=True)
class Cursor:
    """Where a motion is between two periods: number of the next one, the motion itself, and its neighbour."""

    number: int = 0
    here: Moment | None = None
    neighbour: Moment | None = None

    def packed(self) -> dict[str, np.ndarray]:
        """All of it as arrays; what is not there has none."""
        moments = {"here": self.here, "neighbour": self.neighbour}
        arrays = {f"{name}.{k}": v for name, one in moments.items() if one is not None for k, v in vars(one).items()}
        return {**arrays, "number": np.array(self.number)}

    @staticmethod
    def unpacked(arrays: Mapping[str, np.ndarray]) -> Cursor:
        """From what `packed` gave."""

        def moment(name: str) -> Moment | None:
            mine = {k.removeprefix(f"{name}."): v for k, v in arrays.items() if k.startswith(f"{name}.")}
            return Moment(**mine) if mine else None

        return Cursor(int(arrays["number"]), moment("here"), moment("neighbour"))


@dataclass(frozen=True)
class Period:
    """One period of the motion, and by how much the neighbour's distance grew.

    parts: the stretches between waypoints; times start over with each period.
    growth: logarithm of the distance's growth, 0 where no neighbour is followed.  lost: how often the neighbour was
    beyond what is linear.  after: from where the next one begins.
    """

    number: int
    parts: tuple[Trajectory, ...]
    growth: float
    lost: int
    after: Cursor


def require_periodic(parts: list[Engine], y: np.ndarray) -> None:
    """InputError unless there are laws, and all end the period with the values that they begin it with, drives with
    the rates, too.

    Whole turns of a driven angle are no difference.
    """
    if not len(parts[0].table(m.LAW)):
        raise InputError(
            "[sections]", "nothing repeats: no drive and no load has a law of time", "drive a joint, or vary a load"
        )
    values = []
    for part, t in ((parts[0], parts[0].start), (parts[-1], parts[-1].end)):
        part.select_pieces_after(t)
        part.attempt(y, t)
        laws = part.table(m.LAW)
        values.append(np.stack([laws["value"], laws["rate"]], axis=1))
    period, driven = parts[-1].end - parts[0].start, prescribed(parts[0].model.scene)
    turning, change = [k for k, drive in enumerate(driven) if drive.dimension == "angle"], values[1] - values[0]
    change[turning, 0] = (change[turning, 0] + np.pi) % (2.0 * np.pi) - np.pi
    change[len(driven) :, 1] = 0.0  # a load's rate may jump
    least = np.where(np.arange(len(change)) < len(driven), EQUAL_LAWS, 1.0)[:, None] * [1.0, 1.0 / period]
    wrong = np.argwhere(np.abs(change) > EQUAL_LAWS * (np.abs(values).max(axis=0) + least))
    if len(wrong):
        k, rate = wrong[0]
        raise InputError(
            f"[drive.{driven[k].name}]" if k < len(driven) else "[load]",
            f"its law does not repeat after a period of {period:.6g} s: its {'rate' if rate else 'value'} has changed "
            f"by {change[k, rate]:.3g}",
            "give the laws' period as sections.period, or choose laws that end as they begin",
        )


def stretches(engine: Engine, period: float, phase: float) -> list[Engine]:
    """The engine between the waypoints of a period, one of which is at `phase`; they use its work space."""
    regular = period * np.linspace(0.0, 1.0, WAYPOINTS + 1)
    # where a regular one is next to the phase, the phase replaces it
    inner = regular[1:-1][np.abs(regular[1:-1] - phase) > 0.25 * period / WAYPOINTS]
    times = engine.start + np.unique([0.0, *inner, phase, period])
    return [replace(engine, start=float(a), end=float(b)) for a, b in pairwise(times)]


def periods(parts: list[Engine], y: np.ndarray, followed: range, begin: Cursor) -> Iterator[Period]:
    """Period after period from a consistent start y, for ever.

    parts: stretches of a period.  followed: numbers of the periods in which a neighbour is followed.
    begin: from where it continues.
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
            trajectory, there = _go(part, y, here)
            if neighbour is not None:
                after = _follow(part, neighbour)
                neighbour, grown = brought_back(part, scales, there, after, separation)
                growth, lost = growth + grown[0], lost + grown[1]
            elif number in followed:
                neighbour = _set_neighbour(part, scales, there, separation)
            done.append(trajectory)
            here = there
        here, neighbour = (None if moment is None else _earlier(moment, period) for moment in (here, neighbour))
        number += 1
        yield Period(number - 1, tuple(done), growth, lost, Cursor(number, here, neighbour))


def state_scales(engine: Engine, period: float) -> np.ndarray:
    """Size of each state variable, of speeds in a period; infinite of the ledger, of which nothing feeds back."""
    floors = engine.magnitudes
    floors[engine.model.speeds] /= period
    floors[engine.model.speeds.stop :] = np.inf
    return floors


def _go(part: Engine, y: np.ndarray, here: Moment | None) -> tuple[Trajectory, Moment]:
    """Over one stretch; from the start of the run where there is no moment yet."""
    left = None if here is None else handed(part, here)
    trajectory = integrate(part, y, silent, left=left)
    return trajectory, _moment(part, trajectory)


def _follow(part: Engine, here: Moment) -> Moment | None:
    """Where the neighbour comes to; None where it cannot be followed."""
    try:
        return _go(part, here.y, here)[1]
    except SolverError:
        return None


def handed(part: Engine, here: Moment) -> Handover:
    """A moment as what another method would have left of this stretch: one row."""
    counters = np.zeros(m.INTEGERS - m.STATUS, dtype=np.int64)
    for index, value in ((m.N_RECORDED, 1), (m.NEXT_OUTPUT, 1), (m.N_EVENTS, len(here.events))):
        counters[index - m.STATUS] = value
    lasting = np.zeros(len(LASTING))
    lasting[0] = part.start
    rows = rows_of(part, here.y[None], part.start, here.modes, here.latched)
    recorded = Tape(np.zeros(0), rows, here.events, [(part.start, part.selected.copy())])
    return Handover(here, counters, lasting, recorded)


def _moment(part: Engine, trajectory: Trajectory) -> Moment:
    """What the work space holds at the end of a stretch."""
    watched, events = part.view(m.WATCH.place).copy(), list[np.ndarray]()
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
    """The moment when time has started over: its contacts began a period earlier."""
    events = moment.events.copy()
    m.named(m.EVENT, events)["time"] -= period
    return replace(moment, events=events)


def _set_neighbour(part: Engine, scales: np.ndarray, here: Moment, separation: float) -> Moment:
    """A neighbour in a direction that no symmetry of a mechanism has."""
    direction = np.where(np.isfinite(scales), askew(len(scales)), 0.0)
    unit = direction / np.linalg.norm(direction)
    moved = here.y + separation * unit * np.where(np.isfinite(scales), scales, 0.0)
    return replace(here, y=_closed(part, moved))


def brought_back(
    part: Engine, scales: np.ndarray, here: Moment, neighbour: Moment | None, separation: float
) -> tuple[Moment, tuple[float, int]]:
    """The neighbour at its distance again; by how much that had grown (its logarithm), and 1 if it was lost.

    Where one of both has a contact closed and the other has not, they are left as they are until both have: a state
    between them would have surfaces that overlap without having met.
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
    y = _closed(part, here.y + fraction * difference)
    latched = here.latched + fraction * (neighbour.latched - here.latched)
    return replace(neighbour, y=y, latched=latched), (-float(np.log(fraction)), int(distance > NOT_LINEAR * separation))


def _closed(part: Engine, y: np.ndarray) -> np.ndarray:
    """The state at the end of a stretch, its loops closed."""
    return project(replace(part, start=part.end), y)
