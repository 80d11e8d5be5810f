"""Variants of a scene x members -> the points of their watched quantities: each variant, member and tolerance run once.

`effects`, the answer on effects and `plan --verify` are strategies upon these points: which variants, until when. All
variants run by the method and at the tolerance of the scene's own run, which says those that the scene leaves open.
One `Budget` counts the runs of a study, those of its costs as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from flexclear.scene.integrators import DEFAULT, VIBRATING
from flexclear.scene.load import edited
from flexclear.scene.solver import of_run
from flexclear.stages import variant_runs
from flexclear.stages.graph import Graph
from flexclear.study.cost_design import TIGHTEST, Setting, neighbours
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    from flexclear.artifacts.points import Point
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene
    from flexclear.stages.workplace import Workplace

#: name of a variant
Name = TypeVar("Name", bound=Hashable)
#: numbers of members that are tried until a comparison is decided
MEMBERS = variant_runs.BATCHES
#: processor time of a run besides its integration [s]
POINT = 0.6
#: tightest tolerance of members with contacts: their starts differ by a thousandth of the clearance, which is more than
#: this tolerance of the mechanism's size
MEANS = 1e-6


@dataclass(frozen=True)
class ErrorRuns:
    """Runs whose distance is the error of the time integration of members.

    runs: ``own``, the scene's, and ``tight``, at a tighter tolerance (`variant_runs.measure`); empty without one.
    looser: the members' tolerance as a multiple of the scene's, to which their errors are proportional.
    """

    runs: Mapping[str, Task]
    looser: float = 1.0


@dataclass
class Budget:
    """Processor time that runs may take, and have taken [s]; stored ones count as when they were made."""

    seconds: float = math.inf
    spent: float = 0.0

    def allows(self, seconds: float, part: float = 1.0) -> bool:
        """Return True when runs of this time [s] fit into what is left of a part of the budget."""
        return self.spent + seconds <= part * self.seconds


@dataclass
class Members:
    """Members of variants that have run.

    chosen: the watched quantities. own: processor time of the scene's own run [s], which predicts the first ones.
    tasks: by variant, one for each batch of members. seconds: processor time of a run of each variant [s]. known:
    number of members of each variant. refused: variants that the solver refused.
    """

    workplace: Workplace
    chosen: Sequence[Quantity]
    budget: Budget = field(default_factory=Budget)
    own: float = 0.0
    tasks: dict[Hashable, list[Task]] = field(default_factory=dict)
    seconds: dict[Hashable, float] = field(default_factory=dict)
    known: dict[Hashable, int] = field(default_factory=dict)
    refused: set[Hashable] = field(default_factory=set)

    def until_decided(
        self,
        variants: Mapping[Name, Scene],
        levels: Sequence[int],
        undecided: Callable[[int, Mapping[Name, Point]], Collection[Name]],
    ) -> dict[Name, int]:
        """Compare variants with the first one, over more members until each is decided or the budget is spent.

        levels: rising numbers of members.  undecided: returns the variants that need more, from their number and
        points.  Return the number of members of each variant that has run, at least of one.
        """
        full, *waiting = variants
        reached = dict[Name, int]()
        for members in levels:
            rest = self.budget.seconds - self.budget.spent - self._predict(full, variants[full], members)
            chosen = list[Name]()
            for name in waiting:
                more = self._predict(name, variants[name], members)
                rest -= more
                if rest >= 0.0 or not more or not (reached or chosen):
                    chosen.append(name)
            if not chosen:
                break
            points = self.points({name: variants[name] for name in (full, *chosen)}, members)
            reached |= dict.fromkeys(chosen, members)
            still = undecided(members, points)
            waiting = [name for name in chosen if name in still]
        return reached

    def _predict(self, name: Hashable, scene: Scene, members: int) -> float:
        """Return the predicted processor time of the members of a variant that have not run [s]."""
        runs = (members if scene.contacts() or scene.stops() else 1) - self.known.get(name, 0)
        return runs * self.seconds.get(name, self.own) + POINT if runs > 0 else 0.0

    def points(self, variants: Mapping[Name, Scene], members: int) -> dict[Name, Point]:
        """Return the points of variants over this number of members; of one run where a variant has no contacts."""
        from flexclear.artifacts.effect_size import point_of_members

        tasks = {name: variant_runs.member_tasks(scene, self.chosen, members) for name, scene in variants.items()}
        made = iter(self.workplace.made(*(task for few in tasks.values() for task in few)))
        points = {}
        for name, few in tasks.items():
            batches = [next(made) for _ in few]
            stored = [batch.dataset() for batch in batches]
            last = stored[-1].attrs
            self.tasks[name] = [batch.task for batch in batches]
            self.seconds[name] = float(last["cpu_seconds"]) / float(last["members"])
            if predicted := self._predict(name, variants[name], members):
                self.budget.spent += predicted + float(last["compile_seconds"])
            self.known[name] = max(members, self.known.get(name, 1))
            points[name] = point_of_members(stored, variants[name].owners(), self.chosen)
            if points[name].refused and name not in self.refused:
                self.refused.add(name)
                del self.known[name], self.seconds[name]  # of a run that is repeated
        return points


def comparing_task(
    stage: str, scene: str, params: Mapping[str, Any], inputs: Mapping[str, Task], run: str = "", folder: str = ""
) -> Task:
    """Return a task that compares the runs of a study, and shows ``<stage>.nc`` with its table and figure.

    scene: its name.  run: function of `flexclear.stages`, by default that of the stage's name in `stages.studies`.
    folder: name below that of the stage, by default the scene's.
    """
    return Task(
        stage=stage,
        scene=scene,
        run=f"flexclear.stages.{run or f'studies:{stage}'}",
        params=params,
        inputs=inputs,
        code=("flexclear.post",),
        folder=f"{stage}/{folder or scene}",
        names={"nc": f"{stage}.nc"},
    )


def setting_of(scene: Scene, workplace: Workplace) -> Setting:
    """Return integrator, tolerance, step and evaluations of the scene's own run."""
    (run,) = workplace.datasets(Graph(scene, shown=False).simulate)
    own = of_run(scene.solver, scene.by_need(), run.attrs)
    return Setting(*own, scene.solver.step, int(run.attrs["evaluations"]))


def kept_names(scene: Scene, others: Iterable[Quantity] = ()) -> list[str]:
    """Return the quantities that the points of a scene keep: requested, watched, and `others` that it has."""
    owners = scene.owners()
    asked = scene.requested_quantities() if scene.accuracy is not None else []
    return list(dict.fromkeys(q.name for q in (*asked, *scene.watched_quantities(), *others) if q.is_there(owners)))


def tighter_run(scene: Scene, own: Setting, others: Iterable[Quantity] = ()) -> Task | None:
    """Return the run at a tenth of the tolerance of the scene's run, or half its step: its distance from the scene's
    run is the run's error. None where no tolerance is tighter."""
    design = neighbours(scene, own)[1]
    if own.step is None and design.scene.solver.rtol >= own.rtol:
        return None
    return variant_runs.measuring_task(design.scene, design.key, kept_names(scene, others))


def error_runs(scene: Scene, own: Setting) -> ErrorRuns:
    """Return the runs from which the error of members' integration follows."""
    task = tighter_run(scene, own)
    if task is None:
        return ErrorRuns({})
    rtol = with_setting(scene, own).solver.rtol
    return ErrorRuns(
        {"own": Graph(scene, shown=False).simulate, "tight": task}, rtol / own.rtol if own.step is None else 1.0
    )


def with_setting(variant: Scene, setting: Setting, *, tight: bool = False) -> Scene:
    """Return a variant with the method and tolerance of its scene's own run, or MEANS where means need no more.

    tight: with a tenth of that run's tolerance or half its step.
    """
    if setting.step is not None:
        return edited(variant, {"solver.step": 0.5 * setting.step}) if tight else variant
    rigid = setting.integrator == VIBRATING and not variant.flexible()
    means = variant.contacts() or variant.stops()
    rtol = max(setting.rtol, MEANS) if means else setting.rtol
    rtol = max(0.1 * setting.rtol, TIGHTEST) if tight else rtol
    return edited(variant, {"solver.integrator": DEFAULT if rigid else setting.integrator, "solver.rtol": rtol})
