"""``flexclear render``: what is asked for is made, in the form that is asked for, and nothing else is computed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray as xr

import flexclear as fc
from flexclear.post.overview.comparison import colors
from flexclear.scene.load import load_scene
from flexclear.stages.graph import Graph
from flexclear.study.report import publish_page
from tests.stages.conftest import Command

SCENE = "checks/clamped_rod"


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_process: None) -> Path:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return tmp_path / "results"


def test_modes_are_shown_without_a_run(results: Path, command: Command):
    body = next(iter(load_scene(f"scenes/{SCENE}.toml").flexible()))
    for kind, file in (("png", f"modes_{body}.png"), ("html", "modes.html"), ("gltf", f"modes_{body}.glb")):
        assert file in command("render", SCENE, "--what", "modes", "--format", kind, "-q").out
        assert (results / "runs" / SCENE / file).stat().st_size > 1000
    command("render", SCENE, "--what", "modes", "--format", "pvd", "-q")
    assert (results / "runs" / SCENE / "paraview" / f"modes_{body}.pvd").is_file()
    assert not (results / "runs" / SCENE / "run.nc").exists()


@pytest.mark.parametrize(
    "words, reported",
    [
        (["--what", "joint", "--format", "gltf"], "as png, gif, mp4, html"),
        (["--what", "modes", "--format", "png", "--at", "1 ms"], "belongs to --what vibrations"),
        (["--what", "vibrations", "--at", "1 kg"], "--at 1 kg"),
    ],
)
def test_what_cannot_be_shown_so_is_refused(words: list[str], reported: str, results: Path, command: Command):
    assert reported in command("render", SCENE, *words, code=2).err
    assert not results.exists()


def test_a_scene_without_modes_says_so(results: Path, command: Command):
    said = command("render", "checks/pendulum", "--what", "modes", "--format", "png", "-q", code=2)
    assert "no flexible body" in said.err


def test_no_task_of_a_run_sees_what_bodies_look_like():
    plain = Graph(load_scene("scenes/checks/clearance_slider_crank.toml"))
    shown = {"body.crank.color": "#009E73", "body.crank.geometry": [], "view": {"zoom": 2.0, "impact_slowdown": 1.0}}
    drawn = Graph(load_scene("scenes/checks/clearance_slider_crank.toml", override=shown))
    assert drawn.simulate.params == plain.simulate.params
    assert drawn.picture("motion", "html").params != plain.picture("motion", "html").params
    assert drawn.linear().params == plain.linear().params


def test_a_model_has_the_same_colour_in_every_figure():
    def run(contact: int, reference: str | None) -> xr.Dataset:
        body = {"rod": {"type": "flexible", "modes": {"reference": reference}}} if reference else {}
        found = xr.Dataset(attrs={"parameters": json.dumps({"body": body})})
        return found.expand_dims(contact=["A"]) if contact else found

    from papers.wang_wang_2019 import models

    both = colors(
        {"ideal": run(0, None), "csj": run(1, None), "cb": run(0, "craig-bampton"), "free": run(1, "free-free")}
    )
    assert both == [models.IDEAL.color, models.CSJ.color, models.FAR_CB.color, models.FAR_CSJ_FREE.color]
    assert len(set(colors({name: run(1, "craig-bampton") for name in "abcd"}))) == 4


# Pages of scenes: in a folder with their files, and for budgets that reach few effects --------------------------------


def test_a_page_in_a_folder_has_its_files_next_to_it(tmp_path: Path) -> None:
    page = b"<html><body><img alt='run' src='data:image/png;base64,AAAA'></body></html>"
    index = publish_page(tmp_path / "runs" / "ball", "report", page, folder=True)
    assert index == tmp_path / "runs" / "ball" / "report" / "index.html"
    assert index.read_bytes() == b"<html><body><img alt='run' src='files/001.png'></body></html>"
    assert (index.parent / "files" / "001.png").read_bytes() == bytes(3)


def test_a_budget_that_reaches_one_effect_names_the_others() -> None:
    answer = fc.effects("checks/bounce", budget=1e-6)
    assert answer.attrs["undone"]
    assert any(answer["words"].values), "the effect that is all of the ideal mechanism's difference costs nothing more"
