"""The report's tasks: every reference of every figure leads to an artifact that a scene has."""

from pathlib import Path

import pytest

from flexclear.artifacts.store import Store
from flexclear.commands.new import write
from flexclear.stages.workplace import Workplace
from flexclear.study import report
from flexclear.study.answers import Answers
from flexclear.system.errors import FlexclearError, InputError, ResourceError, SolverError
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.task import in_order
from papers.wang_wang_2019.tasks import Scenes, figure_tasks
from tests.stages.conftest import Command


def test_every_figure_and_table_of_the_paper_has_its_inputs(root: Path, tmp_path: Path):
    scenes = Scenes()
    tasks = figure_tasks(Workplace(Store(tmp_path), Sources(root / "pipeline")), scenes)
    names = {task.part for task in tasks}
    assert {"fig03", "fig04", "fig06", "fig08", "fig09"} | {f"fig{n}" for n in range(11, 18)} <= names
    assert {"table04", "table05", "table07", "table08", "table09", "table10"} <= names
    models = {"ideal", "far_free", "far_fixed", "far_cb", "csj", "far_csj_free", "far_csj_fixed", "far_csj_cb"}
    run = {task.scene for task in in_order(tasks) if task.stage == "simulate"}
    assert {f"sps4/{model}" for model in models} <= run
    assert {task.folder for task in tasks} == {"figures", "tables"}


def test_figures_share_the_tasks_of_a_scene():
    scenes = Scenes()
    assert scenes.artifact("sps4/csj:run") is scenes.artifact("sps4/csj:post").inputs["run"]


def test_time_is_measured_concurrently_and_over_all_scenes_of_a_folder():
    timing = Scenes().timing("sps4")
    assert not timing.exclusive
    assert {"sps4/ideal", "sps4/far_csj_cb"} <= timing.params.keys()
    assert "sps4/far_csj_cb:bundle/rod1" in timing.inputs


def test_kernels_for_the_timing_alone_are_compiled_concurrently_and_once_per_topology():
    ahead = [task for name, task in Scenes().timing("sps4").inputs.items() if name.startswith("kernels/")]
    # rigid or flexible, with or without clearance, by the paper's method and by a damped one
    assert len(ahead) == 4 * 2
    assert not any(task.exclusive for task in ahead)
    assert {task.params["simulate"]["scene"]["solver"]["integrator"] for task in ahead} == {
        "adams-bashforth-moulton",
        "radau",
    }


@pytest.mark.parametrize(
    "reference, reported",
    [
        ("sps4/csj:runn", "did you mean 'run'"),
        ("sps4/csj:bundle/rod1", "there is no bundle of 'rod1'"),
        ("sps4/csj:ensemble", "there is no ensemble of the whole scene"),
        ("sps4/nothing:run", "no such file"),
        ("nowhere:timing", "there are no scenes"),
    ],
)
def test_references_that_lead_nowhere_are_refused(reference: str, reported: str):
    with pytest.raises(InputError, match=reported):
        Scenes().artifact(reference)


@pytest.mark.parametrize("error", [ResourceError("the time that --limit 9s gives is over"), SolverError("is singular")])
def test_a_page_that_a_limit_left_incomplete_is_written_and_the_command_ends_with_4(
    error: FlexclearError, tmp_path: Path, fresh: Path, command: Command, monkeypatch: pytest.MonkeyPatch
):
    """An answer that its runs refuse is left out as well, but there the command has done what it could."""

    def stopped(_: Answers) -> None:
        raise error

    monkeypatch.setattr(Answers, "stability", property(stopped))
    monkeypatch.setattr(report, "SHOWN_MOTION", ())
    limited = error.exit_code == 4
    path = write("pendulum", tmp_path)[0]
    said = command("report", path, "--jobs", "1", "--answers", "none", code=4 if limited else 0)
    assert (fresh / "runs" / "pendulum" / "report.html").exists()
    assert f"not in the report: stability: {error}" in said.err
    assert ("report.html is written without stability" in said.err) == limited
