"""The fingerprint is sound: whatever a stage imports while it runs is among the modules of its key."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.workflow.fingerprint import Sources, library_version
from flexclear.pipeline.core.workflow.task import STORE, in_order
from flexclear.stages.graph import Graph
from tests.processes import printed

#: runs one task in a fresh process and prints the own modules that it loaded
LOADED = """
import json, sys
from pathlib import Path
from importlib import import_module
root, label, scene, shortened = sys.argv[1], sys.argv[2], sys.argv[3], json.loads(sys.argv[4])
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.workflow.fingerprint import Sources
from flexclear.pipeline.core.workflow.execute import execute
from flexclear.pipeline.core.artifacts.store import Store
from flexclear.pipeline.core.workflow.task import in_order
from flexclear.stages.graph import Graph
store, sources, records = Store(Path(root)), Sources(Path.cwd()), {}
for task in in_order(Graph(load_scene(scene, shortened), shown=False).up_to("post")):
    before = {name for name in sys.modules}
    if task.label == label:
        for name in list(sys.modules):
            if name.startswith(tuple(f"flexclear.pipeline.{t}" for t in ("structure", "dynamics", "post"))):
                del sys.modules[name]
        before = {name for name in sys.modules}
    inputs = {name: records[above] for name, above in task.inputs.items()}
    records[task] = execute(task, inputs, store, sources, lambda fraction, text: None)
    if task.label == label:
        print(*sorted(name for name in sys.modules.keys() - before if name.split(".")[0] in ("flexclear",)))
        break
"""

CASES = [
    ("sps4/frequencies/fixed_square", "mesh rod"),
    ("sps4/frequencies/fixed_square", "modes rod"),
    ("sps4/frequencies/fixed_square", "bundle rod"),
    ("sps4/ideal", "simulate"),
    pytest.param("checks/spindle", "simulate", marks=pytest.mark.slow),
    pytest.param("checks/universal_shaft", "simulate", marks=pytest.mark.slow),
    pytest.param("checks/oscillator", "simulate", marks=pytest.mark.slow),
    ("sps4/csj", "simulate"),
    ("sps4/csj", "post"),
    ("sps4/far_csj_cb", "simulate"),
]


@pytest.mark.parametrize("scene, label", CASES)
def test_every_module_that_runs_is_in_the_key(root: Path, tmp_path: Path, scene: str, label: str):
    path = root / "scenes" / f"{scene}.toml"
    loaded = set(printed(LOADED, tmp_path / "results", label, path, '{"time.end": 0.001}').split())
    (task,) = (task for task in in_order(Graph(load_scene(path)).up_to("post")) if task.label == label)
    known = Sources(root).closure([task.run.partition(":")[0], STORE, *task.modules]).keys()
    assert len(loaded) > 2
    assert loaded <= known


def test_the_version_is_known_in_a_checkout_on_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """There the metadata of an editable installation lies beside the sources, as PKG-INFO."""
    (tmp_path / "some_library.egg-info").mkdir()
    (tmp_path / "some_library.egg-info" / "PKG-INFO").write_text(
        "Metadata-Version: 2.4\nName: some_library\nVersion: 1.2\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert library_version("some_library") == "1.2"
