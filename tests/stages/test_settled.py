"""A report that left nothing to be done is known again as long as nothing has changed that decides its results."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable
from importlib.metadata import distribution
from pathlib import Path

import pytest

from flexclear.pipeline.core.artifacts.disk import checked, publish, read_checked
from flexclear.pipeline.core.artifacts.store import Store
from flexclear.pipeline.core.workflow import opened, settled
from flexclear.pipeline.core.workflow.fingerprint import DISTRIBUTIONS, TREE, Sources, library_versions, source_file
from flexclear.pipeline.core.workflow.task import Task
from flexclear.stages import paper_report, report
from flexclear.stages.workplace import Workplace

FILES = {
    "flexclear/__init__.py": "",
    "pipeline/part.py": "A = 1",
    "stages/stage.py": "import flexclear.pipeline.part",
    "scenes/sps4/csj.toml": "title = 'A scene'",
    "meshes/rod.toml": "elements = 12",
    "table.csv": "0, 0",
    "site/numpy-1.0.dist-info/METADATA": "Version: 1.0",
    "other/readme.txt": "no library",
}


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small program with data and one library, in whose place that of the process stands."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(settled, "TREE", tmp_path)
    monkeypatch.setattr(settled, "DATA", tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path / "other"), str(tmp_path / "site")])
    return tmp_path


@pytest.fixture
def store(tree: Path) -> Store:
    return Store(tree / "results")


def task(name: str, *inputs: Task) -> Task:
    return Task(
        name, "scene", "flexclear.stages.stage:run", {}, "runs/a", inputs={t.stage: t for t in inputs}, part="rod"
    )


@pytest.fixture
def kept(tree: Path, store: Store) -> Path:
    """The memo of two artifacts, one made of the other."""
    one = task("mesh")
    other = task("modes", one)
    code = {"module flexclear.pipeline.part": opened.digest(str(tree / "pipeline" / "part.py"))}
    table = {"file ../table.csv": opened.digest(str(tree / "table.csv"))}
    records = {
        id(one): store.put("mesh", "a" * 32, {"nc": b"mesh", "vtu": b"mesh"}, code | table),
        id(other): store.put("modes", "b" * 32, {"nc": b"modes"}, code),
    }
    memo = tree / "results" / "cache" / "report.json"
    object.__setattr__(one, "context", {"folder": str(tree / "meshes")})
    read = {"scenes/sps4/csj.toml": opened.digest(str(tree / "scenes" / "sps4" / "csj.toml"))}
    settled.keep(memo, settled.state({}), read, [other], records, store)
    assert memo.is_file()
    return memo


def test_what_was_settled_is_known_again_and_shown(tree: Path, store: Store, kept: Path):
    assert settled.again(kept, settled.state({}), store)
    shown = tree / "results" / "runs" / "a" / "nc"
    assert shown.read_bytes() == b"modes"
    shown.unlink()
    assert settled.again(kept, settled.state({}), store)
    assert shown.read_bytes() == b"modes"


def _edit(name: str, text: str = "edited") -> Callable[[Path], None]:
    def edit(tree: Path) -> None:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text(text)

    return edit


def _remove(name: str) -> Callable[[Path], None]:
    return lambda tree: (tree / name).unlink()


def _flip(name: str) -> Callable[[Path], None]:
    def flip(tree: Path) -> None:
        content = (tree / name).read_bytes()
        (tree / name).write_bytes(content[:-1] + bytes([content[-1] ^ 1]))

    return flip


@pytest.mark.parametrize(
    "change",
    [
        _edit("flexclear/__init__.py"),
        _edit("pipeline/part.py", "A = 2"),
        _edit("pipeline/another.py"),
        _remove("stages/stage.py"),
        _edit("scenes/sps4/csj.toml"),
        _edit("scenes/sps4/another.toml"),
        _edit("meshes/rod.toml", "elements = 24"),
        _edit("meshes/deep/files/rod.msh"),
        _remove("meshes/rod.toml"),
        _edit("table.csv", "0, 1"),
        _remove("table.csv"),
        _edit("site/numpy-1.0.dist-info/METADATA", "Version: 1.1"),
        _edit("site/scipy-1.0.dist-info/METADATA"),
        _edit("other/numpy-0.9.dist-info/METADATA"),
        _edit("other/some.egg-info/PKG-INFO"),
        _remove("site/numpy-1.0.dist-info/METADATA"),
        _flip(f"results/cache/mesh/{'a' * 32}.vtu"),
        _remove(f"results/cache/mesh/{'a' * 32}.vtu"),
        _flip(f"results/cache/mesh/{'a' * 32}.json"),
        _remove(f"results/cache/modes/{'b' * 32}.json"),
        _flip("results/cache/report.json"),
        _edit("results/cache/report.json", "{}"),
        _remove("results/cache/report.json"),
    ],
)
def test_whatever_changes_is_noticed(tree: Path, store: Store, kept: Path, change: Callable[[Path], None]):
    """By content: files that are still there have the times of before."""
    assert settled.again(kept, settled.state({}), store)
    times = {path: path.stat() for path in tree.rglob("*") if path.is_file()}
    change(tree)
    for path, then in times.items():
        if path.is_file():
            os.utime(path, ns=(then.st_atime_ns, then.st_mtime_ns))
    assert not settled.again(kept, settled.state({}), store)


def test_the_order_in_which_libraries_are_looked_for_is_noticed(tree: Path, monkeypatch: pytest.MonkeyPatch):
    _edit("other/numpy-0.9.dist-info/METADATA")(tree)
    before = settled.state({})
    monkeypatch.setattr(sys, "path", sys.path[::-1])
    assert settled.state({}) != before


def test_what_else_a_command_tells_is_noticed(store: Store, kept: Path):
    assert not settled.again(kept, settled.state({"gl": "none"}), store)


def test_the_same_files_elsewhere_are_not_taken_for_these(tree: Path, store: Store, kept: Path, tmp_path_factory):
    """Places of files are told from where the program is."""
    there = tmp_path_factory.mktemp("copy") / "tree"
    shutil.copytree(tree, there)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settled, "TREE", there)
        patch.setattr(settled, "DATA", there)
        assert not settled.again(kept, settled.state({}), store)


def test_what_was_edited_while_keys_were_made_is_not_kept(tree: Path, store: Store):
    """A module's digest in the key is another one than before and after."""
    made, memo = task("mesh"), tree / "results" / "cache" / "report.json"
    record = store.put("mesh", "a" * 32, {"nc": b"mesh"}, {"module flexclear.pipeline.part": "1" * 64})
    settled.keep(memo, settled.state({}), {}, [made], {id(made): record}, store)
    assert not memo.exists()


@pytest.mark.parametrize("name, then", [("scenes/sps4/csj.toml", "another"), ("table.csv", "")])
def test_tasks_built_of_other_files_are_not_kept(tree: Path, store: Store, name: str, then: str):
    """Of one that was read with another content, and of one that is not in the state, though it has not changed."""
    made, memo = task("mesh"), tree / "results" / "cache" / "report.json"
    read = {name: then or opened.digest(str(tree / name))}
    settled.keep(memo, settled.state({}), read, [made], {id(made): store.put("mesh", "a" * 32, {"nc": b""}, {})}, store)
    assert not memo.exists()


@pytest.mark.parametrize(
    "place, value",
    [
        (("shown", 0, 1), "../../elsewhere"),
        (("shown", 0, 1), 7),
        (("shown", 0, 2), {"nc": "../nc"}),
        (("shown", 0, 2), {"nc": ""}),
        (("shown", 0, 3), "../label"),
        (("shown", 0, 0), 99),
        (("artifacts", 0, "stage"), "../.."),
        (("artifacts", 0, "key"), "../a"),
        (("artifacts", 0, "files"), {"/../../nc": "0"}),
        (("artifacts",), None),
        (("files",), []),
    ],
)
def test_a_memo_of_somebody_else_leads_nowhere(tree: Path, store: Store, kept: Path, place: tuple, value: object):
    """One whose digest is right, and in which a place is another one or of another kind."""
    table = read_checked(kept) or {}
    node = table
    for key in place[:-1]:
        node = node[key]
    node[place[-1]] = value
    publish(kept, checked(json.loads(json.dumps(table))))
    before = {path for path in tree.rglob("*") if "results" not in path.parts}
    assert not settled.again(kept, settled.state({}), store)
    assert {path for path in tree.rglob("*") if "results" not in path.parts} == before


def test_all_that_the_reports_tasks_are_built_of_is_in_its_state(root: Path, tmp_path: Path):
    """Every file that is opened for it, every module of their keys, and what tells the version of every library."""
    place = Workplace(Store(tmp_path), Sources(root))
    state = report.state(place)
    with opened.watched(TREE, outside=(tmp_path,)) as read:
        scenes = paper_report.Scenes()
        tasks = paper_report.report_tasks(place, scenes)
        paper_report.page_task(place, {}, list(scenes.graphs.values()))
    files = {Path(name.removeprefix("file ")).resolve() for name in state if name.startswith("file ")}
    assert len(read) > 10
    assert {(TREE / name).resolve() for name in read} <= files
    reached = place.sources.closure({name for t in tasks for name in (t.run.partition(":")[0], *t.modules)})
    assert {path.resolve() for name in reached if (path := source_file(TREE, name)) is not None} <= files
    told = {Path(name.removeprefix("library ")).resolve() for name in state if name.startswith("library ")}
    libraries = library_versions(frozenset().union(*(module.libraries for module in reached.values())))
    for library in (name for name, version in libraries.items() if version != "absent"):
        found = distribution(DISTRIBUTIONS.get(library, library))
        metadata = [Path(str(file.locate())).resolve() for file in found.files or () if file.name in settled.METADATA]
        assert told & set(metadata), library
