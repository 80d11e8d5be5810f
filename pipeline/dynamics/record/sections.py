"""Sections of a periodic motion (schema SECTIONS): the state once in each period, impacts, how neighbours part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.quantities import IMPACT
from flexclear.pipeline.core.artifacts.schema import SECTIONS, conform
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.loads import SampledPid
from flexclear.pipeline.core.scene.schema import Scene, Sections
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.core.workflow import journal
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.observation import Variables
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.record.dataset import attributes, contact_names, subject
from flexclear.pipeline.dynamics.record.ensemble import kept_bodies
from flexclear.pipeline.dynamics.record.motion import Motions, motion_series
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.horizon.periods import (
    NEIGHBOUR,
    Cursor,
    Period,
    periods,
    require_periodic,
    stretches,
)
from flexclear.pipeline.dynamics.run.pieces import digest, memory, remember
from flexclear.pipeline.dynamics.run.run import engines, observed
from flexclear.pipeline.dynamics.run.trajectory import Trajectory

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import Labelled

#: of impacts, known when they end
LATER = ("peak_force", "duration")


def sections(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Sections of a scene whose laws repeat (schema SECTIONS).

    Raises InputError for laws that do not repeat, SolverError when the run cannot continue.
    """
    requested = scene.sections or Sections()
    for name, load in scene.load.items():
        if isinstance(load, SampledPid):
            raise InputError(
                f"[load.{name}]",
                "a controller that samples counts its periods from the run's start, which sections repeat",
                "use a continuous 'pid' here",
            )
    period = section_period(scene)
    # between waypoints only their states are requested
    engine, _ = engines(edited(scene, {"output.interval": period}), bundles, progress)
    names = kept_bodies(engine.model, requested.bodies, "[sections.bodies]")
    start = consistent_start(engine)
    parts = stretches(engine, period, requested.phase)
    require_periodic(parts, start)
    count = requested.transient + requested.periods
    followed = range(requested.transient, min(count, requested.transient + requested.exponent_periods))
    tape, begin = _Tape(names, engine.start + requested.phase), Cursor()
    stored, name = journal.current(), f"periods-{digest(engine, start)}"
    arrays = stored.find(name) if stored is not None else None
    if arrays is not None:  # what an earlier attempt left
        remember(engine, arrays)
        tape.unpack(arrays)
        begin = Cursor.unpacked(arrays)
    for done in periods(parts, start, followed, begin):
        progress((done.number + 1) / count, f"period {done.number + 1} of {count}")
        if done.number >= requested.transient:
            tape.add(parts, done, number=done.number - requested.transient)
        if done.number + 1 == count:
            tape.orbit = tape.motion_at_waypoints(parts, done)
            break
        if stored is not None:  # the tape is as it is until the next period
            state = {**memory(engine), **done.after.packed()}
            stored.store(name, lambda state=state: {**state, **tape.packed()})  # type: ignore[misc]
    growth = np.array(tape.growth[: len(followed)])
    facts = {"period": period, "phase": requested.phase, "transient": requested.transient, "neighbour_lost": tape.lost}
    variables = tape.variables(engine.model) | {"growth": (("followed",), growth)}
    coordinates = {"section": np.arange(requested.periods), "body": names, "followed": np.arange(len(followed))}
    coordinates["waypoint"] = np.array([part.start - engine.start for part in parts])
    if engine.model.contacts:
        coordinates |= contact_names(engine.model)
    made = xr.Dataset(variables, coords=coordinates)
    title = f"Sections of the periodic motion of {subject(scene)}"
    return conform(
        made, SECTIONS, title=title, **attributes(scene), **facts, neighbour_distance=NEIGHBOUR * engine.rtol
    )


def section_period(scene: Scene) -> float:
    """Period of the sections [s], the run's length where the scene gives none; InputError where it does not fit in."""
    requested, span = scene.sections or Sections(), scene.time.end - scene.time.start
    period = requested.period or span
    if period > span * (1.0 + 1e-12):
        raise InputError(
            "[sections.period]",
            f"a period of {period:.6g} s is longer than the run, which defines the laws for {span:.6g} s",
            "let the run last a period at least",
        )
    if not requested.phase < period:
        raise InputError(
            "[sections.phase]",
            f"{requested.phase:.6g} s is no time within the period of {period:.6g} s",
            "give a time from 0 to below the period",
        )
    return period


@dataclass
class _Tape:
    """Recorded values, one entry per period, and per impact."""

    names: list[str]
    at: float
    motions: list[Variables] = field(default_factory=list)
    orbit: Variables = field(default_factory=dict)
    growth: list[float] = field(default_factory=list)
    lost: int = 0
    impacts: list[dict[str, np.ndarray]] = field(default_factory=list)
    open: dict[int, dict[str, np.ndarray]] = field(default_factory=dict)

    def add(self, parts: list[Engine], done: Period, number: int) -> None:
        """Keep of one period what is asked for."""
        self.growth.append(done.growth)
        self.lost += done.lost
        for part, trajectory in zip(parts, done.parts, strict=True):
            if part.start == self.at:
                self.motions.append(self._motion(part, trajectory, np.array([0])))
            if part.model.contacts:
                self._note(part, trajectory, number, parts[0].start)

    def motion_at_waypoints(self, parts: list[Engine], done: Period) -> Variables:
        """Motion of the recorded bodies where the stretches of a period begin."""
        first = np.array([0])
        motions = [self._motion(part, trajectory, first) for part, trajectory in zip(parts, done.parts, strict=True)]
        return {
            f"orbit_{name}": (("waypoint", *dims[1:]), _joined(motions, name)) for name, (dims, _) in motions[0].items()
        }

    def _motion(self, part: Engine, trajectory: Trajectory, rows: np.ndarray) -> Variables:
        """Motion of the recorded bodies, and the contacts' offsets, at some rows."""
        at_rows = replace(trajectory, rows=trajectory.rows[rows])
        seen, model = observed(part, at_rows), part.model
        series = motion_series(Motions(model, seen).several(self.names), model.mechanism.origin)
        if model.contacts:
            series["contact_offset"] = (("time", "contact", "axis"), seen.touch["offset"].copy())
        return series

    def _note(self, part: Engine, trajectory: Trajectory, number: int, begin: float) -> None:
        """Impacts of a stretch: those that begin in it, and of those that end in it force and duration."""
        closings = trajectory.events[trajectory.events["kind"] == m.CLOSING]
        new = closings[(closings["time"] >= part.start) & (closings["speed"] > IMPACT)]
        rows = np.clip(np.searchsorted(trajectory.time, new["time"]), 0, len(trajectory.time) - 1)
        series = self._motion(part, trajectory, rows) if len(new) else {}
        for k, event in enumerate(new):
            impact = {name: values[k] for name, (_, values) in series.items()}
            impact |= {"section": np.array(number), "phase": event["time"] - begin, "contact": event["contact"]}
            impact["approach_speed"] = event["speed"]
            self.impacts.append(impact)
            self.open[int(event["contact"])] = impact
        for event in closings[np.isfinite(closings["duration"])]:
            begun = self.open.get(int(event["contact"]))
            if begun is not None and "duration" not in begun:
                begun |= {"peak_force": event["peak_force"], "duration": event["duration"]}

    def packed(self) -> dict[str, np.ndarray]:
        """All of it so far as arrays."""
        arrays = {"growth": np.array(self.growth), "lost": np.array(self.lost)}
        for name in self.motions[0] if self.motions else ():
            arrays[f"motion.{name}"] = _joined(self.motions, name)
        for name in self.impacts[0] if self.impacts else ():
            if name not in LATER:
                arrays[f"impact.{name}"] = np.array([impact[name] for impact in self.impacts])
        arrays["ended"] = np.array(["duration" in impact for impact in self.impacts])
        arrays |= {f"later.{name}": self._column(name, np.nan) for name in LATER}
        last = {id(impact): k for k, impact in enumerate(self.impacts)}
        arrays["open"] = np.array([[c, last[id(impact)]] for c, impact in self.open.items()], int).reshape(-1, 2)
        return arrays

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Take up what `packed` gave."""
        self.growth, self.lost = arrays["growth"].tolist(), int(arrays["lost"])
        motion = _named(arrays, "motion.")
        self.motions = [{name: (_dimensions(name), values) for name, values in motion.items()}] if motion else []
        for k, ended in enumerate(arrays["ended"]):
            impact = {name: values[k] for name, values in _named(arrays, "impact.").items()}
            self.impacts.append(impact | ({name: arrays[f"later.{name}"][k] for name in LATER} if ended else {}))
        self.open = {int(c): self.impacts[k] for c, k in arrays["open"]}

    def variables(self, model: Model) -> Variables:
        """All of it, by the names of the schema SECTIONS."""
        kept = {
            name: (("section", *dims[1:]), _joined(self.motions, name)) for name, (dims, _) in self.motions[0].items()
        }
        kept |= {name: series for name, series in self.orbit.items() if name in SECTIONS}
        if not model.contacts:
            return kept
        kept["impact_section"] = (("impact",), self._column("section", -1).astype(np.int32))
        names = np.array([contact.name for contact in model.contacts], dtype=str)
        kept["impact_contact"] = (("impact",), names[self._column("contact", -1).astype(np.int64)])
        for name in ("phase", "approach_speed", "peak_force", "duration"):
            kept[f"impact_{name}"] = (("impact",), self._column(name, np.nan))
        for name in ("position", "quaternion", "velocity"):
            dims, first = self.motions[0][name]
            values = [impact[name] for impact in self.impacts]
            made = np.array(values).reshape(len(values), *first.shape[1:])
            kept[f"impact_{name}"] = (("impact", *dims[1:]), made)
        return kept

    def _column(self, name: str, absent: float) -> np.ndarray:
        return np.array([float(impact.get(name, absent)) for impact in self.impacts])


def _dimensions(name: str) -> tuple[str, ...]:
    """Of a series of the motion, see `motion_series`."""
    if name == "contact_offset":
        return ("time", "contact", "axis")
    return ("time", "body", "quat" if name == "quaternion" else "axis")


def _named(arrays: Mapping[str, np.ndarray], begin: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(begin): values for name, values in arrays.items() if name.startswith(begin)}


def _joined(motions: Iterable[Variables], name: str) -> np.ndarray:
    return np.concatenate([motion[name][1] for motion in motions])
