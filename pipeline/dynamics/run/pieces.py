"""An integration as a piece of work in the task's journal: all that its stepper has, as arrays.

The work space, the wiring with the rows solved for, the integers and the record are all that steps depend on, whatever
the method keeps there; so an integration that continues from them is the same to the last bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.workflow import journal
from flexclear.pipeline.core.workflow.journal import Journal, State
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile.folder import processor
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

    def full(self, engine: Engine) -> bool:
        """Return whether another step might find no room for its rows or events."""
        n, room = engine.n, m.ROOM + m.EVENTS_OF_A_CONTACT * len(engine.model.contacts)
        waiting = len(self.outputs) - n[m.NEXT_OUTPUT]
        return bool(n[m.N_RECORDED] + waiting + room > len(self.rows) or n[m.N_EVENTS] + room > len(self.events))


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
    time = m.record(rows, contacts).time
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


@dataclass
class Piece:
    """One integration. done: whether it had come to its end when it was found.  tape: as it was found; or nothing."""

    journal: Journal
    engine: Engine
    name: str
    begun: float
    tape: Tape | None = None
    done: bool = False

    def keep(self, tape: Tape) -> None:
        """Write the state, when it is time to."""
        if self.journal.due(self.name):
            self.save(tape)

    def save(self, tape: Tape) -> None:
        """Write the state now."""
        with self.journal.uncounted():
            self.journal.write(self.name, self._state(tape, done=False))

    def finish(self, tape: Tape) -> None:
        """The end has been reached."""
        if not self.done:
            with self.journal.uncounted():
                self.journal.finish(self.name, self._state(tape, done=True))

    def _state(self, tape: Tape, *, done: bool) -> State:
        """All that the integration continues from, copied; record and events may be written over by nobody else."""
        n, arrays = self.engine.n, memory(self.engine)
        arrays["events"] = tape.events[: n[m.N_EVENTS]].copy()
        arrays["selections"] = np.array([rows for _, rows in tape.selections])
        for k, laid in enumerate(tape.collocations):
            arrays[f"series{k}"] = laid.series
        notes = {
            "done": done,
            "room": [len(tape.rows), len(tape.events)],
            "selections": [float(time) for time, _ in tape.selections],
            "collocations": [[laid.start, laid.span] for laid in tape.collocations],
            "passes": [[getattr(one, item.name) for item in fields(one)] for one in tape.passes],
            "doubted": sorted(tape.doubted),
            "looks": [list(one) for one in tape.looks],
            "straight": [list(rows) for rows in self.engine.straight.rows],
        }
        return State(arrays, notes, tape.rows[: n[m.N_RECORDED]], journal.seconds() - self.begun)

    def restore(self, state: State, outputs: np.ndarray) -> None:
        """Put engine and tape into the state that was found."""
        from flexclear.pipeline.dynamics.run.singular_poses.collocation import Collocation
        from flexclear.pipeline.dynamics.run.singular_poses.passing import Pass

        arrays, notes = state.arrays, state.notes
        remember(self.engine, arrays)
        rows, events = (int(count) for count in notes["room"])
        tape = Tape(
            outputs,
            np.zeros((rows, state.grown.shape[1])),
            np.full((events, m.EVENT.size), np.nan),
            list(zip(notes["selections"], arrays["selections"], strict=True)),
            [Collocation(a, b, arrays[f"series{k}"]) for k, (a, b) in enumerate(notes["collocations"])],
            [Pass(*one) for one in notes["passes"]],
            set(notes["doubted"]),
            [Look(*one) for one in notes["looks"]],
        )
        tape.rows[: len(state.grown)], tape.events[: len(arrays["events"])] = state.grown, arrays["events"]
        self.engine.straight.rows[:] = [bytes(rows) for rows in notes["straight"]]
        self.tape, self.done = tape, bool(notes["done"])


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


def piece(engine: Engine, y: np.ndarray, outputs: np.ndarray, left: Handover | None) -> Piece | None:
    """The piece of an integration from state y, as an earlier attempt left it; None where nothing is recorded.

    left: what another method left or None.
    """
    storage = journal.current()
    if storage is None:
        return None
    begun = journal.seconds()
    with storage.uncounted():
        made = Piece(storage, engine, storage.name(digest(engine, y, outputs, *_arrays(left))), begun)
        stored = storage.find(made.name)
        if stored is not None:
            made.restore(stored, outputs)
    return made


def digest(engine: Engine, *arrays: np.ndarray) -> str:
    """Of all that decides what an engine makes of some arrays, the processor included."""
    described = f"{processor()} {INTERPRETED} {engine.start!r} {engine.end!r} {_described(engine.model.scene)}"
    hashed = hashlib.sha256(described.encode())
    h = engine.h.copy()
    h[list(m.ADDRESSES)] = 0
    for array in (h, engine.model.arrays.f, engine.w, engine.n, engine.selected, *arrays):
        hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()


_last: list[tuple[Scene, str]] = []


def _described(scene: Scene) -> str:
    """All that a scene says; remembered of the last one, since studies ask for thousands of pieces of it."""
    known, text = _last[0] if _last else (None, "")
    if known is not scene:
        text = scene.model_dump_json(exclude={"title", "description", "view", "limits"})
        _last[:] = [(scene, text)]
    return text


def _arrays(left: Handover | None) -> Iterator[np.ndarray]:
    """What decides how another method continues; nothing of how singular poses were passed before does."""
    if left is None:
        return
    yield from (*vars(left.here).values(), left.counters, left.lasting, left.tape.rows)
    for time, rows in left.tape.selections:
        yield np.array([time])
        yield rows
