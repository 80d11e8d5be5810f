"""What an artifact's key depends on, and what it does not."""

from __future__ import annotations

import ast
import datetime
import json
import re
from importlib.metadata import version
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexclear.artifacts.disk import read_checked
from flexclear.dynamics.compile.functions import NO_KERNELS
from flexclear.scene.load import load_scene
from flexclear.stages import derived_series, simulation
from flexclear.stages.graph import Graph
from flexclear.system.errors import InputError
from flexclear.workflow import fingerprint
from flexclear.workflow.fingerprint import TREE, Sources, code_digest, library_version, sources_of
from flexclear.workflow.task import Task, facts, flatten, in_order, key, reasons
from tests.processes import copied

LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=4)
)
TREES = st.recursive(
    LEAVES, lambda t: st.lists(t, max_size=3) | st.dictionaries(st.text("ab", max_size=2), t, max_size=3)
)


@given(TREES, TREES)
def test_different_parameters_have_different_text(one: object, other: object):
    """Bare lists are compared as text; 1 and 1.0 and true are three different things in a scene."""
    same = repr(one) == repr(other) or _sorted(one) == _sorted(other)
    assert (flatten({"p": one}) == flatten({"p": other}) and not same) is False


def _sorted(tree: object) -> str:
    """Text that ignores the order of keys and nothing else."""
    if isinstance(tree, dict):
        return "{" + ",".join(f"{k!r}:{_sorted(v)}" for k, v in sorted(tree.items())) + "}"
    if isinstance(tree, list):
        return "[" + ",".join(map(_sorted, tree)) + "]"
    return repr(tree)


def test_parameters_as_text_keep_every_digit_and_no_order():
    """The next float up is another parameter. A nan or a date in a recipe is for its check to refuse, in words."""
    assert sorted(flatten({"a": 1, "b": {"c": 2.5}})) == sorted(flatten({"b": {"c": 2.5}, "a": 1}))
    assert flatten(0.1) != flatten(0.1 + 2**-56)
    assert flatten({"a": float("nan"), "b": datetime.date(2019, 3, 10)}) == [("a", "NaN"), ("b", '"2019-03-10"')]


@given(LEAVES | st.lists(st.floats(allow_nan=True)) | st.lists(st.integers() | st.booleans() | st.text('a"ü\n')))
def test_leaves_are_written_as_json_writes_them(leaf: object):
    """Also those that are not given to its encoder."""
    assert flatten(leaf) == [("", json.dumps(leaf, ensure_ascii=False))]


def test_reasons_are_words():
    old = {"parameter joint.A1.clearance": "0.0005", "code of a.b": "1", "input mesh": "2", "library numpy": "2.0"}
    new = {"parameter joint.A1.clearance": "0.0002", "code of a.b": "2", "input mesh": "3", "library numpy": "2.1"}
    assert reasons(new, old) == [
        "code of a.b changed",
        "input mesh changed",
        "library numpy: 2.0 -> 2.1",
        "joint.A1.clearance: 0.0005 -> 0.0002",
    ]
    assert reasons(new, None) == ["never run"]
    assert reasons(old, old) == []
    assert reasons({}, {"input mesh": "2"}, frozenset({"mesh"})) == []


def test_sources_are_parsed_while_other_threads_parse(monkeypatch: pytest.MonkeyPatch) -> None:
    """CPython fails then, now and then: it takes what one thread counts for what the other does."""
    parse, calls = ast.parse, list[int]()

    def disturbed(source: bytes) -> ast.Module:
        calls.append(1)
        if len(calls) < 3:
            raise SystemError("AST constructor recursion depth mismatch (before=57, after=54)")
        return parse(source)

    monkeypatch.setattr(ast, "parse", disturbed)
    assert fingerprint._digest_and_libraries(b"import numpy as np", True)[1] == ["numpy"]
    assert len(calls) == 3


def graph(root: Path, name: str) -> Graph:
    return Graph(load_scene(root / "scenes" / f"{name}.toml"))


def keys(graph: Graph, sources: Sources) -> dict[str, str]:
    """Key of each task when every input is as its own key says: no stage is run for that."""
    found: dict[int, str] = {}
    for task in in_order(graph.up_to("post")):
        above = {name: found[t] for name, t in task.inputs.items()}
        found[task] = key(facts(task, above, sources))
    return {task.label: found[task] for task in in_order(graph.up_to("post"))}


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    assert before.keys() == after.keys()
    return {label for label in before if before[label] != after[label]}


@pytest.fixture(scope="module")
def sources(root: Path) -> Sources:
    """The project's own source, read once."""
    return Sources(root / "pipeline")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Source and scenes, to be edited."""
    return copied(tmp_path, "scenes", "meshes")


def read_again(copy: Path) -> Sources:
    """Sources of a copy; only those that were edited are parsed."""
    return Sources(copy / "pipeline", copy / "results" / "cache" / "code.json")


RERUN = {
    "joint.A1.clearance": ("0.2 mm", {"simulate", "ensemble", "post"}),
    "body.rod1.modes.count": (8, {"modes rod1", "bundle rod1", "simulate", "ensemble", "post"}),
    "ensemble.members": (8, {"ensemble", "post"}),
}


@pytest.mark.parametrize("path", RERUN)
def test_an_edit_reruns_exactly_what_depends_on_it(path: str, root: Path, sources: Sources):
    file, (value, stages) = root / "scenes" / "sps4" / "far_csj_cb.toml", RERUN[path]
    before, after = (keys(Graph(load_scene(file, change)), sources) for change in ({}, {path: value}))
    assert changed(before, after) == stages


def test_titles_and_places_on_disk_do_not_count(root: Path, copy: Path, sources: Sources):
    scene = copy / "scenes" / "sps4" / "far_cb.toml"
    text = scene.read_text()
    scene.write_text(re.sub(r"^title = .*", 'title = "Another title"', text, flags=re.MULTILINE))
    assert text != scene.read_text()
    moved = Graph(load_scene(scene))
    assert str(copy) not in str([facts(task, {}, sources) for task in in_order(moved.up_to("post"))])
    before = keys(graph(root, "sps4/far_cb"), sources)
    assert changed(before, keys(moved, sources)) == set()


def test_another_sentence_about_a_value_runs_nothing_again(root: Path, sources: Sources):
    """What is derived from the run carries it, which takes a second."""
    path = root / "scenes" / "sps4" / "far_csj_cb.toml"
    edits = {"body.platform.source.mass": "weighed", "joint.A1.source.clearance": "assumed: measured"}
    before, after = (Graph(load_scene(path, override)) for override in ({}, edits))
    assert changed(keys(before, sources), keys(after, sources)) == {"post"}
    reported = derived_series.origins(after.scene)
    assert json.loads(reported["sources"])["body.platform.mass"] == "weighed"
    assert json.loads(reported["assumptions"])["joint.A1.clearance"] == "assumed: measured"


#: what follows in the recipe of the rod
SOURCE_OF_MATERIAL = 'poisson = 0.33\nsource = "Table 2"'


def test_another_sentence_in_a_recipe_makes_no_mesh_again(root: Path, copy: Path, sources: Sources):
    """It is reported where a scene's own sentences are."""
    recipe = copy / "meshes" / "actuated_rod.toml"
    text = recipe.read_text().replace("[material]\n", "[material]\n# weighed\n")
    recipe.write_text(text.replace(SOURCE_OF_MATERIAL, 'poisson = 0.33\nsource = "assumed: aluminium"'))
    before, after = graph(root, "sps4/far_cb"), graph(copy, "sps4/far_cb")
    assert changed(keys(before, sources), keys(after, sources)) == {"post"}
    reported = derived_series.origins(after.scene)
    assert json.loads(reported["sources"])["body.rod1.recipe.shape"] == "Table 2"
    assert json.loads(reported["assumptions"])["body.rod1.recipe.material"] == "assumed: aluminium"
    recipe.write_text(text.replace("elements = 12", "elements = 24"))
    assert "mesh rod1" in changed(keys(before, sources), keys(graph(copy, "sps4/far_cb"), sources))


def test_a_source_of_a_recipe_that_is_no_text_is_refused(copy: Path, sources: Sources):
    """What builds the mesh does not see it."""
    recipe = copy / "meshes" / "actuated_rod.toml"
    text = recipe.read_text()
    for source in ("5", "{ density = 3 }", "[1]"):
        recipe.write_text(text.replace(SOURCE_OF_MATERIAL, f"poisson = 0.33\nsource = {source}"))
        with pytest.raises(InputError, match=r"actuated_rod\.toml \[material\.source\]: expected text"):
            keys(graph(copy, "sps4/far_cb"), sources)


#: modules, and the first words of the tasks of a scene with clearance and flexible bodies that run again
EDITED = {
    "pipeline/flexclear/dynamics/contact/friction/modified_coulomb.py": {"simulate", "ensemble"},
    "pipeline/flexclear/structure/modes/reference.py": {"mesh", "modes", "bundle"},
    "pipeline/flexclear/post/single_run/series.py": {"post"},
    "pipeline/flexclear/post/pages/page.css": {"post"},
    "pipeline/flexclear/stages/simulation.py": {"simulate", "ensemble"},
    "pipeline/flexclear/stages/reduction.py": {"bundle"},
    "pipeline/flexclear/numerics/axes.py": {"mesh", "modes", "bundle", "simulate", "ensemble", "post"},
    "pipeline/flexclear/commands/run.py": set(),
    "papers/wang_wang_2019/figures/panels.py": set(),
}


def own_code(root: Path, tree: Sources) -> dict[str, dict[str, str]]:
    """Facts of each task but for its inputs."""
    tasks = in_order(graph(root, "sps4/far_csj_cb").up_to("post"))
    return {task.label: facts(task, {}, tree) for task in tasks}


def test_editing_a_package_reruns_the_stages_on_it_and_says_so(root: Path, copy: Path, sources: Sources):
    before = own_code(root, sources)
    for file, stages in EDITED.items():
        path = copy / file
        text = path.read_text()
        path.write_text(text + ("\nEDITED = 1\n" if file.endswith(".py") else "\np {}\n"))
        after = own_code(root, read_again(copy))
        stale = {label.split()[0] for label in before if before[label] != after[label]}
        assert stale == stages, file
        package = file.split("/")[2] if "stages" not in file else file.removeprefix("pipeline/flexclear/")[:-3]
        for label in before:
            said = {f"code of {package.replace('/', '.')} changed"} if label.split()[0] in stages else set()
            assert set(reasons(after[label], before[label])) == said, label
        path.write_text(text)


REWORDED = {
    "comment": ("    return a + b", "    # the sum\n    return a + b"),
    "docstring": ('"""Sum."""', '"""The sum of two numbers."""'),
    "message": ("must be positive", "{a} is negative; give a positive number"),
    "layout": ("    return a + b", "    return (\n        a + b\n    )"),
}
CHANGED = {
    "operation": ("a + b", "a - b"),
    "number": ("LIMIT = 0", "LIMIT = 1"),
    "text": ('"sum"', '"total"'),
    "which error": ("ValueError", "TypeError"),
    "condition": ("a < LIMIT", "a <= LIMIT"),
}
SOURCE = '''"""Adds."""

LIMIT = 0
NAME = "sum"


def add(a, b):
    """Sum."""
    if a < LIMIT:
        raise ValueError(f"must be positive")
    return a + b
'''


@pytest.mark.parametrize("edit", [*REWORDED, *CHANGED])
def test_words_do_not_count_and_code_does(edit: str):
    before, after = (REWORDED | CHANGED)[edit]
    assert before in SOURCE
    one, other = (code_digest(ast.parse(text)) for text in (SOURCE, SOURCE.replace(before, after)))
    assert (one == other) is (edit in REWORDED)


def test_another_word_runs_nothing_again(root: Path, copy: Path, sources: Sources):
    for module in ("system/platforms", "scene/registry", "dynamics/kernels"):
        path = copy / "pipeline" / "flexclear" / f"{module}.py"
        path.write_text(path.read_text().replace('"""', '"""More words. ', 1) + "# and more\n")
    assert own_code(root, read_again(copy)) == own_code(root, sources)


def test_an_edit_above_the_kernels_compiles_nothing(copy: Path):
    """Code of runs and records, and all of other packages; an edit of a kernel does."""
    edits = {"dynamics/run/ledger": False, "post/single_run/series": False, "dynamics/integrate/norms": True}
    for module, compiles in edits.items():
        before = Sources(copy / "pipeline").digest("flexclear.dynamics", NO_KERNELS)
        path = copy / "pipeline" / "flexclear" / f"{module}.py"
        path.write_text(path.read_text() + "\nEDITED = 1\n")
        after = Sources(copy / "pipeline").digest("flexclear.dynamics", NO_KERNELS)
        assert (after != before) is compiles, module


def test_the_memo_of_digests_notices_edits(copy: Path):
    """Facts with and without the memo are the same before and after an edit."""
    memo, names = copy / "code.json", ["flexclear.stages", "flexclear.system"]
    assert Sources(copy / "pipeline", memo).code(names) == Sources(copy / "pipeline").code(names)
    assert memo.is_file()
    path = copy / "pipeline" / "flexclear" / "stages" / "simulation.py"
    path.write_text(path.read_text() + "\nimport wave\nimport vtk\n")
    edited = Sources(copy / "pipeline", memo).code(names)
    assert edited == Sources(copy / "pipeline").code(names)
    assert "library vtk" in edited
    memo.write_text("{ not json")
    assert Sources(copy / "pipeline", memo).code(names) == edited


def test_a_process_reads_its_own_sources_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What it runs was loaded then; a memo that is begun later holds all of them all the same."""
    names, memo = ["flexclear.stages.simulation", "flexclear.system"], tmp_path / "code.json"
    known = sources_of(TREE).code(names)
    with monkeypatch.context() as patch:
        patch.setattr(fingerprint, "_digest_and_libraries", lambda *_: pytest.fail("a file is read again"))
        assert sources_of(TREE, memo).code(names) == known
    assert "flexclear/stages/simulation.py" in (read_checked(memo) or {})


def test_a_module_that_does_not_exist_is_an_error(root: Path):
    with pytest.raises(LookupError, match=r"no module flexclear\.stages\.nowhere"):
        Sources(root / "pipeline").code(["flexclear.stages.nowhere"])


def test_library_versions_count(sources: Sources):
    """Also where functions import them; locks, folders and the machine's resources change no result."""
    found = facts(Task("s", "scene", "flexclear.stages.reduction:run", {}, code=("flexclear.structure",)), {}, sources)
    assert {"library numpy", "library scipy", "library skfem", "library xarray"} <= found.keys()
    assert not {f"library {name}" for name in ("filelock", "platformdirs", "psutil", "matplotlib")} & found.keys()
    assert found["library scipy"] == version("scipy")
    assert key(found) != key({**found, "library skfem": "0.0"})


def test_the_version_is_known_in_a_checkout_on_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """There the metadata of an editable installation lies next to the sources, as PKG-INFO."""
    (tmp_path / "some_library.egg-info").mkdir()
    (tmp_path / "some_library.egg-info" / "PKG-INFO").write_text(
        "Metadata-Version: 2.4\nName: some_library\nVersion: 1.2\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert library_version("some_library") == "1.2"


def test_a_scene_survives_the_way_through_its_parameters(root: Path):
    """What the engine is given says the same as the file, apart from what is left out on purpose."""
    for path in sorted((root / "scenes").rglob("*.toml")):
        if path.parent.name == "sweeps":
            continue
        scene = load_scene(path)
        reported = {"name": scene.name, "limits": scene.limits.as_table()}  # the context of its task
        again = simulation.rebuild({**reported, **simulation.params(scene, ensemble=True)}, {})
        assert again.name == scene.name
        left_out = {"title", "description", "accuracy", "sections", "view"}
        one, other = scene.model_dump(exclude=left_out), again.model_dump(exclude=left_out)
        for body in scene.flexible():
            one["body"][body]["mesh"] = other["body"][body]["mesh"] = ""
        for body in one["body"].values():
            body.update(geometry=None, color=None)  # how bodies are drawn is no concern of a run
        assert without_sources(one) == without_sources(other)


def without_sources(node: object) -> object:
    """A table without what it says of where its values come from, which is no concern of a run either."""
    if isinstance(node, dict):
        return {key: without_sources(value) for key, value in node.items() if key != "source"}
    return [without_sources(item) for item in node] if isinstance(node, (list, tuple)) else node
