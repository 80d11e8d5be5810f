"""The plan of a sweep: its points checked, grouped by the flexible bodies that they need, and named by content."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts import points as results
from flexclear.artifacts.points import Point
from flexclear.artifacts.quantities import regular_times
from flexclear.artifacts.store import FAMILY, Record, Store
from flexclear.scene import toml_files
from flexclear.scene.limits import check_members, require_scatter
from flexclear.scene.load import edited, with_numbers
from flexclear.scene.quantity import Recorded, parse_recorded
from flexclear.scene.schema import Scene, Sections
from flexclear.scene.sweep import Axis, Design, Sweep, design
from flexclear.stages import simulation
from flexclear.stages.graph import Graph
from flexclear.stages.sweeps.sweep_engine import Job
from flexclear.stages.sweeps.sweep_points import Work
from flexclear.stages.workplace import Workplace, check
from flexclear.system.errors import InputError
from flexclear.system.machine import instruction_set
from flexclear.workflow.task import Task, facts, key

#: up to so many numeric values of a parameter are all checked beforehand; of more, the smallest and the largest
CHECKED = 200
#: key paths that set the output times, which all points of one series share
TIMES = ("time.start", "time.end", "output.interval")
#: key paths that set the number of sections
COUNTS = ("sections.periods",)
#: stands for varied values in the facts of a family
VARIED = "varied"


@dataclass(frozen=True)
class Family:
    """Points that share their flexible bodies: the work given to workers, and the facts that decide all results."""

    work: Work
    facts: Mapping[str, str]

    @property
    def key(self) -> str:
        """Digest of the facts."""
        return self.work.key

    @property
    def folder(self) -> tuple[str, str]:
        """Stage of the family's batches in the store, and a name there that no batch has."""
        return f"sweep/{self.key}", FAMILY

    def keep(self, points: Mapping[str, Point], store: Store, recorded: Sequence[Recorded], here: bool = True) -> None:
        """Store finished points as one artifact. here: whether this machine computed them."""
        name = hashlib.sha256("".join(sorted(points)).encode()).hexdigest()[:32]
        batch, computed_by = results.dataset_of_batch(points, recorded), instruction_set() if here else None
        store.put(self.folder[0], name, {"nc": batch}, self.facts, computed_by)

    def find(self, store: Store, recorded: Sequence[Recorded]) -> dict[str, Point]:
        """Return all points of the family in sound stored batches, with their values of the `recorded` quantities."""
        points_by_key: dict[str, Point] = {}
        for _, batch in self.batches(store):
            points_by_key |= results.unpack_points(batch, recorded)
        return points_by_key

    def batches(self, store: Store) -> Iterator[tuple[Record, xr.Dataset]]:
        """Yield the sound batches that `keep` has stored, with their records."""
        for path in sorted((store.root / "cache" / self.folder[0]).glob("*.json")):
            record = store.find(self.folder[0], path.stem)
            if record is not None:
                yield record, store.load(record)


@dataclass(frozen=True)
class Plan:
    """A sweep whose key paths, values and quantities have been checked against its scene.

    scene: with the sweep's `set` values, at the first point. families, jobs: filled by `prepare`, once the flexible
    bodies exist.
    """

    sweep: Sweep
    scene: Scene
    design: Design
    recorded: tuple[Recorded, ...]
    families: tuple[Family, ...] = ()
    jobs: tuple[Job, ...] = ()

    def dataset(self, points: Mapping[str, Point]) -> xr.Dataset:
        """Return the sweep's dataset of the finished points."""
        attributes: dict[str, str | int] = {"sweep": self.sweep.name, "scene": self.scene.name}
        attributes |= {"title": self.sweep.title} if self.sweep.title else {}
        attributes |= {"set": json.dumps(self.sweep.set, sort_keys=True)} if self.sweep.set else {}
        attributes |= {"members": self.sweep.members} if self.sweep.members else {}
        keys = [job.key for job in self.jobs]
        return results.dataset(
            self.design,
            self.recorded,
            keys,
            points,
            self.time,
            self.sections,
            attributes,
            self.statistics,
        )

    def rows(self, first: int, last: int) -> Plan:
        """Return the part of the plan with entries `first` to `last` (excluded) of the first dimension."""
        axes, each = self.design.axes, prod(self.design.shape[1:])
        cut = [replace(axis, values=axis.values[first:last]) for axis in (axes[:1] if self.design.grid else axes)]
        part = Design((*cut, *axes[len(cut) :]), self.design.grid)
        return replace(self, design=part, jobs=self.jobs[first * each : last * each])

    @property
    def time(self) -> np.ndarray:
        """Times of the recorded series [s]."""
        return regular_times(self.scene.time, self.scene.output)

    @property
    def sections(self) -> int:
        """Number of sections per point, where sections are recorded."""
        return (self.scene.sections or Sections()).periods

    @property
    def statistics(self) -> list[str]:
        """Names of the requested ones among `points.STATISTICS`."""
        asked = {"values": True, "error": self.sweep.error, "deviation": self.sweep.members}
        return [statistic for statistic, requested in asked.items() if requested]


def plan(sweep: Sweep, scene: Scene, where: str) -> Plan:
    """Return the plan of a sweep after checking all of it, before anything is run.

    where: the sweep's file, for messages. Raises InputError for key paths that the scene does not have, values that it
    refuses, and quantities that none of its components has.
    """
    try:
        base = edited(scene, {**sweep.set, "accuracy": None}) if sweep.set else edited(scene, {"accuracy": None})
    except InputError as error:
        raise _error_at(f"{where} [set]", error) from None
    check_members(sweep.members or 0, base.limits, f"{where} [members]")
    sweep_design = design(sweep)
    _check_values(base, sweep_design, where)
    base = edited(base, sweep_design.points()[0])
    try:
        simulation.check_parts(simulation.params(base))
    except InputError as error:
        raise toml_files.with_line_number(toml_files.with_file_name(error, base.path)) from None
    recorded = tuple(_parse_kept_value(base, name, where) for name in sweep.keep)
    _check_recorded(sweep, base, sweep_design, recorded, where)
    _check_units(base, sweep_design, recorded, where)
    return Plan(sweep, base, sweep_design, recorded)


def _error_at(where: str, error: InputError) -> InputError:
    problem, remedy = getattr(error, "problem", str(error)), getattr(error, "remedy", None)
    return InputError(where, problem, remedy)


def _check_values(base: Scene, sweep_design: Design, where: str) -> None:
    """Raise InputError for a value that the scene refuses; of a sample with many points the extreme ones are examined.

    In a grid each value is combined with the first values of the other parameters: whether all combinations suit the
    mechanism is known only when they are run.
    """
    points = sweep_design.points()
    try:
        edited(base, points[0])
    except InputError as error:
        raise _error_at(f"{where} [vary{_refused_parameter(base, sweep_design)}]", error) from None
    for axis in sweep_design.axes:
        for k in _checked_indices(axis):
            chosen = points[k] if not sweep_design.grid else points[0] | dict.fromkeys(axis.places, axis.values[k])
            try:
                with_numbers(base, chosen)
            except InputError as error:
                raise _error_at(f"{where} [vary.{axis.name}]", error) from None


def _refused_parameter(base: Scene, sweep_design: Design) -> str:
    """Return the parameter whose first value the scene refuses on its own, after a dot; or an empty string."""
    for axis in sweep_design.axes:
        try:
            edited(base, dict.fromkeys(axis.places, axis.values[0]))
        except InputError:
            return f".{axis.name}"
    return ""


def _checked_indices(axis: Axis) -> Sequence[int]:
    numbers = axis.coordinate
    if len(numbers) <= CHECKED or isinstance(numbers[0], str):
        return range(len(numbers))
    by_size = sorted(range(len(numbers)), key=lambda k: numbers[k])
    return by_size[0], by_size[-1]


def _parse_kept_value(base: Scene, name: str, where: str) -> Recorded:
    try:
        return parse_recorded(name, base.owners())
    except ValueError as error:
        raise InputError(f"{where} [keep]", str(error)) from None


def _check_recorded(sweep: Sweep, base: Scene, sweep_design: Design, recorded: Sequence[Recorded], where: str) -> None:
    varied = {path for axis in sweep_design.axes for path in axis.places}
    timed = sorted(varied & set(TIMES))
    for one in recorded:
        if one.reduction == "series" and timed:
            raise InputError(
                f"{where} [keep]",
                f"'{one.name}' is a series, which needs equal output times at all points, but {timed[0]} is varied",
                "record one number, such as the final or the largest value",
            )
        if one.reduction == "sections" and varied & set(COUNTS):
            raise InputError(f"{where} [vary.{COUNTS[0]}]", "points would have different numbers of sections", "set it")
    sections = [one.reduction == "sections" for one in recorded]
    if any(sections) and not (all(sections) and not sweep.members and not sweep.error):
        raise InputError(
            f"{where} [keep]",
            "sections follow one motion over many periods: runs of one period, members "
            "and estimated errors are not possible with them",
            "record sections only, or split it into two sweeps",
        )
    if sweep.members:
        require_scatter(base, f"{where} [members]")
    if sweep.members and any(one.quantity.kind == "orientation" for one in recorded):
        raise InputError(f"{where} [keep]", "orientations have no mean over members", "record a position instead")
    if sweep.error and base.solver.step is not None:
        raise InputError(
            f"{where} [error]", "the scene has fixed steps, on which a tolerance has no effect", "vary solver.step"
        )


def _check_units(base: Scene, sweep_design: Design, recorded: Sequence[Recorded], where: str) -> None:
    """Raise InputError for a quantity whose unit differs between points."""
    for axis, scene in _scenes_with_text_values(base, sweep_design):
        for one in recorded:
            if _parse_kept_value(scene, one.name, where).unit != one.unit:
                raise InputError(
                    f"{where} [vary.{axis.name}]",
                    f"'{one.name}' is a force at some points and a torque at others",
                    "split it into two sweeps",
                )


def _scenes_with_text_values(base: Scene, sweep_design: Design) -> Iterator[tuple[Axis, Scene]]:
    """Yield the scene at a point for each value that is text, and so may name other parts."""
    points = sweep_design.points()
    for axis in sweep_design.axes:
        texts = list(map(str, axis.values)) if isinstance(axis.coordinate[0], str) else []
        for k in (texts.index(text) for text in dict.fromkeys(texts)):
            chosen = points[0] | dict.fromkeys(axis.places, axis.values[k]) if sweep_design.grid else points[k]
            yield axis, edited(base, chosen)


def prepare(requested: Plan, workplace: Workplace) -> Plan:
    """Bring the flexible bodies up to date; return the plan with its families and with its points by key."""
    points = requested.design.points()
    groups = dict(_group(requested.scene, point) for point in points)
    graphs = {text: Graph(edited(requested.scene, first), shown=False) for text, first in groups.items()}
    outcome = workplace.bring([task for graph in graphs.values() for task in graph.simulate.inputs.values()])
    check(outcome)
    families = {}
    for text, graph in graphs.items():
        records = {name: outcome.records[task] for name, task in graph.simulate.inputs.items()}
        sections = any(one.reduction == "sections" for one in requested.recorded)
        simulate = simulation.params(graph.scene, sections=sections)
        task = Task(
            stage="sweep",
            scene=graph.scene.name,
            run="flexclear.stages.sweeps.sweep_points:work",
            params={
                "simulate": _without_varied(simulate, points[0], groups[text]),
                "keep": [one.name for one in requested.recorded],
                "members": requested.sweep.members or 0,
                "error": requested.sweep.error,
            },
            code=simulation.CODE,
        )
        given = facts(task, {name: record.digest for name, record in records.items()}, workplace.sources)
        inputs = {name: workplace.store.load(record) for name, record in records.items()}
        keep = tuple(one.name for one in requested.recorded)
        limited = {**simulate, "limits": graph.scene.limits.as_table()}  # limits are no facts; a point may raise them
        work = Work(key(given), limited, inputs, keep, requested.sweep.members or 0, requested.sweep.error)
        families[text] = Family(work, given)
    jobs = []
    for point in points:
        text, own = _group(requested.scene, point)
        family = families[text].key
        # values that decide the bodies are already in the family's scene, whose bodies are numbers
        rest = {name: value for name, value in point.items() if name not in own}
        content = json.dumps([family, dict(sorted(point.items()))], default=str)
        jobs.append(Job(hashlib.sha256(content.encode()).hexdigest()[:32], family, rest))
    return replace(requested, families=tuple(families.values()), jobs=tuple(jobs))


def _group(scene: Scene, point: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the values of a point that decide the bodies which recipes describe: as text, and by key path."""
    bodies = tuple(f"body.{name}." for name in scene.recipes())
    mine = {where: value for where, value in point.items() if where.startswith(bodies)} if bodies else {}
    return json.dumps(mine, sort_keys=True, default=str), mine


def _without_varied(simulate: Mapping[str, Any], point: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a run without the values that differ between points, so that a sweep can be extended.

    own: values that all points of the family share.
    """
    table = copy.deepcopy(dict(simulate))
    for where in point:
        node, keys = table["scene"], where.split(".")
        for name in keys[:-1]:
            node = node[int(name) if isinstance(node, list) else name]
        if where not in own:
            node[int(keys[-1]) if isinstance(node, list) else keys[-1]] = VARIED
    return table
