"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from flexclear.dynamics.analyses import require_without_events
from flexclear.scene.load import edited
from flexclear.stages import kernels, variant_runs
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace
from flexclear.study import cost_design, members
from flexclear.study.members import POINT, Budget
from flexclear.system.errors import FlexclearError, SolverError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene

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

    runs: tasks of the points by key.  undone: points that were skipped.  compiled: identities of compiled kernels.
    evaluations: those of runs, by integrator and tolerance; at least so many where they were used up.  own,
    seconds_each: evaluations of the scene's own run, and the time of each.
    """

    scene: Scene
    workplace: Workplace
    budget: Budget
    integrators: Collection[str] = ()
    compiled: set[tuple[str, ...]] = field(default_factory=set)
    runs: dict[str, Task] = field(default_factory=dict)
    points: list[cost_design.Design] = field(default_factory=list)
    undone: list[cost_design.Design] = field(default_factory=list)
    evaluations: dict[str, dict[float, float]] = field(default_factory=dict)
    own: float = 0.0
    seconds_each: float = 0.0
    _complete: bool = False

    @cached_property
    def setting(self) -> cost_design.Setting:
        """Integrator, tolerance and step of the scene's own run."""
        return members.setting_of(self.scene, self.workplace)

    @cached_property
    def _neighbours(self) -> list[cost_design.Design]:
        return cost_design.neighbours(self.scene, self.setting)

    def begin(self) -> None:
        """Run the scene as it is, which predicts the time of other runs.

        Raises InputError, SolverError or ResourceError where it fails.
        """
        if self.points:
            return
        require_without_events(self.scene, "the cost of a run")
        asis, *others = self._neighbours
        record = self._measure(asis)
        if "refused" in record.attrs:
            raise SolverError(f"{self.scene.name}: {record.attrs['refused']}")
        same = [design for design in others if design.scene.solver == asis.scene.solver]
        self.points += same  # one run, which is two points
        self.runs |= dict.fromkeys((design.key for design in same), self.runs[asis.key])
        self.own = float(record.attrs["evaluations"])
        self.seconds_each = max(float(record["cpu_repeat"].median()) / self.own, 1e-9)

    def measure_neighbours(self, part: float = 1.0, most: int | None = None) -> None:
        """Compute the first points, by default all, in the neighbourhood of the scene's own setting, within a part of
        the budget."""
        self.begin()
        self._measure_affordable(self._neighbours[1:most], part)

    def measure_others(self) -> None:
        """Compute the points farther away, the cheapest first, as far as the budget goes."""
        more = cost_design.all_methods(self.scene, self.integrators)
        self._measure_affordable(sorted(more, key=lambda d: d.evaluations(self.evaluations, self.own)))
        self._complete = True

    def task(self) -> Task:
        """Return the task of the study of all points so far."""
        own, *others = self.points
        chosen = self.scene.requested_quantities() if self.scene.accuracy is not None else None
        params = {
            "points": [{"key": d.key, **d.setting} for d in others],
            "quantities": [q.to_json() for q in chosen or self.scene.watched_quantities()],
            "title": self.scene.title,
            "own": {f"own_{name}": value for name, value in own.setting.items()},
            "complete": self._complete and not self.undone,
            "undone": _list_names([d.key for d in self.undone]),
        }
        inputs = {"own": self.runs[own.key]} | {f"point{k}": self.runs[d.key] for k, d in enumerate(others)}
        return members.comparing_task("cost", self.scene.name, params, inputs)

    def answer(self) -> Made:
        """Return the study of the points so far, with its table and figure."""
        return self.workplace.made(self.task())[0]

    def _measure_affordable(self, designs: Sequence[cost_design.Design], part: float = 1.0) -> None:
        """Compute new points in this order; skip those that a part of the budget or the limit of a point does not
        allow."""
        known = {*self.runs, *(design.key for design in self.undone)}
        for design in (one for one in designs if one.key not in known):
            evaluations = design.evaluations(self.evaluations, self.own)
            compiling = COMPILING if kernels.kernel_identity(design.scene) not in self.compiled else 0.0
            allowed = self.budget.allows(evaluations * self.seconds_each + POINT + compiling, part)
            if not allowed or (design.chooses_steps and evaluations > self._evaluation_limit()):
                self.undone.append(design)
            else:
                self._measure(design)

    def _measure(self, design: cost_design.Design) -> xr.Dataset:
        """Return one point, brought up to date."""
        run = None if self.own else Graph(self.scene, shown=False).simulate
        if self.own and (not self.points or design is not self._neighbours[1]):  # that one has a limit of its own
            limit = min(self.scene.solver.evaluations, self._evaluation_limit())
            design = replace(design, scene=edited(design.scene, {"solver.evaluations": limit}))
        task = variant_runs.measuring_task(design.scene, design.key, members.kept_names(self.scene), run)
        (record,) = self.workplace.datasets(task)
        self.compiled.add(kernels.kernel_identity(design.scene))
        self.runs[design.key] = task
        self.points.append(design)
        solver, limited = design.scene.solver, "evaluations" in record.attrs.get("refused", "")
        spent = POINT + float(record.attrs["compile_seconds"])
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


def measure_costs(
    scene: Scene,
    workplace: Workplace,
    integrators: Collection[str] = (),
    *,
    budget: float = BUDGET,
    first_answer: Callable[[Made], None] = lambda made: None,
) -> Made:
    """Return the study of a scene with its table and figure, brought up to date as far as the budget [s] goes.

    integrators: see `cost_design.all_methods`.  first_answer: called with it. Raises InputError for a scene without
    quantities to measure.  Interrupted work leaves the answer so far.
    """
    study = Study(scene, workplace, Budget(budget), integrators)
    study.measure_neighbours(most=cost_design.FIRST)
    first_answer(study.answer())
    try:
        study.measure_neighbours()
        study.measure_others()
    except (KeyboardInterrupt, FlexclearError):
        with suppress(FlexclearError):
            study.answer()
        raise
    return study.answer()


def _list_names(keys: Sequence[str]) -> str:
    """Return the first keys as text, and the number of the others."""
    more = f" and {len(keys) - LISTED_RUNS} more" if len(keys) > LISTED_RUNS else ""
    return "; ".join(keys[:LISTED_RUNS]) + more
