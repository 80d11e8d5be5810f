"""Joining of the phases of a run into one dataset, with all events in the table of events.

The state before an event is a row, at the last number before its time; the state after it is the next one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from flexclear.artifacts.coordinates import motion
from flexclear.artifacts.labelled import LabelledArray, LabelledArrays
from flexclear.artifacts.schema import RUN, conform_arrays
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.dataset import attributes, record_run, subject
from flexclear.dynamics.run import ledger
from flexclear.dynamics.run.run import Run
from flexclear.scene.schema import Scene

#: variables that accumulate from the start of the run
GROWING = re.compile(r".*_loss$|dissipated|drive_work|load_work|contact_impulse|wear_sliding_distance|wear_load_path")
#: variables that are zero where their part does not exist; all others are undefined there
NOTHING = re.compile(r".*(force|moment|power|load$|penetration|contact_(rate|elastic|sliding)|sliding_speed|redundant)")
#: attributes that are summed; of other numbers the largest counts
COUNTS = re.compile(r".*(evaluations|steps|projections|jacobians)$")
#: energies of a state
ENERGIES = ("kinetic", "potential", "elastic")
#: energies in the balance, and the drives' work
BOOKED = (*ENERGIES, "dissipated", "drive_work")
#: columns of the table of events that name its rows
EVENT_COORDS = ("event_time", "event_contact", "event_kind", "event_motion")
#: attributes of a whole dataset
UNIQUE = ("parameters", "references", "versions", "Conventions", "title", "source")


@dataclass(frozen=True)
class Happened:
    """Record of an event; impulse: on the coordinate that it holds or drives [N s or N m s], NaN for none or several.

    work: of the drives [J].  turns: True when the coordinate is an angle.
    """

    name: str
    kind: str
    time: float
    impulse: float = np.nan
    work: float = 0.0
    turns: bool = False


@dataclass(frozen=True)
class Phase:
    """A phase up to `end` [s]; without a run where the next event happens at once.

    begins, ends: energies by name [J].  coordinates: of joints at its end, by name [m or rad].
    exchanged: largest energy exchanged so far [J].  happened: the event at its end.
    """

    run: Run | None
    end: float
    begins: dict[str, float]
    ends: dict[str, float]
    coordinates: dict[str, float]
    exchanged: float = 0.0
    happened: Happened | None = None


def stored_energies(model: Model, seen: Observed) -> dict[str, np.ndarray]:
    """Return the energies over rows [J]; the potential refers to the world's origin, not to that of the kernels."""
    series = ledger.series(model, seen)
    made = {name: series[name][1] for name in ENERGIES}
    return {**made, "potential": made["potential"] + _energy_of_kernels_origin(model)}


def _energy_of_kernels_origin(model: Model) -> float:
    """Return the potential energy at the mechanism's origin relative to the world's [J]."""
    mass = sum(link.mass for link in model.links[1:])
    return -float(mass * model.gravity @ model.mechanism.origin)


def join_phases(scene: Scene, phases: Sequence[Phase], notes: Sequence[str]) -> LabelledArrays:
    """Return the dataset of a run with events (schema RUN); notes: sentences for its warnings."""
    runs = [phase.run for phase in phases if phase.run is not None]
    parts = [record_run(run) for run in runs]
    names = {dim: _names(parts, dim) for dim in dict.fromkeys(d for data in parts for d in data.sizes)}
    made, gaps = dict[str, LabelledArray](), set[str]()
    for name in dict.fromkeys(n for data in parts for n in data.variables):
        first = next(data[name] for data in parts if name in data)
        along = first.dims[0] if first.dims else ""
        if along == "event" or name.endswith("_units"):
            continue
        if along == "singular_pass":
            values = np.concatenate([data[name].values for data in parts if name in data])
        elif name == "time":
            values = _times([data["time"].values for data in parts])
        elif along == "time":
            values = _series(name, first, parts, names)
            gaps |= {name} if values.dtype.kind == "f" and not np.isfinite(values).all() else set()
        else:
            values = _constant_variable(name, along, first, parts, names)
        made[name] = LabelledArray(first.dims, values)
    _continue_turns(made, [len(data["time"].values) for data in parts])
    _balance(made, phases, [len(data["time"].values) for data in parts])
    coords = frozenset(name for data in parts for name in data.coords if name in made)
    table = _table(phases, parts)
    whole = LabelledArrays(made | table, coords | {n for n in table if n in EVENT_COORDS})
    facts = attributes(scene) | _facts(parts, notes)
    facts["events"] = "\n".join(_sentence(one, loss) for one, loss in _events(phases))
    schema = RUN | {name: replace(RUN[name], gaps=True) for name in gaps}
    return conform_arrays(whole, schema, title=f"Motion of {subject(scene)}", **facts)


def _events(phases: Sequence[Phase]) -> list[tuple[Happened, float]]:
    """Return all events, each with the energy that it takes from the mechanism [J]."""
    return [
        (one.happened, sum(one.ends[name] - other.begins[name] for name in ENERGIES) + one.happened.work)
        for one, other in pairwise(phases)
        if one.happened is not None
    ]


def _sentence(one: Happened, loss: float) -> str:
    impulse = "" if np.isnan(one.impulse) else f", impulse {one.impulse:.6g} {'N m s' if one.turns else 'N s'}"
    return f"{one.name}: {one.kind} at t = {one.time:.9g} s, {loss:.6g} J of energy lost{impulse}"


def _names(parts: Sequence[LabelledArrays], dim: str) -> list[Any]:
    """Return the entries of a dimension in any phase."""
    return list(dict.fromkeys(n for data in parts if dim in data.coords for n in data[dim].values.tolist()))


def _times(times: Sequence[np.ndarray]) -> np.ndarray:
    """Return the times of all rows [s]; the last one of a phase is just before the first one of the next."""
    made = [t.copy() for t in times]
    for one in made[:-1]:
        one[-1] = np.nextafter(one[-1], -np.inf)
    return np.concatenate(made)


def _series(
    name: str, first: LabelledArray, parts: Sequence[LabelledArrays], names: Mapping[str, list[Any]]
) -> np.ndarray:
    """Return a variable over the rows of all phases; NaN where it is undefined."""
    owner = first.dims[1] if len(first.dims) > 1 else ""
    grows = GROWING.fullmatch(name) is not None
    fill = 0.0 if grows or NOTHING.match(name) else np.nan
    shape = [
        len(names[owner]) if dim == owner and names[owner] else first.values.shape[k]
        for k, dim in enumerate(first.dims)
    ]
    made, total = list[np.ndarray](), np.zeros(shape[1:], dtype=first.values.dtype)
    for data in parts:
        values = np.full((len(data["time"].values), *shape[1:]), fill)
        if name in data and owner and names[owner]:
            values[:, [names[owner].index(one) for one in data[owner].values.tolist()]] = data[name].values
        elif name in data:
            values = data[name].values
        if grows:
            values = values + total
            total = values[-1]
        made.append(values)
    return np.concatenate(made)


def _constant_variable(
    name: str, dim: str, first: LabelledArray, parts: Sequence[LabelledArrays], names: Mapping[str, list[Any]]
) -> np.ndarray:
    """Return a variable without time: for each entry, its value in the first phase that has the entry."""
    if name == dim or not names.get(dim):
        return np.array(names[dim]) if names.get(dim) else first.values
    entries: dict[Any, Any] = {}
    for data in parts:
        if name in data:
            for entry, value in zip(data[dim].values.tolist(), data[name].values, strict=True):
                entries.setdefault(entry, value)
    return np.array([entries[entry] for entry in names[dim]])


def _continue_turns(made: dict[str, LabelledArray], rows: Sequence[int]) -> None:
    """Add the full turns of earlier phases to the angles of joints."""
    if "joint_position" not in made:
        return
    values, turning = made["joint_position"].values.copy(), made["coordinate_motion"].values == motion(True)
    for start in np.cumsum(rows)[:-1]:
        turns = np.round((values[start - 1] - values[start]) / (2.0 * np.pi))
        values[start:] += np.where(turning & np.isfinite(turns), 2.0 * np.pi * turns, 0.0)
    made["joint_position"] = LabelledArray(made["joint_position"].dims, values)


def _balance(made: dict[str, LabelledArray], phases: Sequence[Phase], rows: Sequence[int]) -> None:
    """Add the energies that events take and supply, refer the potential to one origin, and balance all phases."""
    taken, brought, lost, work, models = list[float](), list[float](), 0.0, 0.0, list[Model]()
    after = iter(_events(phases))
    for phase in phases:
        if phase.run is not None:
            models.append(phase.run.model)
            taken.append(lost)
            brought.append(work)
        happened, loss = next(after, (None, 0.0))
        lost, work = lost + loss, work + (happened.work if happened is not None else 0.0)
    raised = [_energy_of_kernels_origin(model) - _energy_of_kernels_origin(models[0]) for model in models]
    added = {"potential": raised, "dissipated": taken, "drive_work": brought}
    energy = {name: made[name].values + np.repeat(added.get(name, [0.0] * len(rows)), rows) for name in BOOKED}
    balance = sum(energy[name] for name in BOOKED[:-1]) - energy["drive_work"]
    balance = balance - (made["load_work"].values if "load_work" in made else 0.0)
    energy["energy_error"] = balance - balance[0]
    made.update({name: LabelledArray(("time",), values) for name, values in energy.items()})


def _table(phases: Sequence[Phase], parts: Sequence[LabelledArrays]) -> dict[str, LabelledArray]:
    """Return the table of events: of contacts in all phases, joined across scene events, and the scene's events."""
    listed = list[dict[str, Any]]()
    for data in parts:
        columns = [n for n in data.variables if n.startswith("event_") and not n.endswith("_units")]
        turning = dict(zip(data["contact"].values, data["contact_motion"].values, strict=True)) if columns else {}
        for k in range(data.sizes.get("event", 0)):
            one = {name: data[name].values[k] for name in columns}
            one["event_motion"] = turning[one["event_contact"]]
            if not _continues_closing(listed, one, float(data["time"].values[0])):
                listed.append(one)
    for happened, loss in _events(phases):
        mine = {"event_time": happened.time, "event_contact": happened.name, "event_kind": happened.kind}
        found = {"event_energy_loss": loss, "event_impulse": happened.impulse}
        listed.append({**mine, **found, "event_motion": motion(happened.turns)})
    listed.sort(key=lambda one: float(one["event_time"]))
    names = dict.fromkeys(name for one in listed for name in one)
    return {name: LabelledArray(("event",), np.array([one.get(name, np.nan) for one in listed])) for name in names}


def _continues_closing(listed: Sequence[dict[str, Any]], one: dict[str, Any], start: float) -> bool:
    """Return True when a closing at a phase's start continues one of the previous phase; complete the latter then."""
    same = [k for k in listed if k["event_contact"] == one["event_contact"] and k["event_kind"] == "closing"]
    if one["event_kind"] != "closing" or one["event_time"] != start or not same:
        return False
    last = same[-1]
    if np.isfinite(last["event_duration"]):
        return False
    last["event_duration"] = start + one["event_duration"] - last["event_time"]
    for name in ("event_peak_force", "event_peak_penetration"):
        last[name] = max(last[name], one[name])
    return True


def _facts(parts: Sequence[LabelledArrays], notes: Sequence[str]) -> dict[str, Any]:
    """Return the attributes of all phases: sums of counts, the largest of other numbers, all sentences."""
    facts: dict[str, Any] = {}
    for name in dict.fromkeys(n for data in parts for n in data.attrs):
        values = [data.attrs[name] for data in parts if name in data.attrs]
        if name in UNIQUE:
            continue
        if isinstance(values[0], str):
            facts[name] = "\n".join(dict.fromkeys(line for text in values for line in text.split("\n") if line))
        else:
            facts[name] = sum(values) if COUNTS.fullmatch(name) else max(values)
    facts["warnings"] = "\n".join(dict.fromkeys([*filter(None, [facts.get("warnings", "")]), *notes]))
    return facts
