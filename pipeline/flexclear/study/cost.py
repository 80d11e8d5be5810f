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

from flexclear.scene.fields import Part
from flexclear.scene.load import edited
from flexclear.scene.validation_errors import input_errors
from flexclear.stages import kernels, scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace
from flexclear.study import cost_design
from flexclear.study.members import setting_of
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
#: budget of a study [s of processor time]; time of a run besides its integration, and of a new set of kernels [s]
BUDGET, POINT, COMPILING = 80.0, 0.6, 8.0
#: limit of a point's evaluations: so many times those of the scene's own run, or this fraction of the budget if more
MOST_EVALUATIONS = 10.0
#: number of skipped runs that are named
LISTED_RUNS = 6
#: tables of a study, in the order in which they are printed
PRINTED = ("price.md", "quantities.md", "causes.md", "statistics.md")
#: figure of a study, and its title
FIGURE, TITLE = "work_precision", "Error against cost"


@dataclass
class Study:
    """A cost study while its points are computed, each from the cache where it exists.

    seconds: processor time that the points may take; a point counts with the time of its computation.  models: True
    when other meshes, mode sets and beam theories take part.  compiled: kernels, by what runs on them. own,
    seconds_each: evaluations of the scene's own run, and the time of each.
    """

    scene: Scene
    workplace: Workplace
    seconds: float = BUDGET
    integrators: Collection[str] = ()
    models: bool = False
    peers: Sequence[Track] = ()
    compiled: dict[tuple[str, ...], Task] = field(default_factory=dict)
    runs: dict[str, Task] = field(default_factory=dict)
    points: list[cost_design.Design] = field(default_factory=list)
    undone: list[cost_design.Design] = field(default_factory=list)
    spent: float = 0.0
    #: part of the budget that is left for others
    reserve: float = 0.0
    evaluations: dict[str, dict[float, float]] = field(default_factory=dict)
    #: loosest tolerance at which a point used up its evaluations, by integrator
    used_up: dict[str, float] = field(default_factory=dict)
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

    def tighter(self) -> None:
        """Compute the point at a tenth of the scene's own tolerance or half of its step, if there is none yet."""
        self.begin()
        if self._neighbours[1].key not in self.runs:
            self._made(self._neighbours[1])

    @property
    def pair(self) -> list[Task]:
        """Tasks of the scene as it is and of the run by `tighter`."""
        return [self.runs[design.key] for design in self._neighbours[:2]]

    def first(self) -> None:
        """Compute the first few points in the neighbourhood of the scene's own setting."""
        self.begin()
        self._queue(self._neighbours[1 : cost_design.FIRST])

    def neighbourhood(self) -> None:
        """Compute the other points in the neighbourhood of the scene's own setting, as far as the budget goes."""
        self._queue(self._neighbours[cost_design.FIRST :])

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
        return setting_of(self.scene, self.workplace)

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
                "complete": self._complete and all(self._exhausted(design) for design in self.undone),
                "undone": _listed([d.key for d in self.undone if not self._exhausted(d)]),
                "given_up": _listed([d.key for d in self.undone if self._exhausted(d)]),
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
            if self.spent + self.own * self.seconds_each * (ensemble.members if ensemble else 1) > self.seconds:
                self.undone.append(design)
                continue
            task = _measured(design, "run_ensemble", {"quantities": names}, self._kernels(design))
            self.workplace.datasets(task)
            self._ensembles[f"ensemble:rtol {rtol:g}"] = task

    def _queue(self, designs: Sequence[cost_design.Design]) -> None:
        """Compute points in this order; skip those that the budget no longer allows."""
        for design in (one for one in designs if one.key not in self.runs):
            seconds = design.evaluations(self.evaluations, self.own) * self.seconds_each + POINT
            compiling = COMPILING if kernels.shared(design.scene) not in self.compiled else 0.0
            if self.spent + seconds + compiling > self.seconds - self.reserve or self._exhausted(design):
                self.undone.append(design)
            else:
                self._made(design)

    def _exhausted(self, design: cost_design.Design) -> bool:
        """Return True when the design's method used up its evaluations at the same or a looser tolerance."""
        solver = design.scene.solver
        return design.chooses_steps and solver.rtol <= self.used_up.get(solver.integrator, 0.0)

    def _made(self, design: cost_design.Design) -> xr.Dataset:
        """Return one point, brought up to date."""
        if self.own:
            limit = min(self.scene.solver.evaluations, self._evaluation_limit())
            design = replace(design, scene=edited(design.scene, {"solver.evaluations": limit}))
        names, first = [q.name for q in self._chosen], kernels.shared(design.scene) not in self.compiled
        compiled = self._kernels(design)
        task = _measured(design, "run", {"quantities": names, "brief": bool(self.points)}, compiled)
        record, *kernel = self.workplace.datasets(*([task, compiled] if first else [task]))
        self.spent += sum(float(one.attrs["compile_seconds"]) for one in kernel)
        self.runs[design.key] = task
        self.points.append(design)
        solver = design.scene.solver
        if "evaluations" in record.attrs.get("refused", ""):
            self.spent += POINT + self._evaluation_limit() * self.seconds_each
            if design.chooses_steps:
                self.used_up[solver.integrator] = max(solver.rtol, self.used_up.get(solver.integrator, 0.0))
        elif "refused" in record.attrs:
            self.spent += POINT
        else:
            self.spent += POINT + float(record["cpu_repeat"].sum()) + float(record.attrs["recording_seconds"])
            if design.chooses_steps:
                known = self.evaluations.setdefault(solver.integrator, {})
                known[solver.rtol] = float(record.attrs["evaluations"])
        return record

    def _evaluation_limit(self) -> int:
        """Return the evaluations that a point may take: 1, 2 or 5 times a power of ten, so that keys rarely change with
        budgets."""
        affordable = max(MOST_EVALUATIONS * self.own, self.seconds / self.seconds_each / MOST_EVALUATIONS, 1e5)
        below = 10 ** math.floor(math.log10(affordable))
        return next(factor * below for factor in (1, 2, 5, 10) if factor * below >= affordable)

    def _kernels(self, design: cost_design.Design) -> Task:
        shared = kernels.shared(design.scene)
        if shared not in self.compiled:
            self.compiled[shared] = kernels.task(design.scene, _bundles(design))
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
    study = Study(scene, workplace, budget, integrators, models, peers)
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
    from flexclear.post.cost.answer import Studied, advice

    path = f"{pictures}/{name.replace('/', '_')}_{FIGURE}.png"
    paragraph = advice(made.dataset(), tables(made))
    return Studied(name, paragraph, tables(made), {TITLE: path}), {path: f"{FIGURE}.png"}


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


def _bundles(design: cost_design.Design) -> dict[str, Task]:
    return Graph(design.scene, shown=False, recipe=design.recipe).bodies()


def _measured(design: cost_design.Design, function: str, more: Mapping[str, object], compiled: Task) -> Task:
    """Return a task of `stages.cost_point` on a design's scene."""
    ensemble = design.scene.ensemble is not None
    return Task(
        stage="cost-ensemble" if ensemble else "cost-point",
        scene=design.scene.name,
        part=design.key,
        run=f"flexclear.stages.cost_point:{function}",
        params={"simulate": simulation.params(design.scene, ensemble=ensemble), **more},
        inputs={**_bundles(design), "kernels": compiled},
        code=("flexclear.stages.kernels", *simulation.CODE),
        exclusive=True,
    )


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
