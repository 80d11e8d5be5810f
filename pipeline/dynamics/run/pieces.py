"""What an integration has, as arrays: its record, what it hands over to another method, what it continues from.

The work space, the topology with the rows solved for and the integers are all that steps depend on, whatever the method
stores there; so a motion that continues from them is the same to the last bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile.folder import processor
from flexclear.pipeline.dynamics.integrate import recording
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.progress_rate import Look

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.run.singular_poses.collocation import Collocation
    from flexclear.pipeline.dynamics.run.singular_poses.passing import Pass

#: arrays of an engine that change as it works
MEMORY = ("w", "n", "h", "selected")


#: closure rows solved for, each from a time on [s]
Selections = tuple[tuple[float, np.ndarray], ...]


@dataclass
class Tape:
    """The arrays of one integration; rows and events may be replaced by larger ones.

    doubted: flexible bodies of which has been said that they left the range of their modes.
    looks: where the run was when its pace was examined, and where it began.
    """

    outputs: np.ndarray
    rows: np.ndarray
    events: np.ndarray
    selections: list[tuple[float, np.ndarray]]
    collocations: list[Collocation] = field(default_factory=list)
    passes: list[Pass] = field(default_factory=list)
    doubted: set[str] = field(default_factory=set)
    looks: list[Look] = field(default_factory=list)


class Jumps(Protocol):
    """What changes the state where the equations change: given the engine, which is there, and the tape."""

    def at_events(self, engine: Engine, tape: Tape) -> None:
        """Contacts have begun or ended at the end of the last step."""

    def at_break(self, engine: Engine, before: np.ndarray, after: np.ndarray) -> None:
        """Pieces of the laws give way to others."""


def in_order(rows: np.ndarray, contacts: int) -> np.ndarray:
    """The rows by time: those of a step's inner events were written before its outputs.

    An event on an output time is one row, the later.
    """
    time = recording.record(rows, contacts).time
    order = np.argsort(time, kind="stable")
    return rows[order[np.append(np.diff(time[order]) > 0.0, True)]]


@dataclass(frozen=True)
class Moment:
    """All that a motion continues from.

    y: state.  modes, latched, watched: of the contacts, as in the work space.  events: of the event table, among them
    those of the contacts that are closed, to which `watched` refers.
    """

    y: np.ndarray
    modes: np.ndarray
    latched: np.ndarray
    watched: np.ndarray
    events: np.ndarray

    @staticmethod
    def of(engine: Engine, watched: np.ndarray, events: np.ndarray) -> Moment:
        """Where the stepper is, copied."""
        return Moment(engine.view(m.Y).copy(), engine.modes.copy(), engine.latched.copy(), watched.copy(), events)

    def enter(self, engine: Engine) -> None:
        """Put it into the work space."""
        engine.view(m.Y)[:], engine.view(m.WATCH.place)[:] = self.y, self.watched
        engine.modes[:], engine.latched[:] = self.modes, self.latched


@dataclass(frozen=True)
class Handover:
    """What the next method must know, copied, at the end of the last accepted step.

    counters: integers from m.STATUS on.  lasting: control floats LASTING.  tape: what was recorded.
    """

    here: Moment
    counters: np.ndarray
    lasting: np.ndarray
    tape: Tape

    @property
    def time(self) -> float:
        """Where the next method begins [s]."""
        return float(self.lasting[0])


def memory(engine: Engine) -> dict[str, np.ndarray]:
    """All that an engine holds, copied."""
    return {name: getattr(engine, name).copy() for name in MEMORY}


def remember(engine: Engine, arrays: Mapping[str, np.ndarray]) -> None:
    """Let an engine hold what `memory` gave, but for the addresses of functions, which are this process's own."""
    addresses = engine.h[list(m.ADDRESSES)].copy()
    for name in MEMORY:
        getattr(engine, name)[:] = arrays[name]
    engine.h[list(m.ADDRESSES)] = addresses
    engine.connect()  # code is of the rows that are selected now


def digest(engine: Engine, *arrays: np.ndarray) -> str:
    """Of all that decides what an engine makes of some arrays, the processor included."""
    scene = engine.model.scene.model_dump_json(exclude={"title", "description", "view", "limits"})
    described = f"{processor()} {INTERPRETED} {engine.start!r} {engine.end!r} {scene}"
    hashed = hashlib.sha256(described.encode())
    h = engine.h.copy()
    h[list(m.ADDRESSES)] = 0
    for array in (h, engine.model.arrays.f, engine.w, engine.n, engine.selected, *arrays):
        hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()
