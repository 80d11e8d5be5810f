"""The fingerprint is sound: whatever a stage imports while it runs is among the modules of its key."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import pytest

from flexclear.workflow.fingerprint import WORDING, Sources, library_version
from flexclear.workflow.task import Task, facts
from tests.processes import printed

#: runs the tasks up to a post, and an equilibrium, in a fresh process, and prints the own modules that each has loaded
LOADED = """
import json, sys
from pathlib import Path
root, scene, shortened = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
from flexclear.scene.load import load_scene
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.execute import execute
from flexclear.artifacts.store import Store
from flexclear.workflow.task import in_order
from flexclear.stages.graph import Graph
store, sources, records = Store(Path(root)), Sources(Path.cwd() / "pipeline"), {}
graph = Graph(load_scene(scene, shortened), shown=False)
for task in [*in_order(graph.up_to("post")), graph.linear()]:
    for name in list(sys.modules):
        if name.startswith(tuple(f"flexclear.{t}" for t in ("structure", "dynamics", "post"))):
            del sys.modules[name]
    before = {name for name in sys.modules}
    inputs = {name: records[above] for name, above in task.inputs.items()}
    records[task] = execute(task, inputs, store, sources, lambda fraction, text: None)
    loaded = sorted(name for name in sys.modules.keys() - before if name.split(".")[0] in ("flexclear",))
    known = [fact.partition(" ")[2] for fact in records[task].facts if fact.startswith("module ")]
    print(json.dumps({task.label: [loaded, known]}))
"""
SCENES = [
    "sps4/ideal",
    *(pytest.param(f"checks/{name}", marks=pytest.mark.slow) for name in ("spindle", "universal_shaft", "oscillator")),
    "sps4/csj",
    "sps4/far_csj_cb",
]


@pytest.mark.parametrize("scene", SCENES)
def test_every_module_that_runs_is_in_the_key(root: Path, tmp_path: Path, scene: str):
    path = root / "scenes" / f"{scene}.toml"
    lines = printed(LOADED, tmp_path / "results", path, '{"time.end": 0.001}').splitlines()
    found = {label: list(map(set, names)) for line in lines for label, names in json.loads(line).items()}
    assert found.keys() >= {"simulate", "post", "linear"}
    for label, (names, known) in found.items():
        assert len(names) > 2, label
        assert names - WORDING <= known, label


def test_the_version_is_known_in_a_checkout_on_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """There the metadata of an editable installation lies next to the sources, as PKG-INFO."""
    (tmp_path / "some_library.egg-info").mkdir()
    (tmp_path / "some_library.egg-info" / "PKG-INFO").write_text(
        "Metadata-Version: 2.4\nName: some_library\nVersion: 1.2\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert library_version("some_library") == "1.2"


@pytest.mark.parametrize("name", ["simulation", "reduction", "derived_series", "analyses"])
def test_every_library_that_the_code_imports_is_a_fact(name: str, root: Path):
    """Also where functions import it: SciPy solves the eigenproblems of modes, for instance. Locks, folders and the
    machine's resources change no result."""
    stage, sources = f"flexclear.stages.{name}", Sources(root / "pipeline")
    used = {library for module in sources.closure([stage]).values() for library in module.libraries}
    found = facts(Task("s", "scene", f"{stage}:run", {}, ""), {}, sources)
    assert {f"library {one}" for one in used - {"filelock", "platformdirs", "psutil"}} <= found.keys()
    assert found["library scipy"] == version("scipy")
    assert found["library numpy"] == version("numpy")
