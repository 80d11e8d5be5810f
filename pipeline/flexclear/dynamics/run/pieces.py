"""State of an integration as arrays: its record, the handover to another method, the data from which it continues.

Steps depend only on the work array, the topology with the selected rows and the integers, whatever the method stores
there; so a motion that continues from them is the same to the last bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile.folder import processor
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.kernels import INTERPRETED
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.progress_rate import Look

if TYPE_CHECKING:
    from flexclear.dynamics.run.refusals.validity import Flexible
    from flexclear.dynamics.run.singular_poses.collocation import Collocation
    from flexclear.dynamics.run.singular_poses.passing import Pass

#: arrays of an engine that change as it works
MEMORY = ("w", "n", "h", "selected")


#: selected closure rows, each selection from a time on [s]
Selections = tuple[tuple[float, np.ndarray], ...]


@dataclass
class Tape:
    """The arrays of one integration; rows and events may be replaced by larger ones.

    rows: the record from the first row on, and those between outputs from the last one backwards (see
        `integrate.recording`).
    flexible: the flexible bodies.  doubted: those with a warning that they left the range of linear modes.
    looks: samples of the progress rate, the first at the start.
    """

    outputs: np.ndarray
    rows: np.ndarray
    events: np.ndarray
    selections: list[tuple[float, np.ndarray]]
    collocations: list[Collocation] = field(default_factory=list)
    passes: list[Pass] = field(default_factory=list)
    flexible: list[Flexible] = field(default_factory=list)
    doubted: set[str] = field(default_factory=set)
    looks: list[Look] = field(default_factory=list)

    def wider(self, recorded: int, room: np.ndarray) -> np.ndarray:
        """Return the rows with room after those of the record, of which there are so many."""
        return np.concatenate([self.rows[:recorded], room, self.rows[recorded:]])


class Jumps(Protocol):
    """Changes of the state where the equations change; both take the engine, which has arrived there, and the tape."""

    def at_events(self, engine: Engine, tape: Tape) -> None:
        """Apply the change where contacts have begun or ended at the end of the last step."""

    def at_break(self, engine: Engine, before: np.ndarray, after: np.ndarray) -> None:
        """Apply the change at a break, from the pieces of laws before it to those after it."""


def by_time(rows: np.ndarray, contacts: int) -> np.ndarray:
    """Return the rows by time, since those of a step's inner events precede its outputs.

    Of rows with the same time, as of an event on an output time, the last one remains.
    """
    time = recording.record(rows, contacts).time
    order = np.argsort(time, kind="stable")
    return rows[order[np.append(np.diff(time[order]) > 0.0, True)]]


@dataclass(frozen=True)
class Moment:
    """The data from which a motion continues.

    y: state.  modes, latched, watched: of the contacts, as in the work array.  events: rows of the event table, with
    those of the closed contacts, to which `watched` refers.
    """

    y: np.ndarray
    modes: np.ndarray
    latched: np.ndarray
    watched: np.ndarray
    events: np.ndarray

    @staticmethod
    def of(engine: Engine, watched: np.ndarray, events: np.ndarray) -> Moment:
        """Return a copy of the stepper's present data."""
        return Moment(engine.view(m.Y).copy(), engine.modes.copy(), engine.latched.copy(), watched.copy(), events)

    def enter(self, engine: Engine) -> None:
        """Store the data in the work array."""
        engine.view(m.Y)[:], engine.view(m.WATCH.at)[:] = self.y, self.watched
        engine.modes[:], engine.latched[:] = self.modes, self.latched


@dataclass(frozen=True)
class Handover:
    """Copies for the next method, at the end of the last accepted step.

    counters: integers from m.STATUS on.  lasting: control floats LASTING.  tape: the record.
    """

    here: Moment
    counters: np.ndarray
    lasting: np.ndarray
    tape: Tape

    @property
    def time(self) -> float:
        """Time at which the next method begins [s]."""
        return float(self.lasting[0])


def memory(engine: Engine) -> dict[str, np.ndarray]:
    """Return copies of an engine's arrays, without the addresses of functions, which belong to this process."""
    arrays = {name: getattr(engine, name).copy() for name in MEMORY}
    arrays["h"][list(m.ADDRESSES)] = 0
    return arrays


def remember(engine: Engine, arrays: Mapping[str, np.ndarray]) -> None:
    """Restore the arrays from `memory`."""
    addresses = engine.h[list(m.ADDRESSES)].copy()
    for name in MEMORY:
        getattr(engine, name)[:] = arrays[name]
    engine.h[list(m.ADDRESSES)] = addresses
    engine.connect()  # code is of the rows that are selected now


def digest(engine: Engine, *arrays: np.ndarray) -> str:
    """Return a digest of all that decides how an engine continues from its arrays, the processor included."""
    scene = engine.model.scene.model_dump_json(exclude={"title", "description", "view", "limits"})
    described = f"{processor()} {INTERPRETED} {engine.start!r} {engine.end!r} {scene}"
    hashed = hashlib.sha256(described.encode())
    h = engine.h.copy()
    h[list(m.ADDRESSES)] = 0
    for array in (h, engine.model.arrays.f, engine.w, engine.n, engine.selected, *arrays):
        hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()
