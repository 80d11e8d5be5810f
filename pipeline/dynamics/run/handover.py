"""A run that one method leaves where it crawls, and another one goes on with from there, to one trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import SolverError
from pipeline.dynamics import memory as m
from pipeline.dynamics.run.engine import Engine

#: control floats of the first method that go on under the second
LASTING = ("time", "drift", "rate_drift", "steepest")


@dataclass(frozen=True)
class Handover:
    """What the next method must know, copied, at the end of the last accepted step.

    y: state.  modes, latched, watched: of the contacts, as in the work space.  counters: integers of `state`.
    lasting: control floats LASTING by name.  rows, events: what was recorded.  selections: as of a trajectory.
    """

    y: np.ndarray
    modes: np.ndarray
    latched: np.ndarray
    watched: np.ndarray
    counters: np.ndarray
    lasting: dict[str, float]
    rows: np.ndarray
    events: np.ndarray
    selections: tuple[tuple[float, np.ndarray], ...]

    @property
    def time(self) -> float:
        """Where the next method begins [s]."""
        return self.lasting["time"]


class StiffError(SolverError):
    """An explicit method crawls along at the limit of its stability; an implicit one may go on in long steps."""

    def __init__(self, text: str, handover: Handover) -> None:
        super().__init__(text)
        self.handover = handover


def hand_over(
    engine: Engine, rows: np.ndarray, events: np.ndarray, selections: list[tuple[float, np.ndarray]]
) -> Handover:
    """What a paused integration leaves to another method; rows and events may have room left."""
    n, arrays = engine.n, engine.model.arrays
    contacts = arrays.size(m.N_CONTACTS)
    return Handover(
        engine.view(m.Y, arrays.size(m.NY)).copy(),
        n[n[m.MODE] : n[m.MODE] + contacts].copy(),
        engine.view(m.LATCHED, contacts).copy(),
        engine.view(m.WATCH.place, m.WATCH.size * contacts).copy(),
        n[m.STATUS : m.INTEGERS].copy(),
        {name: float(engine.control[name]) for name in LASTING},
        rows[: n[m.N_RECORDED]].copy(),
        events[: n[m.N_EVENTS]].copy(),
        tuple(selections),
    )


def take_over(engine: Engine, left: Handover) -> None:
    """Put what another method left into an engine of the same mechanism, whose own begin has set the rest."""
    n, contacts = engine.n, len(left.modes)
    cap = n[m.CAP]
    n[m.STATUS : m.INTEGERS] = left.counters
    n[m.CAP] = cap
    n[n[m.MODE] : n[m.MODE] + contacts] = left.modes
    engine.view(m.Y, len(left.y))[:] = left.y
    engine.view(m.LATCHED, contacts)[:] = left.latched
    engine.view(m.WATCH.place, len(left.watched))[:] = left.watched
    for name, value in left.lasting.items():
        engine.control[name] = value
