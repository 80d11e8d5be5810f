"""A command that finds everything fresh starts quickly, since it imports nothing that computes or draws."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from flexclear.artifacts.store import Record, Store
from flexclear.stages.workplace import Workplace
from flexclear.workflow.fingerprint import TREE, Sources
from flexclear.workflow.task import Task, facts, in_order, key
from papers.wang_wang_2019 import tasks as report
from tests.processes import printed, python

#: what such a command may import: its own code, and what checks scenes
ALLOWED = {"flexclear", "papers", "pydantic", "pydantic_core", "annotated_types", "typing_extensions"}
ALLOWED |= {"typing_inspection", "psutil"}
#: what takes a tenth of a second or more, and what it brings
SLOW = {"numpy", "xarray", "pandas", "scipy", "numba", "matplotlib", "pyvista", "skfem", "meshio", "netCDF4"}
#: a program, and what it has imported at its end
PROGRAM = """import runpy, sys
try:
    runpy.run_module(sys.argv.pop(1), run_name="__main__", alter_sys=True)
except SystemExit as end:
    print(*sys.modules, file=sys.stderr)
    sys.exit(end.code)"""


def imported(*arguments: str, results: Path, program: str = "flexclear") -> set[str]:
    """Top-level names of what a command imports, the standard library left out."""
    done = python("-W", "ignore", "-c", PROGRAM, program, *arguments, FLEXCLEAR_RESULTS=str(results))
    names = {name.partition(".")[0] for name in done.stderr.splitlines()[-1].split()} - set(sys.stdlib_module_names)
    # the interpreter's own: its configuration, whose name tells the machine, and what its site loads at every start
    own = printed("import sys; print(*sys.modules)").split()
    return {name for name in names - set(own) if not name.startswith(("_sysconfigdata", "__"))}


def stand_in(tasks: Iterable[Task], place: Workplace) -> dict[Task, Record]:
    """Records of tasks and all their inputs, by identity: in the store is what their keys ask for, and not a result."""
    found: dict[Task, Record] = {}
    for task in in_order(list(tasks)):
        known = facts(task, {name: found[above].digest for name, above in task.inputs.items()}, place.sources)
        name = key(known)
        record = place.store.find(task.stage, name)
        found[task] = record or place.store.put(task.stage, name, {"nc": name.encode()}, known)
    return found


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results folder in which everything that the report shows is up to date."""
    root = tmp_path_factory.mktemp("fresh")
    place = Workplace(Store(root), Sources(TREE, root / "cache" / "code.json"))
    scenes = report.Scenes()
    tasks = [*report.figure_tasks(place, scenes), *scenes.graph(report.HEADLINE).of("render").values()]
    records = stand_in(tasks, place)
    graphs = [graph for graph in scenes.graphs.values() if graph.simulate in records]
    stand_in([report.page_task(place, records, graphs)], place)
    return root


def records(results: Path) -> dict[Path, int]:
    """When each record of an artifact was written."""
    return {path: path.stat().st_mtime_ns for path in (results / "cache").glob("*/*.json")}


@pytest.mark.parametrize(
    "program, arguments",
    [
        ("papers.wang_wang_2019", ()),
        ("flexclear", ("run", "sps4/csj", "sps4/far_csj_cb")),
        ("flexclear", ("why", "sps4/csj", "sps4/far_csj_cb")),
        ("flexclear", ("cite", "sps4/csj")),
    ],
    ids=["paper", "run", "why", "cite"],
)
def test_what_is_fresh_needs_no_library_that_computes_or_draws(
    fresh: Path, program: str, arguments: tuple[str, ...]
) -> None:
    before = records(fresh)
    found = imported(*arguments, results=fresh, program=program)
    assert records(fresh) == before  # nothing was run
    assert found & SLOW == set()
    assert found <= ALLOWED


@pytest.mark.parametrize(
    "scene, more",
    [
        ("checks/pendulum", ()),
        ("checks/pendulum", ("--set", "accuracy={'bob.position'='1 mm'}")),
        ("checks/clamped_rod", ()),
    ],
    ids=["rigid", "compared with others", "flexible"],
)
def test_a_run_imports_neither_xarray_nor_what_scipy_computes(
    scene: str, more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of rigid bodies and of flexible ones whose bundles are fresh: xarray takes as long as all else of a short run."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    short = (scene, "--set", "time.end='1 us'", *more, "--jobs", "1")
    if scene == "checks/clamped_rod":
        assert "xarray" in imported("run", *short, "--to", "bundle", results=tmp_path)
    found = imported("run", *short, results=tmp_path)
    assert "netCDF4" in found  # it did run
    assert found & {"xarray", "pandas", "skfem", "matplotlib"} == set()


def test_what_needs_a_library_shows_it(fresh: Path) -> None:
    """The principal moments of a full inertia matrix are eigenvalues: so the test above would see NumPy."""
    assert "numpy" in imported("why", "checks/bennett", results=fresh)


def test_the_package_gives_what_public_lists_and_that_module_alone() -> None:
    said = printed(
        "import flexclear as fc; print(fc.public.run is fc.run, fc.__version__ != '', hasattr(fc, 'scenes'))"
    )
    assert said.split() == ["True", "True", "False"]
