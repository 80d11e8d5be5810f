"""Mode sets of the rod that are compared, positions of its prismatic joint, and the runs of the comparison."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks.layouts import FIRST, Layout, by_condition, chosen, edits, family
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.toml_files import read_toml
from flexclear.stages import simulation
from flexclear.stages.graph import Graph
from flexclear.stages.scenes import find_scene
from flexclear.structure.kinds import kind
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError
from flexclear.workflow.task import Task

ROD = "rod1"
#: frame of the rod that carries the prismatic joint, by its distance from the rod's lower end [mm]
PLACES = {0: "bottom", 60: "at_60mm", 120: "at_120mm"}
TOP = "top"
FULL, RIGID = "full", "rigid"
#: reference conditions, in the order of every table; the paper's two first
CONDITIONS = ("free-free", "fixed-fixed", "pinned-pinned", "cantilever", "craig-bampton")
#: number of modal coordinates in the comparison, and those of the convergence study; a count that would cut a pair of
#: equal frequencies is raised to the next whole one
COUNT, COUNTS = 13, (7, 13, 25, 49)
#: counts of COUNTS that are simulated: the cost of a run grows with their third power, and clearance needs ensembles
RUN_COUNTS = (7, 13, 25)
#: largest counts with clearance; the last is the reference, and its difference from the other shows the convergence
MOST_COMPLETE = (25, 37)
#: fraction of the members in ensembles of these largest sets: a run with 37 coordinates costs ten of those with 13
LARGE_SETS = 0.5
#: factors of the recipe's number of elements
FINER = (1, 2, 4)
#: grid [m] of the identified family of layouts, and the stride at which its members are taken
LAYOUT_GRID, EVERY = 0.02, 10
#: mode sets of these layouts: the paper's two with its fewest coordinates; the last one represents the full rod
LAYOUT_SETS = (("free-free", 7), ("fixed-fixed", 7), ("craig-bampton", 13), ("craig-bampton", 25))
#: times of the assembled mechanism's frequencies [s]: start and full stroke
TIMES = (0.0, 0.09)


@dataclass(frozen=True)
class Case:
    """One scene with one mode set.

    place: position of the prismatic joint [mm].  condition: reference condition of the modes, FULL or RIGID.  finer:
    factor of the number of elements.  layout: of the mechanism, where it differs from that of the scenes.
    """

    place: int
    condition: str
    count: int = COUNT
    clearance: bool = False
    finer: int = 1
    members: int = field(default=0)
    layout: Layout | None = None


def label(condition: str, count: int) -> str:
    """Return the name of a mode set in progress reports and tables."""
    return condition if condition in (FULL, RIGID) else f"{condition} {count}"


def modes(case: Case) -> dict[str, Any]:
    """Return the scene's table of modes."""
    interfaces = [PLACES[case.place], TOP]
    if case.condition == FULL:
        return {"reference": "craig-bampton", "count": "all", "interfaces": interfaces}
    return {"reference": case.condition, "count": case.count, "interfaces": interfaces}


def scene(case: Case) -> Scene:
    """Return the paper's scene with the layout, position of the prismatic joint and mode set of a case."""
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
    """Return the run (or ensemble) of a case as a task of the store."""
    given = scene(case)
    graph = Graph(given, shown=False, recipe={"elements": case.finer} if case.finer != 1 else {})
    module = "benchmarks.reference_conditions.cases"
    return Task(
        stage="reference-conditions",
        scene=given.name,
        run=f"{module}:{'members' if case.clearance and case.condition != RIGID else 'single'}",
        params=simulation.params(given, ensemble=case.clearance),
        inputs={f"bundle/{body}": made for body, made in graph.bundle.items()},
        code=simulation.CODE,
        folder="",
        part=f"{case.place} mm, {label(case.condition, case.count)}" + (", clearance" if case.clearance else ""),
    )


@cache
def rod(finer: int) -> xr.Dataset:
    """Return the mesh of the paper's rod with `finer` times the elements of its recipe."""
    recipe = read_toml(Path(scene(Case(0, FULL)).flexible()[ROD].mesh))
    return kind.build(recipe | {"elements": finer * recipe["elements"]})


@cache
def solved(case: Case) -> xr.Dataset:
    """Return the modes (schema MODES) of a case; raise InputError for counts that cut a pair."""
    table = modes(case)
    count = None if table["count"] == "all" else table["count"]
    return solve(rod(case.finer), table["reference"], count, table["interfaces"])


@cache
def is_whole(case: Case) -> bool:
    """Return True when the count of a case cuts no pair of equal frequencies."""
    try:
        solved(case)
    except InputError as error:
        if "split a cluster" in str(error):
            return False
        raise
    return True


def whole(place: int, condition: str, count: int) -> int:
    """Return the least whole count that is not below `count`."""
    return next(n for n in itertools.count(count) if is_whole(Case(place, condition, n)))


def _sets(place: int) -> list[tuple[int, str, int]]:
    """Return the sets that run at every position: all conditions with COUNT, the paper's two also with 7."""
    sets = [(c, COUNT) for c in CONDITIONS] + [(c, 7) for c in CONDITIONS[:2]]
    return [(place, c, whole(place, c, n)) for c, n in sets]


def far() -> list[Case]:
    """Return the cases with ideal joints: rigid, every condition, full rod; at 0 mm all counts and meshes."""
    found = []
    for place in PLACES:
        found += [Case(place, RIGID), Case(place, FULL), *(Case(*key) for key in _sets(place))]
    found += [Case(0, c, whole(0, c, n)) for c in CONDITIONS for n in RUN_COUNTS]
    found += [Case(0, "craig-bampton", COUNT, finer=n) for n in FINER]
    return list(dict.fromkeys(found))


def clearance(members: int) -> list[Case]:
    """Return the corresponding cases with clearance at A1, as ensembles."""
    found = []
    for place in PLACES:
        found += [(place, RIGID, COUNT), *_sets(place)]
        found += [(place, "craig-bampton", whole(place, "craig-bampton", n)) for n in MOST_COMPLETE]
    for condition in ("free-free", "craig-bampton"):
        found += [(0, condition, whole(0, condition, n)) for n in RUN_COUNTS]
    return [Case(*key, clearance=True, members=_share(members, *key[1:])) for key in dict.fromkeys(found)]


@cache
def layouts() -> tuple[Layout, ...]:
    """Return the chosen layout, members of its family by rising condition number, and last the first layout."""
    return (chosen(family()), *by_condition(family(LAYOUT_GRID))[::EVERY], FIRST)


def of_layout(layout: Layout, members: int) -> list[Case]:
    """Return all runs of one layout: ideal joints, then clearance in ensembles of half the members."""
    members = max(2, members // 2)
    sets = [(RIGID, COUNT), *((c, whole(0, c, n)) for c, n in LAYOUT_SETS)]
    far = [Case(0, *key, layout=layout) for key in sets]
    return far + [Case(0, *key, clearance=True, members=_share(members, *key), layout=layout) for key in sets]


def _share(members: int, condition: str, count: int) -> int:
    """Return the number of members: fewer where a run is expensive, 0 for a rigid rod, which has one run."""
    if condition == RIGID:
        return 0
    # whole counts may lie a little above COUNT
    return members if count < MOST_COMPLETE[0] else max(2, round(LARGE_SETS * members))
