"""Plans: bounds are bounds, responses have closed forms, decisions follow the accuracy, files say what differs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexclear as fc
from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.progress import silent
from flexclear.pipeline.core.scene import variants
from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.wanted import Quantity
from flexclear.pipeline.dynamics.linear.play import Bounds, bounds
from flexclear.pipeline.dynamics.run.run import integrate
from flexclear.stages import plan, run, s4_simulate, s4_watched, s8_plan
from flexclear.stages.__main__ import main
from flexclear.stages.graph import Graph
from flexclear.stages.new import write

#: of the leg's rod [m, Pa, kg/m^3], and what stands on it [kg]
LENGTH, RADIUS, MODULUS, DENSITY, PLATFORM = 0.24, 0.01, 71.7e9, 2740.0, 3.0
GRAVITY = 9.81


@pytest.fixture(autouse=True)
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return tmp_path / "results"


def _bounds(scene: Scene, chosen: list[Quantity]) -> Bounds:
    """Of a scene, from the run of its ideal twin."""
    place, task = run.workplace(), s8_plan.task(edited(scene, {"accuracy": {"quantities": {}}}))
    outcome = place.bring(list(task.inputs.values()), 1)
    inputs = {name: place.store.load(outcome.records[id(below)]) for name, below in task.inputs.items()}
    gone = [e for e in variants.effects(scene) if not e.name.startswith("load.")]
    bare = s4_watched.plain(variants.without(scene, gone))
    rigid = {name: inputs[name] for name in Graph(bare, shown=False).bodies()}
    ideal = s4_simulate.rebuild(s4_simulate.params(bare), rigid)
    return bounds(scene, integrate(ideal, {}, silent), s4_simulate.bundles(inputs), chosen)


def _standing_leg(tmp_path: Path) -> Scene:
    """The leg upright and at rest under its own weight."""
    scene = load_scene(write("leg", tmp_path)[0])
    law = {"type": "constant", "value": 0.0}
    return edited(scene, {"drive.stroke": {"joint": "slide", "law": law}, "time.end": 1e-3, "output.interval": 1e-4})


def test_the_response_of_a_rod_under_load_is_that_of_a_bar(tmp_path: Path):
    """A bar of weight w under a load F shortens by (F + w/2) L/(E A); the platform goes down by that."""
    found = _bounds(_standing_leg(tmp_path), [Quantity("platform", "position")])
    area = np.pi * RADIUS**2
    weight = DENSITY * area * LENGTH * GRAVITY
    expected = (PLATFORM * GRAVITY + 0.5 * weight) * LENGTH / (MODULUS * area)
    # the static modes make the end compliance exact, and seven more most of the body's weight acting along it: of that
    # half weight, a fortieth of the load, the modes with the ends held have eight tenths in the axial direction
    assert found.bending["rod"]["platform.position"] == pytest.approx(expected, rel=5e-3)


def test_the_bound_of_a_loose_crank_pin_is_that_of_the_slider_crank(tmp_path: Path):
    """A slider follows an opening d of the crank pin by at most d/cos(b), b the rod's angle, at most asin(r/l)."""
    scene = load_scene(write("slider-crank", tmp_path)[0])
    found = _bounds(scene, [Quantity("slider", "position")])
    ratio = 1.0 / np.sqrt(1.0 - 0.25**2)
    reach = found.clearance["pin"]["slider.position"]
    # the depth to which the pin is pressed comes on top, some percent; the steepest angle lies between the poses seen
    assert 0.995 * ratio * 1e-4 < reach < 1.1 * ratio * 1e-4


def test_where_joints_leave_a_freedom_there_is_no_bound(tmp_path: Path):
    scene = edited(_standing_leg(tmp_path), {"drive": {}, "load": {}})
    found = _bounds(scene, [Quantity("platform", "position")])
    assert found.clearance["ball"]["platform.position"] == np.inf
    assert found.bending["rod"]["platform.position"] == np.inf


def _tight(scene: Scene) -> Scene:
    """Without the clearance, which is another matter."""
    return variants.without(scene, [e for e in variants.effects(scene) if e.name.startswith("joint.")])


def test_a_plan_keeps_a_rod_that_bends_by_more_than_is_wanted_and_drops_one_that_does_not(tmp_path: Path):
    """The rod shortens by 0.33 um at rest and vibrates about that when it is let go, to twice as much."""
    leg = _tight(_standing_leg(tmp_path))
    moving = edited(leg, {"drive.stroke": load_scene(tmp_path / "leg.toml").drive["stroke"].model_dump(mode="json")})
    moving = edited(moving, {"time.end": 0.02})
    kept = {}
    for wanted in (1e-4, 1e-8):
        scene = edited(moving, {"accuracy": {"quantities": {"platform.position": {"absolute": wanted}}}})
        planned, found = fc.plan(scene)
        kept[wanted] = "rod" in planned.flexible()
        assert bool(found["kept"].sel(effect="body.rod.modes")) == kept[wanted]
        assert found.attrs["evaluations"] > 0
    assert kept == {1e-4: False, 1e-8: True}


def test_the_planned_scene_is_a_file_that_runs_and_verifies(tmp_path: Path, capsys: pytest.CaptureFixture):
    path = write("leg", tmp_path)[0]
    text = path.read_text().replace('end = "0.12 s"', 'end = "10 ms"').replace('integrator = "radau"\nrtol = 1e-5', "")
    path.write_text(text + '\n[accuracy]\nplatform.position = "1 mm"\n')
    out = tmp_path / "planned.toml"
    assert main(["plan", str(path), "-q", "--jobs", "1", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "may be left out" in told
    planned = load_scene(out)
    assert planned.accuracy is None
    assert 'extends = "leg.toml"' in out.read_text()
    assert main(["run", str(path), "-q", "--jobs", "1", "--planned", "--verify"]) == 0
    told = capsys.readouterr().out
    assert "| platform.position |" in told
    assert "met" in told


def test_bad_plans_are_refused_in_words(tmp_path: Path, capsys: pytest.CaptureFixture, results: Path):
    path = write("pendulum", tmp_path)[0]
    assert main(["plan", str(path), "-q", "--jobs", "1"]) == 2
    assert "asks for no accuracy" in capsys.readouterr().err
    path.write_text(path.read_text() + '\n[accuracy]\nnobody.position = "10 um"\n')
    assert main(["plan", str(path), "-q", "--jobs", "1"]) == 2
    assert "nobody" in capsys.readouterr().err
    assert main(["run", str(path), "-q", "--verify"]) == 2
    assert "--planned" in capsys.readouterr().err
    assert not (results / "plan").exists()


def test_an_accuracy_above_all_that_moves_would_drop_the_motion_too(tmp_path: Path, results: Path):
    scene = edited(
        _tight(_standing_leg(tmp_path)), {"accuracy": {"quantities": {"platform.position": {"absolute": 1.0}}}}
    )
    with pytest.raises((InputError, run.FailedTasksError), match="leave out everything") as refused:
        plan.bring(scene, run.workplace())
    assert refused.value.exit_code == 2
    assert not [*(results / "plan").rglob("*.toml"), *(results / "plan").rglob("*.nc")]


def test_effects_of_a_pendulum_are_its_gravity(tmp_path: Path):
    """Let go without gravity it stays where it is; with it, it swings: the influence is the way it swings."""
    path = write("pendulum", tmp_path)[0]
    scene = edited(load_scene(path), {"time.end": 0.1})
    found = fc.effects(scene)
    assert list(found["effect"].values) == ["load.gravity"]
    alone = found["dropped"].isel(effect=0, other=0)
    assert np.all(alone.values[np.isfinite(alone.values)] >= 0.0)
    name = next(str(q) for q in found["quantity"].values if str(q).endswith("position"))
    body = name.partition(".")[0]
    position = fc.run(scene)["position"].sel(body=body).values
    way = np.linalg.norm(position - position[0], axis=1).max()
    if np.linalg.norm(fc.run(scene)["velocity"].sel(body=body).values[0]) < 1e-12:
        # runs of one tolerance, the same integration but for the size of the load: 1e-8 of the way
        assert float(alone.sel(quantity=name)) == pytest.approx(way, rel=1e-6)
