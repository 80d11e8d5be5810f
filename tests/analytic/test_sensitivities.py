"""Derivatives by numbers of the scene against closed forms, and against differences of converged runs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.dynamics.record.point import Runner
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.dynamics.sensitivity.parameters import Parameter
from flexclear.scene.load import edited, load_scene, number_at
from flexclear.scene.quantity import parse_recorded
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles
from tests.analytic.test_contact_pairs import GUIDE, SIDE, WIDTH, sliding
from tests.analytic.test_films import BALL, GAP, oiled
from tests.analytic.test_tilting_pins import FLAT, pinned
from tests.properties.mechanisms import GRAVITY, body, frame, ground, joint, rigid
from tests.properties.mechanisms import scene as small

#: peaks are located to 1e-5 of an impact's duration, in which their derivatives change by their own size
PEAKS = 5e-4
TIGHT = {"solver.rtol": 1e-12, "solver.integrator": "dop853"}


def load(name: str, **changes: Any) -> Scene:
    return load_scene(TREE / "scenes/checks" / f"{name}.toml", TIGHT | changes)


def differences(scene: Scene, of: list[str], to: str, step: float) -> dict[str, np.ndarray]:
    """The same derivatives by central differences of four runs; step: relative to the number."""
    recorded = [parse_recorded(name, scene.owners()) for name in of]
    runner, number = Runner(bundles(scene), recorded), Parameter(to, *number_at(scene, to))
    size = step * number.unit
    points = {k: runner.run(edited(scene, {to: number.changed(k * step)})) for k in (-2, -1, 1, 2)}
    assert not any(point.refused for point in points.values())
    at = {
        name: {k: np.asarray(point.values[one.name]) for k, point in points.items()}
        for name, one in zip(of, recorded, strict=True)
    }
    return {name: (v[-2] - 8.0 * v[-1] + 8.0 * v[1] - v[2]) / (12.0 * size) for name, v in at.items()}


def agree(scene: Scene, of: list[str], to: dict[str, float], tolerance: float) -> xr.Dataset:
    """Compare with differences; to: their relative steps, by parameter."""
    found = sensitivities(scene, bundles(scene), silent, of, list(to))
    for parameter, step in to.items():
        stepped = differences(scene, of, parameter, step)
        for name in of:
            rough = tolerance if "peak" not in name else PEAKS
            exact = found[name].sel(parameter=parameter).values
            assert exact == pytest.approx(stepped[name], rel=rough, abs=rough * np.abs(stepped[name]).max())
    return found


def test_a_pendulum_swings_faster_with_gravity() -> None:
    """From rest the angle is a function of t sqrt(g), whatever the mass: d angle / dg = t rate / 2 g.

    Tolerance: a hundred times what the run itself is good to in ten seconds.
    """
    scene = load("pendulum")
    number = "load.gravity.acceleration.1"
    found = sensitivities(scene, {}, silent, ["hinge.position", "hinge.velocity.final"], [number, "body.bob.mass"])
    from flexclear import dynamics

    run = dynamics.simulate(scene, {}, silent)
    rate = run.joint_velocity.sel(coordinate="hinge").interp(time=found.time).values
    by_gravity, by_mass = found["hinge.position"].values
    assert by_gravity == pytest.approx(found.time.values * rate / (2.0 * -9.81), abs=4e-8)
    assert np.abs(by_mass).max() < 4e-8


def test_bennett_where_other_closure_rows_are_solved_for() -> None:
    """From 0.38 s on other rows are kept. Tolerance: at rtol 1e-10 the differences are good to 1e-5."""
    scene = load("bennett", **{"time.end": 1.5, "solver.rtol": 1e-10})
    agree(scene, ["coupler.position.x.final"], {"body.coupler.mass": 1e-3}, 1e-3)


def test_slider_crank_through_impacts() -> None:
    """Six impacts and more, each of which magnifies what comes before it.

    Tolerance: differences of peak forces and impulses are good to 1e-6.
    """
    scene = load("clearance_slider_crank", **{"time.end": 0.03})
    of = ["piston.position.final", "piston.velocity.final", "pin.peak_force", "pin.impulse", "pin.impact_times.last"]
    to = {"joint.pin.clearance": 1e-4, "body.rod.mass": 1e-5, "body.crank.angular_velocity.2": 1e-6}
    found = agree(scene, of, to, 1e-5)
    assert np.isfinite(found["pin.peak_force"].values).all()


@pytest.mark.parametrize("law", ["lankarani-nikravesh", "kelvin-voigt"])
def test_a_ball_that_falls_and_rebounds(law: str) -> None:
    """The force of the second law jumps where the contact begins, and it has a kink before it ends.

    Tolerance: steps that pass a kink err by what the tolerance leaves, and so do the differences.
    """
    scene = load("bounce", **{"joint.contact.normal.law": law, "time.end": 0.5, "solver.rtol": 1e-10})
    of = ["ball.position.final", "ball.velocity.final", "contact.peak_force", "contact.impulse"]
    agree(scene, of, {"joint.contact.normal.stiffness": 1e-2, "load.gravity.acceleration.2": 1e-3}, 1e-3)


def test_a_four_bar_from_its_assembly_on() -> None:
    """A length changes the start: where the loop closes, and with which speeds.

    Tolerance: a thousand times the tolerance by which starts are closed, over the step.
    """
    scene = load("four_bars_1", **{"time.end": 0.5, "body.rod1.frames.top.position.1": 1.01})
    of = ["beam1.position.final", "beam1.velocity.final", "foot0.force.final", "left1.force.largest"]
    to = {"body.beam1.mass": 1e-3, "body.beam1.frames.right.position.0": 1e-3, "body.rod1.angular_velocity.2": 1e-3}
    agree(scene, of, to, 1e-6)


def test_a_flexible_body() -> None:
    """Tolerance: of differences, where vibrations have turned fifty times."""
    scene = load("flexible_slider_crank", **{"time.end": 0.01})
    of = ["slider.velocity.final", "crank_pin.force.final", "motor.force.final"]
    agree(scene, of, {"body.slider.mass": 1e-4, "drive.motor.law.coefficients.1": 1e-5}, 1e-5)


LAWS: dict[str, Any] = {
    "step": {"type": "step", "start": [0.05], "end": [0.15], "change": [0.2]},
    "harmonic": {"type": "harmonic", "amplitude": [0.1], "frequency": [30.0], "phase": [0.1]},
}


@pytest.mark.parametrize(
    "law, number",
    [("step", "start.0"), ("step", "change.0"), *(("harmonic", f"{n}.0") for n in LAWS["harmonic"] if n != "type")],
)
def test_laws_of_time(law: str, number: str) -> None:
    """A pendulum on a cart that is driven; where its law begins the acceleration jumps, and that time is a number.

    Tolerance: of differences.
    """
    bodies = {
        "base": ground(rail=[0.0, 0.0, 0.0]),
        "cart": body([0.0, 0.0, 0.0], frames={"rail": frame([0, 0, 0], [0, np.pi / 2, 0]), "pin": frame([0, 0, 0])}),
        "bob": body([0.0, -0.3, 0.0], frames={"pin": frame([0.0, 0.3, 0.0])}),
    }
    bodies["base"]["frames"]["rail"]["rotation_vector"] = [0, np.pi / 2, 0]
    joints = {"rail": joint("prismatic", "base.rail", "cart.rail"), "pin": joint("revolute", "cart.pin", "bob.pin")}
    drive = {"rail": {"joint": "rail", "law": LAWS[law]}}
    scene = Scene.model_validate(small(bodies, joints, drive=drive, load=GRAVITY, end=0.2))
    agree(
        scene,
        ["bob.position.final", "bob.velocity.final", "rail.force.final"],
        {f"drive.rail.law.{number}": 1e-4},
        1e-7,
    )


def test_beyond_the_horizon_there_is_nothing() -> None:
    scene = load("clearance_pendulum", **{"time.end": 0.2})
    of = ["bar.position", "bar.position.final"]
    found = sensitivities(scene, {}, silent, of, ["joint.hinge.clearance"], horizon=0.1)
    assert np.isfinite(found[of[0]].sel(time=slice(None, 0.1))).all()
    assert np.isnan(found[of[0]].sel(time=slice(0.1001, None))).all()
    assert np.isnan(found[of[1]]).all()
    assert "0.1 s" in found.attrs["validity"]


@pytest.mark.parametrize(
    "of, to, words",
    [
        ("bob.position", "body.bob.type", "is not a number"),
        ("bob.position", "body.bob.weight", "there is no"),
        ("bob.position", "solver.rtol", "is not a number of body, joint"),
        ("bob.place", "body.bob.mass", "there is no quantity"),
        ("bob.position.series", "body.bob.mass", "write bob.position"),
    ],
)
def test_what_means_nothing_is_refused(of: str, to: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        sensitivities(load("pendulum", **{"time.end": 0.1}), {}, silent, [of], [to])


def test_friction_of_ideal_joints_that_feeds_back() -> None:
    """Loads of the bearings are iterated; coefficient, length of the guide and mass change them in every evaluation.

    Tolerance: differences of runs through reversals of loads are good to 1e-6.
    """
    scene = load("rubbing_slider_crank", **{"time.end": 0.06})
    of = ["slider.position.x.final", "crank.angular_velocity.z.final"]
    agree(
        scene,
        of,
        dict.fromkeys(("joint.P.friction.dynamic", "joint.P.friction.length", "body.slider.mass"), 1e-3),
        1e-5,
    )


def cam(**changes: Any) -> Scene:
    """A follower on a rotating cam, by the law of Hertz between two circles, with a roller loose on its pin.

    At rest in equilibrium the pin touches its journal, without sliding.
    """
    steel, turning = {"youngs_modulus": 2.07e11, "poisson": 0.29}, {"type": "polynomial", "coefficients": [1.5, 60.0]}
    along = {"position": [0.0, 0.0, 0.0], "axis": [0, 1, 0]}
    bodies = {
        "ground": {"type": "ground", "frames": {"cam": {}, "guide": along}},
        "cam": rigid(1.0, 1e-3, {"axle": {}, "centre": {"position": [0.01, 0.0, 0.0]}}),
        "follower": rigid(0.5, 1e-3, {"pin": {}, "guide": along}),
        "roller": rigid(0.05, 2.5e-6, {"centre": {}}),
    }
    roller = joint(
        "clearance-revolute", "roller.centre", "follower.pin", clearance=5e-5, pin_radius=0.004, length=0.012
    )
    roller |= {"journal_material": steel, "pin_material": steel, "normal": {"law": "flores", "restitution": 0.5}}
    roller["friction"] = {"law": "modified-coulomb", "static": 0.1, "dynamic": 0.08}
    roller["friction"] |= {"v_static": 1e-3, "v_dynamic": 0.01}
    contact = {"type": "line-expression", "between": ["cam.centre", "roller.centre"]}
    contact |= {"force": "-k * max(0, reach - length)^1.5", "values": {"k": "6.3e8 N/m^1.5", "reach": "0.04 m"}}
    spring = {"type": "joint-spring", "joint": "guide", "stiffness": 4e3, "rest": 0.01}
    joints = {
        "axle": joint("revolute", "ground.cam", "cam.axle"),
        "guide": joint("prismatic", "ground.guide", "follower.guide"),
        "roller": roller,
    }
    table = small(
        bodies,
        joints,
        end=0.004,
        load={"contact": contact, "spring": spring},
        drive={"motor": {"joint": "axle", "law": turning}},
        start={"at": "equilibrium", "joint": {"guide": {"near": 0.05}}},
    )
    return edited(Scene.model_validate(table), TIGHT | changes)


def test_from_an_equilibrium_with_a_contact_at_rest() -> None:
    """Friction at rest has a slope, nothing holds the roller's angle, and positions of zero are numbers of metres.

    Tolerance: differences of starts with penetrations of 1.5 um; steps of a place are a fraction of that.
    """
    to, of = {"load.contact.values.k": 1e-3, "joint.roller.clearance": 1e-3}, ["guide.position.final"]
    agree(cam(), [*of, "roller.normal_force.final"], to, 1e-6)
    places = {f"body.follower.frames.pin.position.{k}": 1e-6 for k in range(2)}
    agree(cam(), [*of, "roller.normal_force.final"], places, 1e-4)


def test_a_place_of_a_pin_whose_surfaces_would_overlap_at_the_start() -> None:
    """A thousandth of its distance of 50 mm from the centre of mass is half of the clearance.

    Tolerance: differences through two impacts; later the motion depends so much on the start that they are none.
    """
    scene = load("clearance_slider_crank", **{"time.end": 5e-4})
    of = ["piston.position.x.final", "piston.velocity.x.final", "pin.impulse"]
    agree(scene, of, {f"body.rod.frames.big_end.position.{k}": h for k, h in ((0, 1e-6), (1, 5e-8))}, 1e-5)


SOFT = {"law": "flores", "restitution": 0.5, "stiffness": 1e6}
ROUGH = {"law": "modified-coulomb", "static": 0.1, "dynamic": 0.08, "v_static": 1e-3, "v_dynamic": 1e-2}
MOVING = ["body.position.final", "body.angular_velocity.final"]
SPACE = {"width": WIDTH, "side_clearance": SIDE}
ROUND: dict[str, Any] = {"faces": "bounded", "guide_length": GUIDE, "corner_radius": 2e-3}
ROUND |= {"normal": SOFT | {"stiffness": 1e8}}
WALL = {"normal": {"law": "hertz", "stiffness": 1e14}}
IN_FILM = ["pin.position.final", "A.film_force.final"]
#: a table of a scene, what is differentiated, relative steps of the differences by parameter
PAIRS: dict[str, tuple[Any, list[str], dict[str, float]]] = {
    "flat collars": (
        pinned([0.05, 0.0, -0.2], [1.0, 0.7, 30.0], **FLAT | {"collar_points": 4}, friction=ROUGH),
        MOVING,
        {"joint.pin.collar_radius": 1e-5, "joint.pin.axial_clearance": 1e-5, "body.body.mass": 1e-5},
    ),
    "bounded faces that are left": (
        sliding([0.3, 0.0, 2.0], [0.0, 5.0, 0.0], 0.03, **ROUND, friction=ROUGH),
        MOVING,
        {"joint.guide.guide_length": 1e-5, "joint.guide.height": 1e-5, "body.body.velocity.2": 1e-5},
    ),
    "bounded faces in space": (
        sliding([0.3, 0.2, 2.0], [2.0, 5.0, 4.0], 0.03, **ROUND, **SPACE),
        MOVING,
        {"joint.guide.guide_length": 1e-5, "joint.guide.width": 1e-5, "joint.guide.side_clearance": 1e-5},
    ),
    "a finite film": (
        oiled([1e-5, 2e-5, 0.0], [0.1, -0.2, 0.0], 0.004, pin={"angular_velocity": [0.0, 0.0, 200.0]}),
        IN_FILM,
        {"joint.A.film.viscosity": 1e-4, "joint.A.clearance": 1e-4, "joint.A.length": 1e-4},
    ),
    "a finite film and its wall": (
        oiled(velocity=[0.0, 3.0, 0.0], end=4e-5, viscosity=1e-3, roughness=0.05 * GAP, joint=WALL),
        [*IN_FILM[:1], "A.peak_force"],
        {"joint.A.film.viscosity": 1e-4, "joint.A.film.roughness": 1e-4, "joint.A.clearance": 1e-5},
    ),
    "a ball in oil and its wall": (
        oiled(velocity=[0.0, 3.0, 0.0], end=4e-5, viscosity=1e-3, roughness=0.05 * GAP, joint=BALL | WALL),
        [*IN_FILM[:1], "A.peak_force"],
        {"joint.A.film.viscosity": 1e-4, "joint.A.film.roughness": 1e-4, "joint.A.clearance": 1e-5},
    ),
}


@pytest.mark.parametrize("case", PAIRS)
def test_joints_of_several_contacts_and_films(case: str) -> None:
    """Tolerance: of differences through several impacts."""
    table, of, to = PAIRS[case]
    agree(edited(Scene.model_validate(table), TIGHT), of, to, 3e-6)


def test_a_flexible_body_under_a_film() -> None:
    """Tolerance: of differences of a film whose damping is 4e5 N s/m, in runs that are good to 1e-11."""
    film = {"viscosity": 0.04, "roughness": 1e-7}
    scene = load("clearance_cantilever", **{"time.end": 1.5e-3, "joint.tip.film": film, "joint.tip.friction": None})
    of = ["pin.position.final", "rod.at_120mm.frame_position.final"]
    agree(scene, of, {"joint.tip.film.viscosity": 1e-3, "joint.tip.clearance": 1e-3}, 1e-6)


@pytest.mark.parametrize("more", [{}, SPACE])
def test_a_sharp_corner_that_is_pressed_past_the_end_of_its_face_has_no_derivative(more: Any) -> None:
    """The force turns by a right angle there, which changes of the time of passing would multiply."""
    table = sliding([0.3, 0.0, 2.0], [0.0, 5.0, 0.0], 0.02, faces="bounded", guide_length=GUIDE, normal=SOFT, **more)
    scene = edited(Scene.model_validate(table), TIGHT)
    with pytest.raises(SolverError, match=r"'guide\.corner_\d': its corner is pressed past the end .* a corner_radius"):
        sensitivities(scene, {}, silent, ["body.position.final"], ["joint.guide.guide_length"])


def test_the_modulus_of_a_recipe_through_bundles(tmp_path: Path) -> None:
    """Modulus and density against runs with bundles of their own recipes, at other steps; a frame that no joint uses.

    Tolerance: of differences, where vibrations have turned ten times.
    """
    scene = load("flexible_slider_crank", **{"time.end": 0.002})
    recipe = Path(scene.recipes()["rod"]).read_text()
    of = ["slider.velocity.x.final", "crank_pin.force.x.final", "rod.middle.frame_position.final"]
    numbers = {"material.youngs_modulus": "200 GPa", "material.density": "7870 kg/m^3"}
    to = [f"body.rod.mesh.{path}" for path in numbers]
    found = fc.sensitivities(scene, of, to)
    assert f"by differences of reduced bodies for {', '.join(to)}" in found.attrs["method"]
    recorded = [parse_recorded(name, scene.owners()) for name in of]
    for path, (key, text) in zip(to, numbers.items(), strict=True):
        number, unit = text.split()
        values = []
        for k in (-2, -1, 1, 2):
            file = tmp_path / f"{key}{k}.toml"
            file.write_text(recipe.replace(f'"{text}"', f'"{float(number) * (1.0 + k * 2e-4)!r} {unit}"'))
            other = edited(scene, {"body.rod.mesh": str(file)})
            values.append(Runner(bundles(other), recorded).run(other).values)
        size = 2e-4 * float(found.parameter_value.sel(parameter=path))
        for one in recorded:
            a, b, c, d = (np.asarray(v[one.name]) for v in values)
            stepped = (a - 8.0 * b + 8.0 * c - d) / (12.0 * size)
            exact = found[one.name].sel(parameter=path).values
            assert exact == pytest.approx(stepped, rel=1e-5, abs=1e-5 * np.abs(stepped).max())


def test_a_number_that_no_recipe_has_is_refused() -> None:
    scene = load("flexible_slider_crank", **{"time.end": 0.002})
    with pytest.raises(InputError, match=r"there is no 'material.stiffness'"):
        fc.sensitivities(scene, ["slider.velocity.final"], ["body.rod.mesh.material.stiffness"])
