"""Plans: bounds are bounds, responses have closed forms, decisions follow the accuracy, files say what differs."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flexclear as fc
from flexclear.artifacts.effect_size import Influence
from flexclear.commands.new import write
from flexclear.dynamics.plan.budget import Integration, Search
from flexclear.dynamics.plan.tolerance import cheaper_method, scene_is_cheaper
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.variants import uncoupled_paths
from flexclear.stages import effect_plan
from flexclear.stages.workplace import open_workplace
from flexclear.study import plan
from flexclear.system.errors import InputError, SolverError
from tests.properties.mechanisms import frame, joint, rigid
from tests.stages.conftest import Command
from tests.stages.plans import standing_leg

pytestmark = pytest.mark.usefixtures("shared_results")


def _tight(scene: Scene) -> Scene:
    """Without the clearance, which is another matter."""
    return variants.without_effects(scene, [e for e in variants.effects(scene) if e.name.startswith("joint.")])


def test_fewer_modes_to_choose_from_are_the_static_ones_and_half_of_the_others(tmp_path: Path):
    leg = load_scene(write("leg", tmp_path)[0])
    assert leg.body["rod"].modes.count == 13
    # six static modes, seven others, of which two pairs are nearest to half
    assert effect_plan.levels(leg) == ({"rod": 6}, {"rod": 10})
    free = edited(leg, {"body.rod.modes": {"reference": "free-free", "count": 8}})
    assert effect_plan.levels(free) == ({"rod": 4},)
    ratios = edited(leg, {"body.rod.damping": {"ratios": [0.01] * 13}})
    assert effect_plan.levels(ratios) == ()


class Priced:
    """Pilots whose evaluations and errors are known: of dop853 1000 and 0, of the scene's own method as given."""

    def __init__(self, evaluations: int, error: float, *, own: str = "radau") -> None:
        solver = SimpleNamespace(integrator=own, rtol=1e-3, step=None)
        self.scene = SimpleNamespace(solver=solver, by_need=lambda: False)
        self.own, self.error = evaluations, error

    def variant(self, dropped: object) -> object:
        return SimpleNamespace(contacts=dict, stops=dict)

    def point(self, dropped: object, *, integrator: str, evaluations: int = 10**9, **_: object) -> object:
        taken = 1000 if integrator == "dop853" else self.own
        return SimpleNamespace(refused="takes long" if taken > evaluations else "", evaluations=taken)

    def differences(self, a: object, b: object) -> dict[str, Influence]:
        return {"bob.position": Influence(self.error)}


@pytest.mark.parametrize(
    "evaluations, error, integrator",
    [(400, 1e-4, "radau"), (400, 1.0, "dop853"), (2000, 1e-4, "dop853")],  # the first does as well in fewer
)
def test_a_plan_takes_the_scenes_own_integrator_where_that_does_as_well(
    evaluations: int, error: float, integrator: str
):
    runs: Any = Priced(evaluations, error)
    known = Integration("dop853", 1e-6, {"bob.position": 1e-5})
    found = cheaper_method(Search(runs, {"bob.position": 1e-2}), known)
    assert found.integrator == integrator


@pytest.mark.parametrize("evaluations, same", [(1100, True), (900, True), (1300, False)])
def test_a_plan_that_is_not_cheaper_by_a_fifth_is_the_scene_as_it_is(evaluations: int, same: bool):
    """The planned run takes 1000 evaluations; that of the scene by its own method as many as given."""
    runs: Any = Priced(evaluations, 0.0)
    runs.variant = lambda dropped: SimpleNamespace(contacts=lambda: {"pin": None}, stops=dict)
    runs.affordable_part, runs.extent = lambda dropped: 0.5, SimpleNamespace(most=10**6)
    chosen = Integration("dop853", 1e-6, {"bob.position": 1e-5})
    assert scene_is_cheaper(Search(runs, {"bob.position": 1e-2}), chosen) is same


def test_where_nothing_is_known_of_methods_a_plan_keeps_that_of_the_scene():
    unknown = Integration("dop853", 1e-8, {"bob.position": np.nan})
    for own, expected in (("radau", "radau"), ("dop853", "dop853")):
        runs: Any = Priced(400, 1.0, own=own)
        assert cheaper_method(Search(runs, {"bob.position": 1e-2}), unknown).integrator == expected
    left_open: Any = Priced(1, 0.0)
    left_open.scene.by_need = lambda: True
    assert cheaper_method(Search(left_open, {"bob.position": 1e-2}), unknown) is unknown


def test_a_plan_retains_a_rod_that_bends_by_more_than_the_accuracy_and_drops_one_that_does_not(tmp_path: Path):
    """The rod shortens by 0.33 um at rest and vibrates about that when it is let go, to twice as much."""
    leg = _tight(standing_leg(tmp_path))
    moving = edited(leg, {"drive.stroke": load_scene(tmp_path / "leg.toml").drive["stroke"].model_dump(mode="json")})
    moving = edited(moving, {"time.end": 0.02})
    kept = {}
    for requested in (1e-4, 1e-8):
        scene = edited(moving, {"accuracy": {"quantities": {"platform.position": {"absolute": requested}}}})
        planned, found = fc.plan(scene)
        kept[requested] = "rod" in planned.flexible()
        assert bool(found["kept"].sel(effect="body.rod.modes")) == kept[requested]
        assert found.attrs["evaluations"] > 0
    assert kept == {1e-4: False, 1e-8: True}


def test_the_planned_scene_is_a_file_that_runs_and_verifies(tmp_path: Path, command: Command):
    path = write("leg", tmp_path)[0]
    text = path.read_text().replace('end = "0.12 s"', 'end = "10 ms"').replace('integrator = "radau"\nrtol = 1e-5', "")
    path.write_text(text + '\n[accuracy]\nplatform.position = "1 mm"\n')
    out = tmp_path / "planned.toml"
    reported = command("plan", path, "-q", "--jobs", "1", "--out", out).out
    assert "may be omitted" in reported
    planned = load_scene(out)
    assert planned.accuracy is None
    assert 'extends = "leg.toml"' in out.read_text()
    reported = command("run", path, "-q", "--jobs", "1", "--planned", "--verify").out
    assert "| platform.position |" in reported
    assert "met" in reported


def test_bad_plans_are_refused_in_words(tmp_path: Path, command: Command, fresh: Path):
    path = write("pendulum", tmp_path)[0]
    path.write_text(path.read_text() + '\n[accuracy]\nnobody.position = "10 um"\n')
    assert "nobody" in command("plan", path, "-q", "--jobs", "1", code=2).err
    assert "--planned" in command("run", path, "-q", "--verify", code=2).err
    assert not (fresh / "plan").exists()


def test_the_command_plans_for_an_accuracy_of_its_own(tmp_path: Path, command: Command):
    path, out = write("pendulum", tmp_path)[0], tmp_path / "coarse.toml"
    said = command("plan", path, "-q", "--jobs", "1", "--accuracy", "1 %", "--out", out).out
    assert "gravity" in said
    assert 'extends = "' in out.read_text()
    assert load_scene(out).accuracy is None
    for wrong in ("5 mm", "200 %", "all"):
        assert "write a number with %" in command("plan", path, "--accuracy", wrong, code=2).err


def test_the_command_ranks_effects_within_a_budget(tmp_path: Path, command: Command):
    path = write("pendulum", tmp_path)[0]
    said = command("effects", path, "-q", "--budget", "5s", "--set", "time.end=0.1").out
    assert "gravity" in said
    assert "effects.nc" in said
    assert "chosen by --budget" in command("effects", path, "--budget", "5s", "--members", "4", code=2).err


def test_watched_components_that_never_change_are_left_out(tmp_path: Path, command: Command):
    """A pendulum does not move along its axis; an accuracy of that motion which is named in [accuracy] is refused."""
    path = write("pendulum", tmp_path)[0]
    text = path.read_text()
    path.write_text(text.replace('"rod.position",', '"rod.velocity.z",'))
    said = command("plan", path, "-q", "--jobs", "1").out  # to an accuracy of 1 %
    assert "gravity" in said
    assert said.count("Left out: rod.velocity.z, which never changes") == 1
    planned, found = fc.plan(load_scene(path), budget=30.0, accuracy="1 %")
    assert list(found["quantity"].values) == ["rod.velocity", "hinge.force"]
    assert planned.watched_quantities()[0].name == "rod.velocity.z"
    path.write_text(f'{text}\n[accuracy]\nrod.velocity = "1 %"\n"rod.velocity.z" = "1 %"\n')
    assert "[accuracy] rod.velocity.z" in command("plan", path, "-q", "--jobs", "1", code=2).err


def test_an_accuracy_above_all_that_moves_would_drop_the_motion_too(tmp_path: Path, fresh: Path):
    scene = edited(
        _tight(standing_leg(tmp_path)), {"accuracy": {"quantities": {"platform.position": {"absolute": 1.0}}}}
    )
    with pytest.raises((InputError, SolverError), match="remove all effects") as refused:
        plan.make_plan(scene, open_workplace())
    assert refused.value.exit_code == 2
    assert not [*(fresh / "plan").rglob("*.toml"), *(fresh / "plan").rglob("*.nc")]


def test_effects_of_a_pendulum_are_its_gravity(tmp_path: Path, command: Command):
    """Let go without gravity it stays where it is; with it, it swings: the influence is the way it swings."""
    path = write("pendulum", tmp_path)[0]
    scene = edited(load_scene(path), {"time.end": 0.1})
    found = fc.effects(scene)
    assert list(found["effect"].values) == ["load.gravity"]
    alone = found["dropped"].isel(effect=0)
    assert np.all(alone.values[np.isfinite(alone.values)] >= 0.0)
    name = next(str(q) for q in found["quantity"].values if str(q).endswith("position"))
    run = fc.run(scene).sel(body=name.partition(".")[0])
    position = run["position"].values
    way = np.linalg.norm(position - position[0], axis=1).max()
    if np.linalg.norm(run["velocity"].values[0]) < 1e-12:
        # runs of one tolerance, the same integration but for the size of the load: 1e-8 of the way
        assert float(alone.sel(quantity=name)) == pytest.approx(way, rel=1e-6)
    assert "load.gravity" in command("effects", path, "--set", "time.end=0.1", "--json", "-q").out


def test_what_nothing_couples_to_what_is_asked_for_is_not_integrated(tmp_path: Path):
    """A pendulum next to the leg moves by itself: the leg's motion is the same without it, to the last tolerance."""
    leg = _tight(load_scene(write("leg", tmp_path)[0]))
    stiff = variants.without_effects(leg, [e for e in variants.effects(leg) if e.name.startswith("body.")])
    parts = stiff.model_dump(mode="json", exclude_none=True)
    bob = rigid(1.0, 0.01, {"pivot": frame((-0.1, 0.0, 0.0))}, pose=frame((0.1, 0.0, 0.0)))
    hinge = joint("spherical", "ground.base", "bob.pivot")
    scene = edited(
        stiff,
        {
            "body": parts["body"] | {"bob": bob},
            "joint": parts["joint"] | {"hinge": hinge},
            "time.end": 0.01,
            "accuracy": {"quantities": {"platform.position": {"absolute": 1e-6}}},
        },
    )
    assert uncoupled_paths(scene, {"platform"}) == ("body.bob", "joint.hinge")
    assert set(uncoupled_paths(scene, {"bob"})).isdisjoint({"body.bob", "joint.hinge", "load.gravity"})
    planned, found = fc.plan(scene)
    assert "bob" not in planned.body
    assert "hinge" not in planned.joint
    assert "body.bob" in found.attrs["planned"]
    full, less = (
        fc.run(edited(s, {"accuracy": None}))["position"].sel(body="platform").values for s in (scene, planned)
    )
    # what was asked for; both runs are of a smooth motion, in which the plan's tolerance errs by far less
    assert np.abs(full - less).max() < 1e-6


def test_a_scene_that_cannot_be_run_as_it_is_has_no_plan(tmp_path: Path, fresh: Path):
    """Thrown about by its drive at 1e9 rad/s^2 the rod turns faster than it vibrates; rigid, it could."""
    scene = load_scene(write("slider-crank", tmp_path)[0])
    law = {"type": "polynomial", "coefficients": [0.0, 0.0, 1e9]}
    wild = edited(
        scene,
        {
            "drive.motor": {"joint": "main", "law": law},
            "time.end": 1e-3,
            "accuracy": {"quantities": {"slider.position": {"absolute": 1e-3}}},
        },
    )
    with pytest.raises(SolverError, match="cannot be run as it is") as refused:
        plan.make_plan(wild, open_workplace())
    assert refused.value.exit_code == 3
    assert not [*(fresh / "plan").rglob("*.toml"), *(fresh / "plan").rglob("*.nc")]


def test_from_python_a_scene_without_a_requested_accuracy_is_planned_for_a_fraction_of_each_size(tmp_path: Path):
    """Without gravity the template's pendulum hangs still: the plan keeps it, and so its run is the scene's."""
    both = planned, found = fc.plan(write("pendulum", tmp_path)[0], budget=30.0, accuracy="1 %")
    assert "gravity" in planned.load
    # the planned run has another tolerance: its error is within the accuracy that it was chosen for
    assert (found["error"] <= found["requested"]).all()
    assert (found["scatter"] == 0.0).all()
    shown = found._repr_html_()
    assert "must be modelled" in shown
    assert "src='data:image/png" in shown
    assert "met" in shown
    shown = both._repr_html_()
    assert shown.index("must be modelled") < shown.index("gravity (gravity)")
