"""What is compared: mode sets and places of the prismatic joint, and the run that a case takes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pipeline
from pipeline.core.scene.schema import Scene
from pipeline.core.workflow.task import Task
from stages import s4_simulate
from stages.graph import Graph

SCENES = Path(__file__).parents[2] / "scenes" / "sps4"
ROD = "rod1"
#: frame of the rod that carries the prismatic joint, by its distance from the rod's lower end [mm]
PLACES = {0: "bottom", 60: "at_60mm", 120: "at_120mm"}
TOP = "top"
FULL, RIGID = "full", "rigid"
#: reference conditions, in the order of every table; the paper's two first
CONDITIONS = ("free-free", "fixed-fixed", "pinned-pinned", "cantilever", "craig-bampton")
#: coordinates that the sets are compared with, and at which convergence is looked at; a count that would cut a pair of
#: equal frequencies is raised to the next whole one
COUNT, COUNTS = 13, (7, 13, 25, 49)
#: of these, with ideal joints, where the full rod is there as well: a run costs with the third power of the count
FAR_COUNTS = (7, 13, 25)
#: in the scene with clearance, where each costs an ensemble
CLEARANCE_COUNTS = (7, 13, 25)
#: there, the most complete sets; the last is the reference, and by the one before it is told how far it is settled
MOST_COMPLETE = (25, 37)
#: ensembles of sets beyond COUNT have this share of the members: a run with 37 coordinates costs ten of those with 13
LARGE_SETS = 0.5
#: factors of the recipe's elements
FINER = (1, 2, 4)
#: times at which the assembled mechanism's frequencies are taken: the start and the full stroke [s]
TIMES = (0.0, 0.09)


@dataclass(frozen=True)
class Case:
    """One scene with one mode set.

    place: of the prismatic joint [mm].  condition: of the modes, FULL or RIGID.  finer: factor of the elements.
    """

    place: int
    condition: str
    count: int = COUNT
    clearance: bool = False
    finer: int = 1
    members: int = field(default=0)

    @property
    def label(self) -> str:
        """Name in progress reports and tables."""
        return self.condition if self.condition in (FULL, RIGID) else f"{self.condition} {self.count}"


def modes(case: Case) -> dict[str, Any]:
    """The scene's table of modes."""
    interfaces = [PLACES[case.place], TOP]
    if case.condition == FULL:
        return {"reference": "craig-bampton", "count": "all", "interfaces": interfaces}
    return {"reference": case.condition, "count": case.count, "interfaces": interfaces}


def scene(case: Case) -> Scene:
    """The paper's scene with the joint at the case's place and the rod of its mode set."""
    stem = "" if case.place == 0 else f"prismatic_{case.place}mm"
    folder = SCENES if case.place == 0 else SCENES / "variants"
    if case.condition == RIGID:
        name = "_".join(part for part in (stem, "csj" if case.clearance else "") if part) or "ideal"
        return pipeline.load_scene(folder / f"{name}.toml")
    name = "_".join(part for part in (stem, "far_csj_cb" if case.clearance else "far_cb") if part)
    changes: dict[str, Any] = {f"body.{ROD}.modes": modes(case)}
    if case.clearance:
        changes["ensemble.members"] = case.members
    return pipeline.load_scene(folder / f"{name}.toml", override=changes)


def task(case: Case) -> Task:
    """The run (or ensemble) of a case as a task of the store."""
    given = scene(case)
    graph = Graph(given, shown=False, recipe={"elements": case.finer} if case.finer != 1 else {})
    module = "benchmarks.reference_conditions.cases"
    return Task(
        stage="reference-conditions",
        scene=given.name,
        run=f"{module}:{'members' if case.clearance and case.condition != RIGID else 'single'}",
        params=s4_simulate.params(given, ensemble=case.clearance),
        inputs={f"bundle/{body}": _told_apart(made, case) for body, made in graph.bundle.items()},
        modules=(module, *s4_simulate.modules(given)),
        folder="",
        part=f"{case.place} mm, {case.label}" + (", clearance" if case.clearance else ""),
    )


def _told_apart(made: Task, case: Case) -> Task:
    """The task and its inputs under the case's name: progress is told by name, and many cases share a scene."""
    above = {name: _told_apart(task, case) for name, task in made.inputs.items()}
    return replace(made, scene=f"{made.scene}, {case.label}, elements x {case.finer}", inputs=above)
