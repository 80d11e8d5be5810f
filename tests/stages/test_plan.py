"""Plans: bounds are bounds, responses have closed forms, decisions follow the accuracy, files say what differs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import flexclear as fc
from flexclear.commands import plan
from flexclear.commands.new import write
from flexclear.pipeline.core.artifacts.effect_size import Influence
from flexclear.pipeline.core.scene import variants
from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.quantity import Quantity
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.variants import uncoupled
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.core.workflow import cores
from flexclear.pipeline.dynamics.linear.clearance_response import SQUARED_RANK, bounds, opening_map
from flexclear.pipeline.dynamics.linear.response import Response, first_excited, response, vibration
from flexclear.pipeline.dynamics.model.constraints import constraints
from flexclear.pipeline.dynamics.model.merge import Placement
from flexclear.pipeline.dynamics.plan.budget import Chosen, Search
from flexclear.pipeline.dynamics.plan.elements import mesh
from flexclear.pipeline.dynamics.plan.search import summed
from flexclear.pipeline.dynamics.plan.tolerance import cheaper_method, scene_is_cheaper
from flexclear.pipeline.dynamics.run.run import Run, integrate
from flexclear.stages import effect_plan, simulation, watched_quantities
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import FailedTasksError, open_workplace
from tests.properties.mechanisms import frame, joint, rigid
from tests.stages.conftest import Command

#: of the leg's rod [m, Pa, kg/m^3], and what stands on it [kg]
LENGTH, RADIUS, MODULUS, DENSITY, PLATFORM = 0.24, 0.01, 71.7e9, 2740.0, 3.0
GRAVITY = 9.81
#: acceleration with which a base starts under a rod [m/s^2]
START = 981.0


@pytest.fixture(autouse=True, scope="module")
def _results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Results that tests share, so that each body is made once, in this process: others take seconds to start.

    Who looks into results has its own, `fresh`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLEXCLEAR_RESULTS", str(tmp_path_factory.mktemp("results")))
        patch.setattr(cores, "cores", lambda: 1)
        yield


class Pilot(NamedTuple):
    """A scene with the run of its ideal twin, and what is known of its bodies."""

    scene: Scene
    ideal: Run
    inputs: dict[str, xr.Dataset]

    def bounds(self, *chosen: Quantity) -> Mapping[str, Mapping[str, float]]:
        return bounds(self.scene, self.ideal, chosen)

    def response(self, *chosen: Quantity) -> Response:
        """Of the flexible bodies."""
        return response(self.ideal, simulation.bundles(self.inputs), chosen)


def pilot(scene: Scene) -> Pilot:
    place, task = open_workplace(), effect_plan.task(edited(scene, {"accuracy": {"quantities": {}}}))
    outcome = place.bring(list(task.inputs.values()), 1)
    inputs = {name: place.store.load(outcome.records[below]) for name, below in task.inputs.items()}
    dropped = [e for e in variants.effects(scene) if not e.name.startswith("load.")]
    bare = watched_quantities.plain(variants.without(scene, dropped))
    rigid = {name: inputs[name] for name in Graph(bare, shown=False).bodies()}
    return Pilot(scene, integrate(simulation.rebuild(simulation.params(bare), rigid), {}, silent), inputs)


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Pilot:
    return pilot(_standing_leg(tmp_path_factory.mktemp("leg")))


def _standing_leg(tmp_path: Path) -> Scene:
    """The leg upright and at rest under its own weight."""
    scene = load_scene(write("leg", tmp_path)[0])
    law = {"type": "constant", "value": 0.0}
    return edited(scene, {"drive.stroke": {"joint": "slide", "law": law}, "time.end": 1e-3, "output.interval": 1e-4})


def test_the_response_of_a_rod_under_a_sudden_load_is_twice_that_of_a_bar(standing: Pilot):
    """A bar of weight w under a load F shortens by (F + w/2) L/(E A); let go, the platform swings to twice that, and
    the force that its ball carries to twice its weight."""
    found = standing.response(Quantity("platform", "position"), Quantity("ball", "force"))
    area = np.pi * RADIUS**2
    weight = DENSITY * area * LENGTH * GRAVITY
    expected = (PLATFORM * GRAVITY + 0.5 * weight) * LENGTH / (MODULUS * area)
    # the static modes make the end compliance exact, and seven more most of the body's weight acting along it: of that
    # half weight, a fortieth of the load, the modes with the ends held have eight tenths in the axial direction
    assert found.influence["platform.position"] == pytest.approx(2.0 * expected, rel=5e-3)
    # the part of the platform's weight that swings, and a twentieth of it more for the mass of the rod
    assert found.influence["ball.force"] == pytest.approx(PLATFORM * GRAVITY, rel=0.05)


def _between_ball_joints(tmp_path: Path) -> Scene:
    """The leg's rod between two ball joints, on a base that starts upwards across it; a tip slides along the rod."""
    write("leg", tmp_path)
    modes = {"reference": "craig-bampton", "count": 13, "interfaces": ["bottom", "top"]}
    rail = {"axis": [1, 0, 0]}
    base = rigid(1.0, 1e-2, {"lift": {"axis": [0, 1, 0]}, "O": {}, "rail": {**rail, "position": [LENGTH, 0, 0]}})
    tip = rigid(1e-3, 1e-9, {"c": {}, "rail": rail}, pose={"position": [LENGTH, 0, 0]})
    table = {
        "title": "a rod between ball joints",
        "time": {"end": 0.02},
        "output": {"interval": 5e-5},
        "body": {
            "ground": {"type": "ground", "frames": {"O": {"axis": [0, 1, 0]}}},
            "base": base,
            "rod": {"type": "flexible", "mesh": str(tmp_path / "leg_rod.toml"), "modes": modes},
            "tip": tip,
        },
        "joint": {
            "lift": {"type": "prismatic", "between": ["ground.O", "base.lift"]},
            "foot": {"type": "spherical", "between": ["base.O", "rod.bottom"]},
            "head": {"type": "spherical", "between": ["rod.top", "tip.c"]},
            "rail": {"type": "prismatic", "between": ["base.rail", "tip.rail"]},
        },
        "drive": {"lift": {"joint": "lift", "law": {"type": "polynomial", "coefficients": [0.0, 0.0, 0.5 * START]}}},
    }
    return Scene.model_validate(table)


def test_the_response_has_the_change_of_length_of_a_rod_that_bends(tmp_path: Path):
    """A beam on two supports bends by a sum of sines, of amplitudes 4 q L^4/(pi^5 E I k^5), twice that when it starts
    suddenly. With linear shapes, about the tangent at its foot, its end is w = 4 q L^4/(pi^4 E I k^4) off that tangent
    by each; so its length between the ends grows by w^2/(2 L), and the tip, which no bending moves at first order."""
    found = pilot(_between_ball_joints(tmp_path)).response(Quantity("tip", "position"))
    weight = DENSITY * np.pi * RADIUS**2 * START
    w = 2.0 * 4.0 * weight * LENGTH**4 / (np.pi**4 * MODULUS * 0.25 * np.pi * RADIUS**4)
    # of further sines the squares are 3^-8 of that; the elements' shear, and the light tip, a thousandth
    assert found.influence["tip.position"] == pytest.approx(w**2 / (2.0 * LENGTH), rel=2e-3)


@pytest.mark.parametrize("load, known", [(0.09, True), (0.11, False), (-0.11, False)])
def test_near_a_buckling_load_the_response_is_unknown(tmp_path: Path, load: float, known: bool):
    """An axial load P changes the square of a beam's first frequency by 2 P/(Euler's load), as a fraction, with linear
    shapes: in a sine of amplitude a its end moves by (pi a)^2/(2 L), twice as far as that of a beam that keeps its
    length, and the other way."""
    euler = np.pi**2 * MODULUS * 0.25 * np.pi * RADIUS**4 / LENGTH**2
    force = {"type": "point-force", "frame": "tip.c", "force": [load * euler, 0.0, 0.0]}
    found = pilot(edited(_between_ball_joints(tmp_path), {"load.push": force})).response(Quantity("tip", "position"))
    assert np.isfinite(found.influence["tip.position"]) == known


def test_the_reported_vibration_is_one_that_the_loads_excite(standing: Pilot):
    """Loads along an upright leg leave its bending at rounding, which the sudden weight seemed to magnify 12 times.

    The bar with a mass at its end has b tan b = (its mass)/(that mass), b = 2 pi f L sqrt(rho/E).
    """
    found = standing.response()
    beta = brentq(lambda b: b * np.tan(b) - DENSITY * np.pi * RADIUS**2 * LENGTH / PLATFORM, 0.1, 1.0)
    # the static modes have the end's compliance, and the rod's mass is a fifteenth
    assert found.excited == pytest.approx(beta * np.sqrt(MODULUS / DENSITY) / (2.0 * np.pi * LENGTH), rel=5e-3)
    assert found.first < 0.2 * found.excited  # bending
    # a sudden load doubles what it does at rest, to rounding
    assert found.amplification == pytest.approx(2.0, rel=1e-9)


def test_what_rounding_leaves_excites_nothing():
    """The first of two shapes is at right angles to all loads, but for the last digits."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(9, 9)))[0]
    loads = np.outer(np.linspace(1.0, 4.0, 20), turn[:, 5] + 1e-3 * turn[:, 6])
    shapes = turn[:, [0, 6, 5]]
    assert 0.0 < np.abs(loads @ shapes[:, 0]).max() < 1e-14
    assert first_excited(loads, shapes) == 1
    assert first_excited(loads, shapes[:, :1]) is None
    assert first_excited(0.0 * loads, shapes) is None


def test_vibrations_about_a_ramp_and_a_step_have_their_closed_form_amplitudes():
    """From rest, an oscillator under a force a t vibrates by a/omega^3, under a sudden force F by F/omega^2."""
    time, omega = np.linspace(0.0, 0.3, 31), np.array([40.0, 900.0])
    ramp = vibration(np.outer(time, [3.0, 3.0]), omega, time)
    step = vibration(np.full((31, 2), 5.0), omega, time)
    # exact for forces that are straight between the rows: rounding of 31 products
    np.testing.assert_allclose(ramp, np.broadcast_to(3.0 / omega**3, ramp.shape), rtol=1e-11)
    np.testing.assert_allclose(step, np.broadcast_to(5.0 / omega**2, step.shape), rtol=1e-11)
    # a force that sets in at once, between two rows of one time, does the same from then on
    jump = vibration(np.repeat([[0.0, 0.0], [5.0, 5.0]], [16, 16], axis=0), omega, np.insert(time, 15, time[15]))
    assert not jump[:16].any()
    np.testing.assert_allclose(jump[16:], np.broadcast_to(5.0 / omega**2, (16, 2)), rtol=1e-11)


def test_a_jump_of_a_drives_acceleration_is_no_ramp_over_one_output(tmp_path: Path):
    """The rates of quasi-static deformation do not grow with the number of outputs at the end of a step."""
    leg, law = _standing_leg(tmp_path), {"type": "step", "start": 0.0, "end": 4e-4, "change": 1e-4}
    speeds = []
    for interval in (1e-4, 2e-5):
        moved = edited(leg, {"drive.stroke": {"joint": "slide", "law": law}, "output.interval": interval})
        speeds.append(pilot(moved).response(Quantity("platform", "velocity")).influence["platform.velocity"])
    # what is left: the law between the breaks, straight from output to output; with a ramp the ratio is five
    assert speeds[1] == pytest.approx(speeds[0], rel=0.1)


def test_the_recommended_elements_give_the_requested_error(tmp_path: Path):
    """The estimated error of a frequency on few elements is the true one; as many elements as recommended give the
    requested error."""
    leg = load_scene(write("leg", tmp_path)[0])

    def reduced(factor: int) -> xr.Dataset:
        task = Graph(coarse, shown=False, recipe={"elements": factor}).bundle["rod"]
        place = open_workplace()
        return place.store.load(place.bring([task], 1).records[task])

    recipe = tmp_path / "coarse.toml"
    text = (tmp_path / "leg_rod.toml").read_text()
    recipe.write_text(re.sub(r"(?m)^elements = .*$", "elements = 2", text))
    modes = {"reference": "craig-bampton", "count": 8, "interfaces": ["bottom", "top"]}
    body = leg.body["rod"].model_dump(mode="json", exclude_none=True, exclude={"modes", "mesh", "damping"})
    coarse = edited(leg, {"body.rod": {**body, "mesh": str(recipe), "modes": modes}})
    one, two, many = (reduced(factor) for factor in (1, 2, 8))
    # bending does 1 mm, of which the mesh may err by a tenth of 10 um; in a second the lowest vibration loses its phase
    found = mesh(2, one, two, {"x": 1e-3}, {"x": 1e-5}, 1.0)
    exact = many["frequency"].values
    true = np.abs(one["frequency"].values - exact) / exact
    # the power by which errors fall is that of fine meshes, and this one is coarse
    assert found.frequency == pytest.approx(true.max(), rel=0.25)
    assert found.called_for > found.given
    factor = -(-found.called_for // 2)
    left = mesh(2 * factor, reduced(factor), reduced(2 * factor), {"x": 1e-3}, {"x": 1e-5}, 1.0)
    assert left.error["x"] < 2e-6  # 1e-6 is aimed at, by the power law from a coarse mesh
    assert mesh(2, one, one, {"x": 1e-3}, {"x": 1e-5}, 1.0).called_for == 1


def test_fewer_modes_to_choose_from_are_the_static_ones_and_half_of_the_others(tmp_path: Path):
    leg = load_scene(write("leg", tmp_path)[0])
    assert leg.body["rod"].modes.count == 13
    # six static modes, seven others, of which two pairs are nearest to half
    assert effect_plan.levels(leg) == ({"rod": 6}, {"rod": 10})
    free = edited(leg, {"body.rod.modes": {"reference": "free-free", "count": 8}})
    assert effect_plan.levels(free) == ({"rod": 4},)
    ratios = edited(leg, {"body.rod.damping": {"ratios": [0.01] * 13}})
    assert effect_plan.levels(ratios) == ()


def test_a_quantity_that_no_bound_holds_for_is_not_bounded_by_those_of_others():
    """A pose and a force asked for at once: the bound is of the pose alone."""
    bounds_of_joints = [{"a.position": 1.0}, {"a.position": 2.0}]
    assert summed(bounds_of_joints, {"a.position": 1.0, "b.force": 1.0}) == {"a.position": 3.0, "b.force": np.inf}


def test_the_bound_of_a_loose_crank_pin_is_that_of_the_slider_crank(tmp_path: Path):
    """A slider follows an opening d of the crank pin by at most d/cos(b), b the rod's angle, at most asin(r/l)."""
    reach = pilot(load_scene(write("slider-crank", tmp_path)[0])).bounds(Quantity("slider", "position"))
    ratio = 1.0 / np.sqrt(1.0 - 0.25**2)
    # the depth to which the pin is pressed comes on top, some percent; the steepest angle lies between the poses seen
    assert 0.995 * ratio * 1e-4 < reach["pin"]["slider.position"] < 1.1 * ratio * 1e-4


def test_where_joints_leave_a_freedom_there_is_no_bound(tmp_path: Path):
    loose = pilot(edited(_standing_leg(tmp_path), {"drive": {}, "load": {}}))
    chosen = Quantity("platform", "position")
    assert loose.bounds(chosen)["ball"]["platform.position"] == np.inf
    assert loose.response(chosen).influence["platform.position"] == np.inf


def _tight(scene: Scene) -> Scene:
    """Without the clearance, which is another matter."""
    return variants.without(scene, [e for e in variants.effects(scene) if e.name.startswith("joint.")])


class Priced:
    """Pilots whose evaluations and errors are known: of dop853 1000 and 0, of the scene's own method as given."""

    def __init__(self, evaluations: int, error: float, *, own: str = "radau") -> None:
        solver = SimpleNamespace(integrator=own, rtol=1e-3, step=None)
        self.scene = SimpleNamespace(solver=solver, by_need=lambda: False)
        self.own, self.error = evaluations, error

    def variant(self, dropped: object) -> object:
        return SimpleNamespace(contacts=dict, stop={})

    def point(self, dropped: object, *, integrator: str, evaluations: int = 10**9, **_: object) -> object:
        taken = 1000 if integrator == "dop853" else self.own
        return SimpleNamespace(refused="takes long" if taken > evaluations else "", evaluations=taken)

    def between(self, a: object, b: object) -> dict[str, Influence]:
        return {"bob.position": Influence(self.error)}


@pytest.mark.parametrize(
    "evaluations, error, integrator",
    [(400, 1e-4, "radau"), (400, 1.0, "dop853"), (2000, 1e-4, "dop853")],  # the first does as well in fewer
)
def test_a_plan_takes_the_scenes_own_integrator_where_that_does_as_well(
    evaluations: int, error: float, integrator: str
):
    runs: Any = Priced(evaluations, error)
    known = Chosen("dop853", 1e-6, {"bob.position": 1e-5})
    found = cheaper_method(Search(runs, {"bob.position": 1e-2}), known)
    assert found.integrator == integrator


@pytest.mark.parametrize("evaluations, same", [(1100, True), (900, True), (1300, False)])
def test_a_plan_that_is_not_cheaper_by_a_fifth_is_the_scene_as_it_is(evaluations: int, same: bool):
    """The planned run takes 1000 evaluations; that of the scene by its own method as many as given."""
    runs: Any = Priced(evaluations, 0.0)
    runs.variant = lambda dropped: SimpleNamespace(contacts=lambda: {"pin": None}, stop={})
    runs.part, runs.extent = lambda dropped: 0.5, SimpleNamespace(most=10**6)
    chosen = Chosen("dop853", 1e-6, {"bob.position": 1e-5})
    assert scene_is_cheaper(Search(runs, {"bob.position": 1e-2}), chosen) is same


def test_where_nothing_is_known_of_methods_a_plan_keeps_that_of_the_scene():
    unknown = Chosen("dop853", 1e-8, {"bob.position": np.nan})
    for own, expected in (("radau", "radau"), ("dop853", "dop853")):
        runs: Any = Priced(400, 1.0, own=own)
        assert cheaper_method(Search(runs, {"bob.position": 1e-2}), unknown).integrator == expected
    left_open: Any = Priced(1, 0.0)
    left_open.scene.by_need = lambda: True
    assert cheaper_method(Search(left_open, {"bob.position": 1e-2}), unknown) is unknown


def test_a_plan_retains_a_rod_that_bends_by_more_than_the_accuracy_and_drops_one_that_does_not(tmp_path: Path):
    """The rod shortens by 0.33 um at rest and vibrates about that when it is let go, to twice as much."""
    leg = _tight(_standing_leg(tmp_path))
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
    assert "requests no accuracy" in command("plan", path, "-q", "--jobs", "1", "--verify", code=2).err
    path.write_text(path.read_text() + '\n[accuracy]\nnobody.position = "10 um"\n')
    assert "nobody" in command("plan", path, "-q", "--jobs", "1", code=2).err
    assert "--planned" in command("run", path, "-q", "--verify", code=2).err
    assert not (fresh / "plan").exists()


def test_without_a_requested_accuracy_three_levels_are_planned(tmp_path: Path, command: Command):
    path = write("pendulum", tmp_path)[0]
    said = command("plan", path, "-q", "--jobs", "1").out
    assert all(f"| {level}" in said for level in plan.LEVELS)
    assert said.count("gravity") >= 3  # without it nothing swings


def test_watched_components_that_never_change_are_left_out_of_the_levels(tmp_path: Path, command: Command):
    """A pendulum does not move along its axis; an accuracy of that motion which is named in [accuracy] is refused."""
    path = write("pendulum", tmp_path)[0]
    text = path.read_text()
    path.write_text(text.replace('"rod.position",', '"rod.velocity.z",'))
    said = command("plan", path, "-q", "--jobs", "1").out
    assert all(f"| {level}" in said for level in plan.LEVELS)
    assert said.count("gravity") >= 3
    assert said.count("Left out: rod.velocity.z, which never changes") == 1
    planned, found = fc.plan(load_scene(path), budget=30.0, accuracy="1 %")
    assert list(found["quantity"].values) == ["rod.velocity", "hinge.force"]
    assert planned.watched()[0].name == "rod.velocity.z"
    path.write_text(f'{text}\n[accuracy]\nrod.velocity = "1 %"\n"rod.velocity.z" = "1 %"\n')
    assert "[accuracy] rod.velocity.z" in command("plan", path, "-q", "--jobs", "1", code=2).err


def test_an_accuracy_above_all_that_moves_would_drop_the_motion_too(tmp_path: Path, fresh: Path):
    scene = edited(
        _tight(_standing_leg(tmp_path)), {"accuracy": {"quantities": {"platform.position": {"absolute": 1.0}}}}
    )
    with pytest.raises((InputError, FailedTasksError), match="remove all effects") as refused:
        plan.bring(scene, open_workplace())
    assert refused.value.exit_code == 2
    assert not [*(fresh / "plan").rglob("*.toml"), *(fresh / "plan").rglob("*.nc")]


def test_effects_of_a_pendulum_are_its_gravity(tmp_path: Path, command: Command):
    """Let go without gravity it stays where it is; with it, it swings: the influence is the way it swings."""
    path = write("pendulum", tmp_path)[0]
    scene = edited(load_scene(path), {"time.end": 0.1})
    found = fc.effects(scene)
    assert list(found["effect"].values) == ["load.gravity"]
    alone = found["dropped"].isel(effect=0, other=0)
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
    stiff = variants.without(leg, [e for e in variants.effects(leg) if e.name.startswith("body.")])
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
    assert uncoupled(scene, {"platform"}) == ("body.bob", "joint.hinge")
    assert set(uncoupled(scene, {"bob"})).isdisjoint({"body.bob", "joint.hinge", "load.gravity"})
    planned, found = fc.plan(scene)
    assert "bob" not in planned.body
    assert "hinge" not in planned.joint
    assert "body.bob" in found.attrs["planned"]
    full, less = (
        fc.run(edited(s, {"accuracy": None}))["position"].sel(body="platform").values for s in (scene, planned)
    )
    # what was asked for; both runs are of a smooth motion, in which the plan's tolerance errs by far less
    assert np.abs(full - less).max() < 1e-6


def test_the_adjoint_of_a_pose_is_the_least_squares_response_to_openings(standing: Pilot):
    """Beside the pseudoinverse of the joints' rates, which has no closed form but another computation."""
    found = standing.ideal
    poses = [Placement(frame["origin"], frame["axes"]) for frame in found.observed.links[0]]
    lever = opening_map(found.model, constraints(found.model.mechanism), poses)
    G = lever.gradient.toarray()
    shown = np.random.default_rng(0).standard_normal((3, G.shape[0])) @ G
    expected = -shown @ np.linalg.pinv(G)
    adjoint, free = lever.adjoint(shown)
    # the shift that makes the factors exist, 1e-13 of the largest squared singular value, next to the smallest
    values = np.linalg.svd(G, compute_uv=False)
    shift = SQUARED_RANK * (values[0] / values[values > 1e-8 * values[0]][-1]) ** 2
    assert np.abs(adjoint - expected).max() < 100.0 * shift * np.abs(expected).max()
    assert free < 1e-6 * np.abs(shown).max()


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
    with pytest.raises(FailedTasksError, match="cannot be run as it is") as refused:
        plan.bring(wild, open_workplace())
    assert refused.value.exit_code == 3
    assert not [*(fresh / "plan").rglob("*.toml"), *(fresh / "plan").rglob("*.nc")]


def test_from_python_a_scene_without_a_requested_accuracy_is_planned_for_a_fraction_of_each_size(tmp_path: Path):
    """Without gravity the template's pendulum hangs still: the plan keeps it, and so its run is the scene's."""
    planned, found = fc.plan(write("pendulum", tmp_path)[0], budget=30.0, accuracy="1 %")
    assert "gravity" in planned.load
    # the planned run has another tolerance: its error is within the accuracy that it was chosen for
    assert (found["error"] <= found["requested"]).all()
    assert (found["scatter"] == 0.0).all()
    shown = found._repr_html_()
    assert "must be modelled" in shown
    assert "<img src='data:image/png" in shown
    assert "met" in shown


def test_where_no_accuracy_has_a_plan_the_command_ends_with_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refused(*_: Any) -> None:
        raise InputError("[accuracy] tip.position", "is a relative accuracy, but the quantity is constant")

    monkeypatch.setattr(plan, "bring", refused)
    with pytest.raises(InputError, match="the quantity is constant"):
        plan.levels(load_scene(write("slider-crank", tmp_path)[0]), open_workplace())
