"""The tasks of a cost study: what is measured alone, what is compiled once for many points."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flexclear.pipeline.core.artifacts.store import Store
from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.workflow.fingerprint import Sources
from flexclear.pipeline.core.workflow.task import Task, in_order
from flexclear.stages import cost, cost_design, cost_peers
from flexclear.stages.__main__ import main
from flexclear.stages.workplace import Workplace


@pytest.fixture
def study(root: Path, tmp_path: Path) -> Task:
    scene = load_scene(root / "scenes" / "sps4" / "csj.toml")
    return cost.study(scene, Workplace(Store(tmp_path), Sources(root)))


def test_points_are_measured_alone_and_their_kernels_compiled_beforehand_side_by_side(study: Task):
    points = [task for task in in_order([study]) if task.stage == "cost-point"]
    ahead = [task for task in in_order([study]) if task.stage == "kernels"]
    assert all(point.exclusive for point in points)
    assert not any(task.exclusive for task in ahead)
    # four methods with chosen steps, three with fixed ones, and the paper's, whose contacts are not located
    assert len(ahead) == 8
    assert all(point.inputs["kernels"] in ahead for point in points)
    for point in points:
        mine, compiled = (t.params["simulate"]["scene"]["solver"] for t in (point, point.inputs["kernels"]))
        assert (mine["integrator"], mine["events"]) == (compiled["integrator"], compiled["events"])
        assert ("step" in mine) == ("step" in compiled)


def test_a_study_goes_on_where_it_was(study: Task, root: Path):
    """Every point has an artifact of its own, whose key depends on that point alone."""
    points = [task for task in in_order([study]) if task.stage == "cost-point"]
    assert len({task.part for task in points}) == len(points)


def test_a_scene_without_a_quantity_is_refused(root: Path):
    with pytest.raises(InputError, match="did you mean 'position'"):
        load_scene(root / "scenes" / "sps4" / "csj.toml", {"accuracy": {"platform.positon": "1 um"}})


TRACK = {"name": "peer", "note": "", "seconds": [1.0, 2.0], "error": {"platform.position": [1e-6, 1e-7]}}


@pytest.mark.parametrize(
    "text, told",
    [
        ("{", "cannot be read"),
        ("[]", "expected a table of scenes"),
        ('{"a": 1}', "expected a list of tracks"),
        ('{"a": [{"name": "x"}]}', "a track needs name, seconds and error"),
        ('{"a": [{"name": "x", "seconds": ["1"], "error": {}}]}', "lists of finite numbers"),
        ('{"a": [{"name": "x", "seconds": [1], "error": {"q": [1, 2]}}]}', "another number of errors"),
    ],
)
def test_a_file_of_peers_that_makes_no_sense_is_refused(tmp_path: Path, text: str, told: str):
    file = tmp_path / "peers.json"
    file.write_text(text)
    with pytest.raises(InputError, match=told):
        cost_peers.read(file)


def test_peers_change_the_study_but_none_of_its_points(root: Path, tmp_path: Path, study: Task):
    file = tmp_path / "peers.json"
    file.write_text(json.dumps({"sps4/csj": [TRACK]}))
    scene, place = load_scene(root / "scenes" / "sps4" / "csj.toml"), Workplace(Store(tmp_path), Sources(root))
    other = cost.study(scene, place, cost_peers.read(file)["sps4/csj"])
    assert other.params["peers"] == [TRACK]
    assert {k: v.params for k, v in other.inputs.items()} == {k: v.params for k, v in study.inputs.items()}


def test_a_study_of_some_integrators_keeps_what_all_are_compared_with(root: Path, tmp_path: Path):
    scene = load_scene(root / "scenes" / "sps4" / "csj.toml")
    some = cost.study(scene, Workplace(Store(tmp_path), Sources(root)), integrators=("rk4",))
    groups = {p["group"]: p["key"] for p in some.params["points"]}
    assert groups.keys() == {"reference", "confirmation", "step", "paper", "sampling"}
    assert "rk4" in groups["step"]
    with pytest.raises(InputError, match="did you mean 'radau'"):
        cost_design.runs(scene, None, ("radua",))


def test_points_keep_the_limits_of_the_scene(root: Path):
    scene = load_scene(root / "scenes" / "sps4" / "csj.toml", {"solver": {"rtol": 1e-7, "evaluations": 1234}})
    assert {design.scene.solver.evaluations for design in cost_design.runs(scene, None)} == {1234}


def test_a_page_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["cost", "sps4/csj", "--page", str(tmp_path / "nowhere" / "page.md")]) == 2
    assert "its folder does not exist" in capsys.readouterr().err
