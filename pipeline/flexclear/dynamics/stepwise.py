"""A motion in steps that its caller chooses: inputs between them, readings, a state that is stored and restored."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.analyses import require_without_events
from flexclear.dynamics.equations import observation
from flexclear.dynamics.linear.bench import inertia
from flexclear.dynamics.model.driving import joint_type, label
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import variables_for
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.run import trajectory
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine, copy_of_engine
from flexclear.dynamics.run.evaluation.observation import observe_with, rows_of
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.inputs import Inputs
from flexclear.dynamics.run.pieces import digest, memory, remember
from flexclear.dynamics.run.progress_rate import Judge, Look, crawls
from flexclear.dynamics.run.run import engines
from flexclear.scene.quantity import KINDS, Quantity, parse
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress, silent
from flexclear.workflow import stopping

#: no output times: a motion in steps records nothing
NO_OUTPUTS = np.zeros(0)
#: loops of states that are read are closed to this fraction of the mechanism's size
CLOSED = 1e-14
#: shortest step, as a fraction of the scene's time: times closer than this are the same, as sums of many steps may be
SHORTEST = 1e-11
#: beginning of a stored state
MARK = b"flexclear state 1\n"


@dataclass(frozen=True)
class Equations:
    """The equations of motion in a state: mass a + bias = closures^T multipliers, for the accelerations a.

    coordinates: names of the n free coordinates, ``joint``, ``joint.coordinate`` or ``joint.number``; those of bodies
    that no joint carries are named after the body, and modes are ``body.number``. speeds [rad/s, m/s]: shape (n,).
    mass: (n, n). bias: negative sum of all applied, gravity, contact, gyroscopic and drives' inertia forces, (n,).
    closures: Jacobian of the loop closures that are solved for, (rows, n).
    """

    coordinates: tuple[str, ...]
    speeds: np.ndarray
    mass: np.ndarray
    bias: np.ndarray
    closures: np.ndarray


class Simulation:
    """A motion that advances in steps: ``with fc.simulation(scene) as sim: sim.advance(1e-3)``.

    inputs: the forces, torques, set points and motions that the scene gives as numbers (`run.inputs.Inputs`).
    """

    def __init__(self, scene: Scene, bundles: Mapping[str, Labelled], progress: Progress = silent) -> None:
        require_without_events(scene, "a simulation in steps")
        self.scene = scene
        engine, self._other = engines(scene, bundles, progress)
        self._key = hashlib.sha256(digest(engine).encode()).digest()
        self._tape = trajectory.begin(engine, consistent_start(engine), NO_OUTPUTS, progress)
        self.inputs = Inputs(engine.model, engine.start)
        self._judge, self._heir = Judge(trajectory.SLICE, crawls), engine.method.traits.hands_over_to
        self._begun, self._lost, self._open = engine.start, "", True
        self._turns = dict[str, float]()
        self._use(engine)
        self._first = self._observed()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Simulation {self.scene.name} at t = {self.time:g} s>" if self._open else "<closed Simulation>"

    def close(self) -> None:
        """End the simulation and release its memory."""
        self._open = False
        self.__dict__.pop("_engine", None)
        self.__dict__.pop("_watch", None)

    @property
    def time(self) -> float:
        """Present time [s]."""
        return float(self._here().control[m.TIME])

    def _here(self) -> Engine:
        if not self._open:
            raise InputError("simulation", "it is closed", "begin another one with fc.simulation")
        return self._engine

    def _use(self, engine: Engine) -> None:
        """Step with this engine; states are observed by another one, so that reading changes no bit of the motion."""
        self._engine, self._watch = engine, copy_of_engine(engine)
        self._seen: observation.Blocks | None = None

    def advance(self, duration: float) -> None:
        """Advance by a duration [s], with steps as short as accuracy, contacts and events inside need.

        Raises InputError for an impossible duration, SolverError where the motion cannot continue.
        """
        engine, until = self._here(), self._end_of(duration)
        if self._lost:
            raise SolverError(f"{self._lost}\n  hint: restore an earlier state")
        if until == self.time:
            return
        self._seen = None
        try:
            with stopping.heed_requests():
                if self.inputs.begin(until):
                    engine.n[m.FRESH] = 1
                    # a polynomial over a singular pose belongs to the inputs before
                    engine.control[[m.COLLOCATED, m.PASS_TIME, m.MOST_REACH]] = 0.0, trajectory.NEVER, trajectory.NEVER
                self._travel(until)
        except SolverError as error:
            self._lost = str(error)
            raise
        self.inputs.end(until)
        self._forget()

    def _end_of(self, duration: float) -> float:
        """Return the time after a duration [s]; raise InputError where it is impossible."""
        here, start, end = self.time, self._engine.start, self._engine.end
        if not (isinstance(duration, (int, float, np.number)) and 0.0 <= duration < np.inf):
            raise InputError("advance", f"{duration!r} is not a duration in seconds", "give 0 or more")
        until, resolved, breaks = here + float(duration), SHORTEST * (end - start), self._engine.breaks
        if until > end + resolved:
            problem = f"{until:.9g} s is beyond the scene's end, {end:.9g} s"
            raise InputError("advance", problem, "give the scene a later time.end")
        if 0.0 < duration < resolved:
            problem = f"{duration:.3g} s is less than a scene of {end - start:.6g} s resolves"
            raise InputError("advance", problem, f"give at least {resolved:.3g} s, or an earlier time.end")
        nearest = float(breaks[np.argmin(np.abs(breaks - until))])
        return nearest if abs(nearest - until) < resolved else until

    def _travel(self, until: float) -> None:
        while True:
            engine = self._engine
            try:
                trajectory.travel(engine, self._tape, self._begun, until, silent, trajectory.never, self._judge)
                break
            except trajectory.StiffError as stiff:  # as `run.follow` does
                successor = self._other(self._heir)
                successor.model.arrays.f[:] = engine.model.arrays.f
                successor.specialised.exact, self.inputs.model = engine.specialised.exact, successor.model
                self._tape = trajectory.resume(successor, stiff.handover, NO_OUTPUTS, silent)
                self._judge, self._begun = Judge(None, crawls), stiff.handover.time
                self._use(successor)
        self._begun = max(float(self._engine.breaks[self._engine.segments(until, after=False)]), self._begun)

    def _forget(self) -> None:
        """Forget rows and events of the steps so far, without the events of contacts that last."""
        n, tape, watched = self._engine.n, self._tape, self._engine.table(m.WATCH)
        closed = np.flatnonzero(self._engine.modes[: len(self._engine.model.contacts)])
        lasting = tape.events[watched["event_row"][closed].astype(int).ravel()]
        tape.events[: len(lasting)] = lasting
        tape.events[len(lasting) :] = np.nan
        watched["event_row"][closed] = np.arange(len(lasting)).reshape(watched["event_row"][closed].shape)
        n[m.N_EVENTS], n[m.N_RECORDED], n[m.N_BETWEEN] = len(lasting), 1, 0

    # Readings --------------------------------------------------------------------------------------------------------

    def read(self, name: str) -> float | np.ndarray:
        """Return the present value of a quantity [SI], as `[view] watch` names it: a number, or the vector's numbers.

        Sums from the start on, such as losses, begin with the simulation.  Angles of joints that close loops count
        turns from one reading to the next.  Raises InputError for a quantity that the scene lacks.
        """
        from flexclear.artifacts import quantities

        quantity = self._quantity(name)
        engine = self._here()
        if self._seen is None:
            now = self._observed()
            self._seen = {key: np.concatenate([self._first[key], values]) for key, values in now.items()}
        arrays = self._variables(quantity, self._seen, np.array([engine.start, self.time]))
        value = np.asarray(quantities.series(arrays, quantity)[-1])
        return value if quantity.dim else float(value[0])

    def unit(self, name: str) -> str:
        """Return the SI unit of a quantity or of an input."""
        return self._quantity(name).unit

    def _quantity(self, name: str) -> Quantity:
        try:
            quantity = parse(name, self.scene.owners())
        except ValueError as error:
            raise InputError(f"quantity '{name}'", str(error)) from None
        if not all(one.over_time for one in quantity.terms()):
            raise InputError(f"quantity '{name}'", "has no value at every time", "read it from the dataset of a run")
        return quantity

    def _variables(self, quantity: Quantity, blocks: observation.Blocks, time: np.ndarray) -> Any:
        model = self._watch.model
        seen = observation.by_name(blocks, model.arrays.size)
        arrays = variables_for(self.scene, Motions(model, seen), set(quantity.terms()), time)
        if any(KINDS[one.kind].variable == "joint_position" and one.turns for one in quantity.terms()):
            values, names = arrays["joint_position"].values, arrays["coordinate"].values.tolist()
            for one in quantity.terms():
                if one.turns and KINDS[one.kind].variable == "joint_position":
                    now, k = values[-1:, names.index(one.owner)], names.index(one.owner)
                    now += 2.0 * np.pi * np.round((self._turns.get(one.owner, float(now[0])) - now) / (2.0 * np.pi))
                    self._turns[one.owner] = float(values[-1, k])
        return arrays

    def _rows(self, states: np.ndarray) -> np.ndarray:
        """Return rows of states with the present time and contacts, for the engine that observes."""
        engine, watch = self._engine, self._watch
        watch.keep(engine.selected)
        return rows_of(watch, states, self.time, engine.modes[: len(engine.model.contacts)], engine.latched)

    def _observed(self, states: np.ndarray | None = None, closed: float = CLOSED) -> observation.Blocks:
        engine = self._engine
        rows = self._rows(engine.view(m.Y)[None].copy() if states is None else states)
        first = engine.n[m.ACTIVE]
        pieces = np.tile(engine.n[first : first + engine.model.arrays.size(m.N_LAWS)], (len(rows), 1))
        blocks = observe_with(self._watch, rows, pieces, closed)
        if np.any(blocks["status"] != m.OK):
            raise SolverError(f"at t = {self.time:.6g} s: the loops cannot be closed in this state")
        return blocks

    def equations(self) -> Equations:
        """Return mass matrix, bias forces and Jacobian of the loop closures in the present state."""
        from flexclear.dynamics.run.evaluation.matrices import holding_forces

        engine, watch = self._here(), self._watch
        watch.keep(engine.selected)
        watch.modes[:], watch.latched[:] = engine.modes[: len(watch.modes)], engine.latched
        first, count = engine.n[m.ACTIVE], engine.model.arrays.size(m.N_LAWS)
        watch.n[first : first + count] = engine.n[first : first + count]
        closure_rows.evaluate(watch, engine.view(m.Y), self.time)
        mass, closures = inertia(watch)
        names, signs = _coordinates(watch.model)
        forces = signs * (modes_of(watch.model.arrays) @ holding_forces(watch)[0])
        speeds = signs * engine.view(m.Y)[watch.model.speeds]
        return Equations(names, speeds, signs[:, None] * mass * signs, forces, closures * signs)

    def jacobian(self, name: str) -> np.ndarray:
        """Return the change of a velocity, ``slider.velocity``, per free speed of `equations`; shape (components, n).

        Loops are open: the Jacobian is that of the tree of joints.  Raises InputError for what is no velocity.
        """
        quantity = self._quantity(name)
        if quantity.unit not in ("m/s", "rad/s") or quantity.steps:
            raise InputError(f"quantity '{name}'", "is not a velocity", "name one, as in slider.velocity")
        from flexclear.artifacts import quantities

        model = self._here().model
        states = np.tile(self._engine.view(m.Y), (model.nv + 1, 1))
        states[:, model.speeds] = np.vstack([np.zeros(model.nv), np.eye(model.nv)])
        blocks = self._observed(states, closed=np.inf)
        values = quantities.series(self._variables(quantity, blocks, np.full(len(states), self.time)), quantity)
        return np.asarray((values[1:] - values[0]).T * _coordinates(model)[1])

    # The state -------------------------------------------------------------------------------------------------------

    @property
    def state(self) -> bytes:
        """Everything that the motion's future depends on, to be restored in any process on this kind of machine.

        Equal states and inputs give the same motion to the last bit.
        """
        described, parts = dict[str, Any](), list[bytes]()
        for name, array in self._arrays():
            described[name] = [array.dtype.str, *array.shape]
            parts.append(np.ascontiguousarray(array).tobytes())
        own = {"integrator": self._here().model.scene.solver.integrator, "begun": self._begun, "lost": self._lost}
        own["met"] = [rows.hex() for rows in self._engine.specialised.rows]
        own["worthwhile"] = self._engine.specialised.worthwhile
        own |= {"targets": self.inputs.targets, "turns": self._turns, "arrays": described}
        body = self._key + json.dumps(own).encode() + b"\n" + b"".join(parts)
        return MARK + hashlib.sha256(body).digest() + body

    @state.setter
    def state(self, stored: bytes) -> None:
        head = len(MARK) + 32
        stored = bytes(stored) if isinstance(stored, (bytes, bytearray, memoryview)) else b""
        body = stored[head:]
        if stored[: len(MARK)] != MARK or hashlib.sha256(body).digest() != stored[len(MARK) : head]:
            raise InputError("state", "is damaged, or is not a state of a simulation", "store and restore it as it is")
        if body[:32] != self._key:
            raise InputError(
                "state",
                "is of another scene, version or kind of processor",
                f"restore it in a simulation of the scene that it comes from, not of {self.scene.name}",
            )
        text, _, data = body[32:].partition(b"\n")
        own, arrays = json.loads(text), dict[str, np.ndarray]()
        for name, (dtype, *shape) in own["arrays"].items():
            size = np.dtype(dtype).itemsize * int(np.prod(shape))
            arrays[name], data = np.frombuffer(data[:size], dtype).reshape(shape), data[size:]
        if self._here().model.scene.solver.integrator != own["integrator"]:
            self._use(self._other(own["integrator"]))
        self._restore(own, arrays)

    def _arrays(self) -> Iterator[tuple[str, np.ndarray]]:
        engine, tape = self._here(), self._tape
        yield from memory(engine).items()
        yield "laws", engine.model.arrays.rows(m.PIECES)
        yield "first", tape.rows[:1]
        yield "events", tape.events[: engine.n[m.N_EVENTS]]
        yield "looks", np.array(tape.looks)

    def _restore(self, own: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
        engine = self._engine
        engine.model.arrays.rows(m.PIECES)[:] = arrays["laws"]
        self.inputs.model = engine.model
        engine.specialised.rows[:], engine.specialised.worthwhile = map(bytes.fromhex, own["met"]), own["worthwhile"]
        remember(engine, arrays)
        self._tape = tape = trajectory.blank(engine, NO_OUTPUTS)
        tape.selections.append((self.time, engine.selected.copy()))
        tape.rows[:1], tape.events[: len(arrays["events"])] = arrays["first"], arrays["events"]
        self._tape.looks = [Look(float(t), *map(int, counts)) for t, *counts in arrays["looks"]]
        self._begun, self._lost, self._seen = own["begun"], own["lost"], None
        self._turns, self.inputs.time = dict(own["turns"]), self.time
        self.inputs.targets = {name: (a, b) for name, (a, b) in own["targets"].items()}


def _coordinates(model: Model) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of the free coordinates, and the sign of each joint's own coordinate in the tree."""
    names, signs = [""] * model.nv, np.ones(model.nv)
    for i, link in enumerate(model.links[1:], start=1):
        coordinates, edge = model.numbering.coordinates[i], link.branch.edge
        if link.drives:
            coordinates = range(0)
        named = edge is not None and not link.on_path and joint_type(edge.kind).COORDINATES
        for k, c in enumerate(coordinates):
            if named and edge is not None:
                names[c], signs[c] = label(edge.name, edge.kind, link.joint.positions[k]), link.joint.sign
            else:
                names[c] = f"{edge.name if edge is not None else next(iter(link.placements), 'link')}.{k + 1}"
        for k, c in enumerate(model.numbering.modal_coordinates.get(i, ())):
            names[c] = f"{link.flexible}.{k + 1}"
    return tuple(names), signs
