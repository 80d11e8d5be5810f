"""Sections of a periodic motion (schema SECTIONS): the state once per period, impacts, growth of small differences."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from flexclear.artifacts.quantities import IMPACT
from flexclear.artifacts.schema import SECTIONS, conform
from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Variables
from flexclear.dynamics.model.checks import section_period
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import attributes, contact_names, subject
from flexclear.dynamics.record.ensemble import recorded_bodies
from flexclear.dynamics.record.motion import Motions, motion_series
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon.periods import (
    NEIGHBOUR,
    Cursor,
    Period,
    parts_of_period,
    periods,
)
from flexclear.dynamics.run.horizon.repetition import require_periodic
from flexclear.dynamics.run.pieces import digest, memory, remember
from flexclear.dynamics.run.run import engines, observe_run
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.scene.load import edited
from flexclear.scene.loads import SampledPid
from flexclear.scene.schema import Scene, Sections
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress
from flexclear.workflow import journal

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled

#: recorded numbers of each impact
OF_IMPACTS = ("section", "contact", "phase", "approach_speed", "peak_force", "duration")


def sections(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Return the sections of a scene whose laws repeat (schema SECTIONS).

    Raises InputError for laws that do not repeat, SolverError when the run cannot continue.
    """
    requested = scene.sections or Sections()
    period = section_period(scene)
    # only the states at waypoints are requested
    engine, _ = engines(edited(scene, {"output.interval": period}), bundles, progress)
    names = recorded_bodies(engine.model, requested.bodies, "[sections.bodies]")
    start = consistent_start(engine)
    parts = engines_of_period(engine, start)
    count = requested.transient + requested.periods
    followed = range(requested.transient, min(count, requested.transient + requested.exponent_periods))
    tape, begin = _Tape(names, engine.start + requested.phase), Cursor()
    stored, name = journal.current_journal(), f"periods-{digest(engine, start)}"
    arrays = stored.find(name) if stored is not None else None
    if arrays is not None:  # stored by an interrupted run
        remember(engine, arrays)
        tape.unpack(arrays)
        begin = Cursor.unpacked(arrays)
    for done in periods(parts, start, followed, begin):
        progress((done.number + 1) / count, f"period {done.number + 1} of {count}")
        if done.number >= requested.transient:
            tape.add(parts, done, number=done.number - requested.transient)
        if done.number + 1 == count:
            orbit = tape.orbit(parts, done)
            break
        if stored is not None:  # packed now: a failure in the next period would leave the tape half changed
            state = {**memory(engine), **done.after.packed(), **tape.pack()}
            stored.store(name, lambda state=state: state)  # type: ignore[misc]
    growth, lost = np.array(tape.columns["growth"][: len(followed)]), int(sum(tape.columns["lost"]))
    facts = {"period": period, "phase": requested.phase, "transient": requested.transient, "neighbour_lost": lost}
    variables = tape.variables(engine.model) | orbit | {"growth": (("followed",), growth)}
    coordinates = {"section": np.arange(requested.periods), "body": names, "followed": np.arange(len(followed))}
    coordinates["waypoint"] = np.array([part.start - engine.start for part in parts])
    if engine.model.contacts:
        coordinates |= contact_names(engine.model)
    made = xr.Dataset(variables, coords=coordinates)
    title = f"Sections of the periodic motion of {subject(scene)}"
    return conform(
        made, SECTIONS, title=title, **attributes(scene), **facts, neighbour_distance=NEIGHBOUR * engine.rtol
    )


def engines_of_period(engine: Engine, start: np.ndarray) -> list[Engine]:
    """Return the engine for each stretch of a period; raise InputError for a scene whose laws do not repeat."""
    scene = engine.model.scene
    for name, load in scene.load.items():
        if isinstance(load, SampledPid):
            raise InputError(
                f"[load.{name}]",
                "a sampled controller counts its periods from the start of the run, which sections repeat",
                "use a continuous 'pid' here",
            )
    parts = parts_of_period(engine, section_period(scene), (scene.sections or Sections()).phase)
    require_periodic(parts, start)
    return parts


@dataclass
class _Tape:
    """Recorded values of bodies; at: time of the sections [s].

    columns: `growth`, `lost` and `motion.*` have an entry per period, `impact.*` one per impact; force and duration of
    an impact are NaN until it ends.  open: index of the last impact of each contact.
    """

    names: list[str]
    at: float
    columns: defaultdict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    open: dict[int, int] = field(default_factory=dict)

    def add(self, parts: list[Engine], done: Period, number: int) -> None:
        """Record the requested values of one period."""
        self._append(growth=done.growth, lost=done.lost)
        for part, trajectory in zip(parts, done.parts, strict=True):
            if part.start == self.at:
                motion = self._motion(part, trajectory, np.array([0]))
                self._append(**{f"motion.{name}": values[0] for name, values in motion.items()})
            if part.model.contacts:
                self._note(part, trajectory, number, parts[0].start)

    def _append(self, **values: Any) -> None:
        for name, value in values.items():
            self.columns[name].append(value)

    def orbit(self, parts: list[Engine], done: Period) -> Variables:
        """Return the motion of the recorded bodies at the waypoints of a period, for the variables of the schema."""
        motions = [self._motion(*one, np.array([0])) for one in zip(parts, done.parts, strict=True)]
        return {
            f"orbit_{name}": (
                ("waypoint", *_dimensions_at_row(name)),
                np.concatenate([motion[name] for motion in motions]),
            )
            for name in motions[0]
            if f"orbit_{name}" in SECTIONS
        }

    def _motion(self, part: Engine, trajectory: Trajectory, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Return the motion of the recorded bodies, and the contacts' offsets, at some rows."""
        seen, model = observe_run(part, replace(trajectory, rows=trajectory.rows[rows])), part.model
        series = motion_series(Motions(model, seen).several(self.names), model.mechanism.origin)
        offsets = {"contact_offset": seen.touch["offset"].copy()} if model.contacts else {}
        return {name: values for name, (_, values) in series.items()} | offsets

    def _note(self, part: Engine, trajectory: Trajectory, number: int, begin: float) -> None:
        """Record the impacts that begin in a stretch, and force and duration of those that end in it."""
        closings = trajectory.events[trajectory.events["kind"] == m.CLOSING]
        new = closings[(closings["time"] >= part.start) & (closings["speed"] > IMPACT)]
        rows = np.clip(np.searchsorted(trajectory.time, new["time"]), 0, len(trajectory.time) - 1)
        motion = self._motion(part, trajectory, rows) if len(new) else {}
        durations, forces = self.columns["impact.duration"], self.columns["impact.peak_force"]
        for k, event in enumerate(new):
            self.open[int(event["contact"])] = len(durations)
            impact = {"section": number, "phase": event["time"] - begin, "contact": event["contact"]}
            impact |= {"approach_speed": event["speed"], "peak_force": np.nan, "duration": np.nan}
            impact |= {name: values[k] for name, values in motion.items()}
            self._append(**{f"impact.{name}": value for name, value in impact.items()})
        for event in closings[np.isfinite(closings["duration"])]:
            begun = self.open.get(int(event["contact"]))
            if begun is not None and np.isnan(durations[begun]):
                durations[begun], forces[begun] = event["duration"], event["peak_force"]

    def pack(self) -> dict[str, np.ndarray]:
        """Return all recorded values as arrays."""
        return {name: np.array(values) for name, values in self.columns.items()} | {
            "open": np.array(list(self.open.items()), int).reshape(-1, 2)
        }

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Restore the values that `pack` returned, from a mapping with other arrays."""
        mine = ("growth", "lost", "motion.", "impact.")
        self.columns |= {name: list(values) for name, values in arrays.items() if name.startswith(mine)}
        self.open = {int(c): int(k) for c, k in arrays["open"]}

    def variables(self, model: Model) -> Variables:
        """Return all recorded values by the names of the schema SECTIONS."""
        motion = [name.removeprefix("motion.") for name in self.columns if name.startswith("motion.")]
        kept: Variables = {
            name: (("section", *_dimensions_at_row(name)), np.array(self.columns[f"motion.{name}"])) for name in motion
        }
        if not model.contacts:
            return kept
        numbers = {name: np.array(self.columns[f"impact.{name}"], dtype=float) for name in OF_IMPACTS}
        names = np.array([contact.name for contact in model.contacts], dtype=str)
        numbers["section"] = numbers["section"].astype(np.int32)
        numbers["contact"] = names[numbers["contact"].astype(np.int64)]
        kept |= {f"impact_{name}": (("impact",), values) for name, values in numbers.items()}
        for name in ("position", "quaternion", "velocity"):
            values = self.columns[f"impact.{name}"]
            made = np.array(values).reshape(len(values), *kept[name][1].shape[1:])
            kept[f"impact_{name}"] = (("impact", *_dimensions_at_row(name)), made)
        return kept


def _dimensions_at_row(name: str) -> tuple[str, ...]:
    """Return the dimensions of a series of the motion (`motion_series`) without the first one."""
    if name == "contact_offset":
        return ("contact", "axis")
    return ("body", "quat" if name == "quaternion" else "axis")
