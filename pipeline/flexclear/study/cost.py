"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from flexclear.dynamics.analyses import require_without_events
from flexclear.scene.load import edited
from flexclear.stages import kernels
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace
from flexclear.study import cost_design, members
from flexclear.study.members import POINT, Budget
from flexclear.system.errors import FlexclearError, SolverError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene

#: runs of another program: name, note, seconds [s] and errors [SI] by quantity, as of `work_precision.peers`
Track = dict[str, Any]
#: budget of a study [s of processor time]; time of a new set of kernels [s]
BUDGET, COMPILING = 80.0, 8.0
#: limit of a point's evaluations: so many times those of the scene's own run, or this fraction of the budget if more
MOST_EVALUATIONS = 10.0
#: number of skipped runs that are named
LISTED_RUNS = 6
#: table and figure of a study
TABLE, FIGURE = "price.md", "work_precision"


@dataclass
class Study:
    """A cost study while its points are computed, each from the cache where it exists.

    compiled: kernels, by what runs on them.
    evaluations: those of runs, by integrator and tolerance; at least so many where they were used up.  own,
    seconds_each: evaluations of the scene's own run, and the time of each.
    """

    scene: Scene
    workplace: Workplace
    budget: Budget
    integrators: Collection[str] = ()
    peers: Sequence[Track] = ()
    compiled: dict[tuple[str, ...], Task] = field(default_factory=dict)
    runs: dict[str, Task] = field(default_factory=dict)
    points: list[cost_design.Design] = field(default_factory=list)
    undone: list[cost_design.Design] = field(default_factory=list)
    evaluations: dict[str, dict[float, float]] = field(default_factory=dict)
    own: float = 0.0
    seconds_each: float = 0.0
    _complete: bool = False

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
            if design.scene.solver == same.scene.solver:
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
        known = {design.key for design in (*self.points, *self.undone)}
        more = [one for one in cost_design.wide(self.scene, self.integrators) if one.key not in known]
        self._queue(sorted(more, key=lambda d: d.evaluations(self.evaluations, self.own)))
        self._complete = True

    @property
    def _chosen(self) -> list[Quantity]:
        """Quantities of the scene's `[accuracy]`, else those that it watches."""
        return self.scene.requested_quantities() if self.scene.accuracy is not None else self.scene.watched_quantities()

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
                "quantities": [q.to_json() for q in self._chosen],
                "title": self.scene.title,
                "own": self.setting.attributes | {"flexible": int(bool(self.scene.flexible()))},
                "complete": self._complete and not self.undone,
                "undone": _listed([d.key for d in self.undone]),
                "peers": list(self.peers),
            },
            inputs=inputs,
            code=("flexclear.post",),
            folder=f"cost/{self.scene.name}",
            names={"nc": "cost.nc"},
        )

    def drawn(self) -> Made:
        """Return the study of the points so far, with its table and figure."""
        return self.workplace.made(self.task())[0]

    def _queue(self, designs: Sequence[cost_design.Design], part: float = 1.0) -> None:
        """Compute points in this order; skip those that a part of the budget or the limit of a point does not allow."""
        for design in (one for one in designs if one.key not in self.runs):
            evaluations = design.evaluations(self.evaluations, self.own)
            compiling = COMPILING if kernels.kernel_identity(design.scene) not in self.compiled else 0.0
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
        first, compiled = kernels.kernel_identity(design.scene) not in self.compiled, self._kernels(design)
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
        shared = kernels.kernel_identity(design.scene)
        if shared not in self.compiled:
            self.compiled[shared] = kernels.task(design.scene, Graph(design.scene, shown=False).bodies())
        return self.compiled[shared]


def bring(
    scene: Scene,
    workplace: Workplace,
    peers: Sequence[Track] = (),
    integrators: Collection[str] = (),
    *,
    budget: float = BUDGET,
    answered: Callable[[Made], None] = lambda made: None,
) -> Made:
    """Return the study of a scene with its table and figure, brought up to date as far as the budget [s] goes.

    peers: runs of other programs.  integrators: see `cost_design.wide`.  answered: called with
    the first answer. Raises InputError for a scene without quantities to measure.  Interrupted work leaves the answer
    so far.
    """
    study = Study(scene, workplace, Budget(budget), integrators, peers)
    study.first()
    answered(study.drawn())
    try:
        study.neighbourhood()
        study.beyond()
    except (KeyboardInterrupt, FlexclearError):
        with suppress(FlexclearError):
            study.drawn()
        raise
    return study.drawn()


def _listed(keys: Sequence[str]) -> str:
    """Return the first keys as text, and the number of the others."""
    more = f" and {len(keys) - LISTED_RUNS} more" if len(keys) > LISTED_RUNS else ""
    return "; ".join(keys[:LISTED_RUNS]) + more
