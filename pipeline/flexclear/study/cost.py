"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import Strict, ValidationError, model_validator

from flexclear.dynamics.analyses import require_without_events
from flexclear.scene.fields import Part
from flexclear.scene.load import edited
from flexclear.scene.validation_errors import input_errors
from flexclear.stages import kernels, scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace
from flexclear.study import cost_design, members
from flexclear.study.members import POINT, Budget
from flexclear.system.errors import FlexclearError, InputError, SolverError
from flexclear.system.external_files import require_file
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.post.cost.answer import Studied
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene

#: a `Peer` as tasks have it in their parameters
Track = dict[str, Any]
#: largest file of peers [bytes]
LARGEST_PEERS = 16 << 20
#: tolerances at which the ensembles of a scene are compared
ENSEMBLES = (1e-6, 1e-8, 1e-10)
#: budget of a study [s of processor time]; time of a new set of kernels [s]
BUDGET, COMPILING = 80.0, 8.0
#: limit of a point's evaluations: so many times those of the scene's own run, or this fraction of the budget if more
MOST_EVALUATIONS = 10.0
#: number of skipped runs that are named
LISTED_RUNS = 6
#: tables of a study, in the order in which they are printed
PRINTED = ("price.md", "causes.md", "statistics.md")
#: figure of a study, and its title
FIGURE, TITLE = "work_precision", "Error against cost"


@dataclass
class Study:
    """A cost study while its points are computed, each from the cache where it exists.

    models: True when other meshes, mode sets and beam theories take part.  compiled: kernels, by what runs on them.
    evaluations: those of runs, by integrator and tolerance; at least so many where they were used up.  own,
    seconds_each: evaluations of the scene's own run, and the time of each.
    """

    scene: Scene
    workplace: Workplace
    budget: Budget
    integrators: Collection[str] = ()
    models: bool = False
    peers: Sequence[Track] = ()
    compiled: dict[tuple[str, ...], Task] = field(default_factory=dict)
    runs: dict[str, Task] = field(default_factory=dict)
    points: list[cost_design.Design] = field(default_factory=list)
    undone: list[cost_design.Design] = field(default_factory=list)
    evaluations: dict[str, dict[float, float]] = field(default_factory=dict)
    own: float = 0.0
    seconds_each: float = 0.0
    _complete: bool = False
    _ensembles: dict[str, Task] = field(default_factory=dict)

    def begin(self) -> None:
        """Run the scene as it is, which predicts the time of other runs.

        Raises InputError, SolverError or ResourceError where it fails.
        """
        if self.points:
            return
        require_without_events(self.scene, "the cost of a run")
        record = self._made(self._neighbours[0])
        if "refused" in record.attrs:
            raise SolverError(f"{self.scene.name}: {record.attrs['refused']}")
        same = self._neighbours[0]
        for design in self._neighbours[1:]:
            if design.scene.solver == same.scene.solver and design.scene.output == same.scene.output:
                self.runs[design.key] = self.runs[same.key]  # one run, which is two points
                self.points.append(design)
        self.own = float(record.attrs["evaluations"])
        self.seconds_each = max(float(record["cpu_repeat"].median()) / self.own, 1e-9)

    def first(self, part: float = 1.0) -> None:
        """Compute the first few points in the neighbourhood of the scene's own setting, within a part of the budget."""
        self.begin()
        self._queue(self._neighbours[1 : cost_design.FIRST], part)

    def neighbourhood(self, part: float = 1.0) -> None:
        """Compute the other points in the neighbourhood of the scene's own setting, within a part of the budget."""
        self._queue(self._neighbours[cost_design.FIRST :], part)

    def beyond(self) -> None:
        """Compute the points farther away, the cheapest first, as far as the budget goes."""
        scene, more = self.scene, cost_design.wide(self.scene, self.integrators)
        if self.models and scene.flexible():
            bundles = scenes.bundles(scene, self.workplace, jobs=None).values()
            more += cost_design.models(scene, self.setting, max(float(one["frequency"].max()) for one in bundles))
        known = {design.key for design in (*self.points, *self.undone)}
        more = [design for design in more if design.key not in known]
        self._queue(sorted(more, key=lambda d: d.evaluations(self.evaluations, self.own)))
        self._complete = True

    @property
    def _chosen(self) -> list[Quantity]:
        """Quantities of the scene's `[accuracy]`, else those that it watches."""
        return self.scene.requested() if self.scene.accuracy is not None else self.scene.watched()

    @cached_property
    def _neighbours(self) -> list[cost_design.Design]:
        return cost_design.neighbours(self.scene, self.setting)

    @cached_property
    def setting(self) -> cost_design.Setting:
        """Integrator, tolerance and step of the scene's own run."""
        return members.setting_of(self.scene, self.workplace)

    def task(self) -> Task:
        """Return the task of the study of all points so far."""
        listed = [
            {"key": d.key, "group": d.group, "factors": dict(d.factors), "input": f"point{k}"}
            for k, d in enumerate(self.points)
        ]
        inputs = {f"point{k}": self.runs[d.key] for k, d in enumerate(self.points)}
        return Task(
            stage="cost",
            scene=self.scene.name,
            run="flexclear.stages.cost_study:run",
            params={
                "points": listed,
                "quantities": [q.written() for q in self._chosen],
                "title": self.scene.title,
                "own": self.setting.attributes | {"flexible": int(bool(self.scene.flexible()))},
                "complete": self._complete and not self.undone,
                "undone": _listed([d.key for d in self.undone]),
                "peers": list(self.peers),
            },
            inputs=inputs | self._ensembles,
            code=("flexclear.post",),
            folder=f"cost/{self.scene.name}",
            names={"nc": "cost.nc"},
        )

    def drawn(self) -> Made:
        """Return the study of the points so far, with its tables and figures."""
        return self.workplace.made(self.task())[0]

    def ensembles(self) -> None:
        """Compute the scene's ensemble, if it has one, at several tolerances, as far as the budget goes."""
        names, ensemble = [q.name for q in self._chosen], self.scene.ensemble
        for rtol in ENSEMBLES if ensemble is not None else ():
            change = edited(
                self.scene, {"solver.rtol": rtol, "solver.integrator": self.scene.solver.integrator, "accuracy": None}
            )
            design = cost_design.Design(f"ensemble, rtol {rtol:g}", "ensemble", {}, change)
            if not self.budget.allows(self.own * self.seconds_each * (ensemble.members if ensemble else 1)):
                self.undone.append(design)
                continue
            task = replace(
                members.point(design, names, self._kernels(design)),
                stage="cost-ensemble",
                run="flexclear.stages.cost_point:run_ensemble",
                params={"simulate": simulation.params(change, ensemble=True), "quantities": names},
            )
            self.workplace.datasets(task)
            self._ensembles[f"ensemble:rtol {rtol:g}"] = task

    def _queue(self, designs: Sequence[cost_design.Design], part: float = 1.0) -> None:
        """Compute points in this order; skip those that a part of the budget or the limit of a point does not allow."""
        for design in (one for one in designs if one.key not in self.runs):
            evaluations = design.evaluations(self.evaluations, self.own)
            compiling = COMPILING if kernels.shared(design.scene) not in self.compiled else 0.0
            allowed = self.budget.allows(evaluations * self.seconds_each + POINT + compiling, part)
            if not allowed or (design.chooses_steps and evaluations > self._evaluation_limit()):
                self.undone.append(design)
            else:
                self._made(design)

    def _made(self, design: cost_design.Design) -> xr.Dataset:
        """Return one point, brought up to date."""
        run, tight = None if self.own else Graph(self.scene, shown=False).simulate, None
        if self.points and design.key == self._neighbours[1].key:
            tight = members.tighter_design(self.scene, self.setting)
        if tight is not None:
            design = tight  # the same run as that of a comparison
        elif self.own:
            limit = min(self.scene.solver.evaluations, self._evaluation_limit())
            design = replace(design, scene=edited(design.scene, {"solver.evaluations": limit}))
        first, compiled = kernels.shared(design.scene) not in self.compiled, self._kernels(design)
        task = members.point(design, members.names_of(self.scene), compiled, run)
        record, *kernel = self.workplace.datasets(*([task, compiled] if first else [task]))
        self.runs[design.key] = task
        self.points.append(design)
        solver, limited = design.scene.solver, "evaluations" in record.attrs.get("refused", "")
        spent = POINT + sum(float(one.attrs["compile_seconds"]) for one in kernel)
        if limited:
            spent += self._evaluation_limit() * self.seconds_each
        elif "refused" not in record.attrs:
            spent += float(record["cpu_repeat"].sum()) + float(record.attrs["recording_seconds"])
        if design.chooses_steps and (limited or "refused" not in record.attrs):
            used = self._evaluation_limit() if limited else float(record.attrs["evaluations"])
            self.evaluations.setdefault(solver.integrator, {})[solver.rtol] = used
        self.budget.spent += spent
        return record

    def _evaluation_limit(self) -> int:
        """Return the evaluations that a point may take: 1, 2 or 5 times a power of ten, so that keys rarely change with
        budgets."""
        affordable = max(MOST_EVALUATIONS * self.own, self.budget.seconds / self.seconds_each / MOST_EVALUATIONS, 1e5)
        below = 10 ** math.floor(math.log10(affordable))
        return next(factor * below for factor in (1, 2, 5, 10) if factor * below >= affordable)

    def _kernels(self, design: cost_design.Design) -> Task:
        shared = kernels.shared(design.scene)
        if shared not in self.compiled:
            self.compiled[shared] = kernels.task(design.scene, members.bundles(design))
        return self.compiled[shared]


def bring(
    scene: Scene,
    workplace: Workplace,
    peers: Sequence[Track] = (),
    integrators: Collection[str] = (),
    *,
    budget: float = BUDGET,
    models: bool = False,
    answered: Callable[[Made], None] = lambda made: None,
) -> Made:
    """Return the study of a scene with its tables and figures, brought up to date as far as the budget [s] goes.

    peers: runs of other programs.  integrators: see `cost_design.wide`.  models: as of `Study`.  answered: called with
    the first answer. Raises InputError for a scene without quantities to measure.  Interrupted work leaves the answer
    so far.
    """
    study = Study(scene, workplace, Budget(budget), integrators, models, peers)
    study.first()
    answered(study.drawn())
    try:
        study.neighbourhood()
        study.beyond()
        study.ensembles()
    except (KeyboardInterrupt, FlexclearError):
        with suppress(FlexclearError):
            study.drawn()
        raise
    return study.drawn()


def tables(made: Made) -> tuple[str, ...]:
    """Return the existing tables of a study as Markdown."""
    return tuple(made.text(name) for name in PRINTED if name in made.record.files)


def figures_and_tables(name: str, made: Made, pictures: str) -> tuple[Studied, dict[str, str]]:
    """Return the section of a page on a scene, and the study's files of its pictures, by path relative to the page.

    made: as `bring` returned it.  pictures: folder for them next to the page.
    """
    from flexclear.post.cost.answer import Studied, sentences

    path = f"{pictures}/{name.replace('/', '_')}_{FIGURE}.png"
    return Studied(name, sentences(made.dataset()), tables(made), {TITLE: path}), {path: f"{FIGURE}.png"}


def write_page(studies: Mapping[str, Made], page: Path, options: str = "") -> None:
    """Write the page on accuracy, with its pictures in a folder of the same name next to it.

    studies: results of `bring`, by scene.  options: the command's other options.
    """
    from flexclear.post.cost.answer import markdown

    sections, files = list[Studied](), dict[str, bytes]()
    for name, made in studies.items():
        section, pictures = figures_and_tables(name, made, page.stem)
        sections.append(section)
        files |= {Path(path).name: made.read(file) for path, file in pictures.items()}
    scenes.write_page(page, markdown(tuple(sections), f"{page.as_posix()}{options}"), files)


def _listed(keys: Sequence[str]) -> str:
    """Return the first keys as text, and the number of the others."""
    more = f" and {len(keys) - LISTED_RUNS} more" if len(keys) > LISTED_RUNS else ""
    return "; ".join(keys[:LISTED_RUNS]) + more


class Peer(Part):
    """Points of another program, measured elsewhere: times [s], and errors [SI] by quantity, a list each."""

    name: str
    note: str = ""
    seconds: list[Annotated[float, Strict()]]
    error: dict[str, list[Annotated[float, Strict()]]]

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if any(len(errors) != len(self.seconds) for errors in self.error.values()):
            raise ValueError(f"'{self.name}' has {len(self.seconds)} times and a different number of errors")
        return self


def read_peers(path: Path) -> dict[str, list[Track]]:
    """Read the runs of other programs from a file, by scene.  InputErrors for a file that does not hold such runs."""
    where = f"--peer {path}"
    require_file(path, where)
    try:
        if path.stat().st_size > LARGEST_PEERS:
            raise ValueError(f"it is larger than {LARGEST_PEERS >> 20} MB")
        scenes = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(scenes, dict) or not all(isinstance(tracks, list) for tracks in scenes.values()):
            raise ValueError("it must be a table of scenes, each with a list of tracks")
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(where, f"cannot be read: {error}", "docs/accuracy/exudyn.json is one") from None
    return {
        scene: [_track(f"{where} [{scene}], track {k + 1}", track) for k, track in enumerate(tracks)]
        for scene, tracks in scenes.items()
    }


def _track(where: str, given: Any) -> Track:
    try:
        return Peer.model_validate(given).model_dump(mode="json", exclude_none=True)
    except ValidationError as error:
        raise input_errors(where, error, Peer) from None
