"""What is compared: mode sets of the rod, places of its prismatic joint, and the runs that this takes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks.layouts import FIRST, Layout, chosen, edits, family
from flexclear.commands.scenes import find_scene
from flexclear.pipeline.core.scene.load import load_scene, read_toml
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.workflow.task import Task
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes.solution import solve
from flexclear.stages import simulation
from flexclear.stages.graph import Graph

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
#: of these, those that are run: a run costs with the third power of the count, and with clearance is an ensemble
RUN_COUNTS = (7, 13, 25)
#: with clearance, the most complete sets; the last is the reference, and the one before it shows how far it is settled
MOST_COMPLETE = (25, 37)
#: ensembles of sets beyond COUNT have this share of the members: a run with 37 coordinates costs ten of those with 13
LARGE_SETS = 0.5
#: factors of the recipe's elements
FINER = (1, 2, 4)
#: layouts of the mechanism: that of the scenes, and every so manieth of the identified family on this grid [m]
LAYOUT_GRID, EVERY = 0.02, 10
#: there, the sets: the paper's two as few as it has them, and Craig-Bampton, of which the last represents the full rod
LAYOUT_SETS = (("free-free", 7), ("fixed-fixed", 7), ("craig-bampton", 13), ("craig-bampton", 25))
#: times at which the assembled mechanism's frequencies are taken: the start and the full stroke [s]
TIMES = (0.0, 0.09)


@dataclass(frozen=True)
class Case:
    """One scene with one mode set.

    place: of the prismatic joint [mm].  condition: of the modes, FULL or RIGID.  finer: factor of the elements.
    layout: of the mechanism, where it is not that of the scenes.
    """

    place: int
    condition: str
    count: int = COUNT
    clearance: bool = False
    finer: int = 1
    members: int = field(default=0)
    layout: Layout | None = None

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
    """The paper's scene in the case's layout, with the joint at its place and the rod of its mode set."""
    stem, folder = ("", "sps4") if case.place == 0 else (f"prismatic_{case.place}mm", "sps4/variants")
    moved: dict[str, Any] = {}
    if case.layout is not None:
        moved = edits(case.layout, flexible=case.condition != RIGID, along=1e-3 * case.place)
    if case.condition == RIGID:
        name = "_".join(part for part in (stem, "csj" if case.clearance else "") if part) or "ideal"
        return load_scene(find_scene(f"{folder}/{name}"), moved)
    name = "_".join(part for part in (stem, "far_csj_cb" if case.clearance else "far_cb") if part)
    changes = moved | {f"body.{ROD}.modes": modes(case)}
    if case.clearance:
        changes["ensemble.members"] = case.members
    return load_scene(find_scene(f"{folder}/{name}"), changes)


def task(case: Case) -> Task:
    """The run (or ensemble) of a case as a task of the store."""
    given = scene(case)
    graph = Graph(given, shown=False, recipe={"elements": case.finer} if case.finer != 1 else {})
    module = "benchmarks.reference_conditions.cases"
    return Task(
        stage="reference-conditions",
        scene=given.name,
        run=f"{module}:{'members' if case.clearance and case.condition != RIGID else 'single'}",
        params=simulation.params(given, ensemble=case.clearance),
        inputs={f"bundle/{body}": made for body, made in graph.bundle.items()},
        modules=(module, *simulation.modules(given)),
        folder="",
        part=f"{case.place} mm, {case.label}" + (", clearance" if case.clearance else ""),
    )


@cache
def rod(finer: int) -> xr.Dataset:
    """The paper's rod in cells."""
    recipe = read_toml(Path(scene(Case(0, FULL)).flexible()[ROD].mesh))
    return kind.build(recipe | {"elements": finer * recipe["elements"]})


@cache
def solved(case: Case) -> xr.Dataset:
    """Modes (schema MODES) of a case; InputError for counts that cut a pair."""
    table = modes(case)
    count = None if table["count"] == "all" else table["count"]
    return solve(rod(case.finer), table["reference"], count, table["interfaces"])


@cache
def is_whole(case: Case) -> bool:
    """Whether the count of a case cuts no pair of equal frequencies."""
    try:
        solved(case)
    except InputError as error:
        if "split a cluster" in str(error):
            return False
        raise
    return True


def whole(place: int, condition: str, count: int) -> int:
    """The least whole count that is not below `count`."""
    return next(n for n in itertools.count(count) if is_whole(Case(place, condition, n)))


def _sets(place: int) -> list[tuple[int, str, int]]:
    """Places, conditions and counts that are run wherever the joint is: all of COUNT, the paper's two of fewest."""
    sets = [(c, COUNT) for c in CONDITIONS] + [(c, 7) for c in CONDITIONS[:2]]
    return [(place, c, whole(place, c, n)) for c, n in sets]


def far() -> list[Case]:
    """Ideal joints: rigid, every condition, the full rod; at the first place in all counts and meshes."""
    found = []
    for place in PLACES:
        found += [Case(place, RIGID), Case(place, FULL), *(Case(*key) for key in _sets(place))]
    found += [Case(0, c, whole(0, c, n)) for c in CONDITIONS for n in RUN_COUNTS]
    found += [Case(0, "craig-bampton", COUNT, finer=n) for n in FINER]
    return list(dict.fromkeys(found))


def clearance(members: int) -> list[Case]:
    """Clearance at A1: likewise, as ensembles."""
    found = []
    for place in PLACES:
        found += [(place, RIGID, COUNT), *_sets(place)]
        found += [(place, "craig-bampton", whole(place, "craig-bampton", n)) for n in MOST_COMPLETE]
    for condition in ("free-free", "craig-bampton"):
        found += [(0, condition, whole(0, condition, n)) for n in RUN_COUNTS]
    return [Case(*key, clearance=True, members=_share(members, *key[1:])) for key in dict.fromkeys(found)]


@cache
def layouts() -> tuple[Layout, ...]:
    """The identified layout that is taken, members of its family by falling regularity, and last the first layout."""
    members = sorted(family(LAYOUT_GRID), key=lambda member: member.answer.condition)
    found = [chosen(family()), *members[::EVERY]]
    return (*(member.layout for member in found), FIRST)


def of_layout(layout: Layout, members: int) -> list[Case]:
    """All runs of one layout: ideal joints, then clearance; ensembles have half the members."""
    members = max(2, members // 2)
    sets = [(RIGID, COUNT), *((c, whole(0, c, n)) for c, n in LAYOUT_SETS)]
    far = [Case(0, *key, layout=layout) for key in sets]
    return far + [Case(0, *key, clearance=True, members=_share(members, *key), layout=layout) for key in sets]


def _share(members: int, condition: str, count: int) -> int:
    """Members of an ensemble: fewer where a run is dear; a rigid rod has one run."""
    if condition == RIGID:
        return 0
    # whole counts may lie a little above COUNT
    return members if count < MOST_COMPLETE[0] else max(2, round(LARGE_SETS * members))
