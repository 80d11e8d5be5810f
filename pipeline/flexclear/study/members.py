"""Variants of a scene x members -> the points of their watched quantities: each variant, member and tolerance run once.

`effects`, the answer on effects and `plan --verify` use these points. All variants run by the method and at the
tolerance of the scene's own run, which says those that the scene leaves open.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from flexclear.scene.integrators import DEFAULT, VIBRATING
from flexclear.scene.load import edited
from flexclear.scene.solver import of_run
from flexclear.stages import watched_quantities
from flexclear.stages.graph import Graph
from flexclear.study.cost_design import Setting

if TYPE_CHECKING:
    from flexclear.artifacts.points import Point
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene
    from flexclear.stages.workplace import Workplace
    from flexclear.workflow.task import Task

#: name of a variant
Name = TypeVar("Name", bound=Hashable)
#: tightest tolerance of members with contacts: their starts differ by a thousandth of the clearance
MEANS = 1e-7


@dataclass
class Members:
    """Members of variants that have run.

    chosen: the watched quantities. tasks: by variant, one for each batch of members. seconds: processor time of a run
    of each variant, and of compiling in its last batch [s].
    """

    workplace: Workplace
    chosen: Sequence[Quantity]
    tasks: dict[Hashable, list[Task]] = field(default_factory=dict)
    seconds: dict[Hashable, tuple[float, float]] = field(default_factory=dict)

    def points(self, variants: Mapping[Name, Scene], members: int) -> dict[Name, Point]:
        """Return the points of variants over this number of members; of one run where a variant has no contacts."""
        from flexclear.artifacts.effect_size import watched

        tasks = {name: watched_quantities.tasks(scene, self.chosen, members) for name, scene in variants.items()}
        made = iter(self.workplace.made(*(task for few in tasks.values() for task in few)))
        points = {}
        for name, few in tasks.items():
            batches = [next(made) for _ in few]
            stored = [batch.dataset() for batch in batches]
            last = stored[-1].attrs
            self.tasks[name] = [batch.task for batch in batches]
            self.seconds[name] = float(last["cpu_seconds"]) / float(last["members"]), float(last["compile_seconds"])
            points[name] = watched(stored, variants[name].owners(), self.chosen)
        return points


def setting_of(scene: Scene, workplace: Workplace) -> Setting:
    """Return integrator, tolerance and step of the scene's own run."""
    (run,) = workplace.datasets(Graph(scene, shown=False).simulate)
    return Setting(*of_run(scene.solver, scene.by_need(), run.attrs), scene.solver.step)


def with_setting(variant: Scene, setting: Setting, *, tight: bool = False) -> Scene:
    """Return a variant with the method and tolerance of its scene's own run. tight: also where means need no more than
    MEANS."""
    if setting.step is not None:
        return variant
    rigid = setting.integrator == VIBRATING and not variant.flexible()
    means = (variant.contacts() or variant.stop) and not tight
    rtol = max(setting.rtol, MEANS) if means else setting.rtol
    return edited(variant, {"solver.integrator": DEFAULT if rigid else setting.integrator, "solver.rtol": rtol})
