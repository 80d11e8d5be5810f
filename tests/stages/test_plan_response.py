"""Plans: bounds are bounds, responses of flexible bodies have closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from flexclear.commands.new import write
from flexclear.dynamics.linear.clearance_response import SQUARED_RANK, opening_map
from flexclear.dynamics.linear.response import first_excited, vibration
from flexclear.dynamics.model.constraints import constraints
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.plan.search import sum_by_quantity
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import joint_wrenches
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene
from tests.properties.mechanisms import rigid
from tests.stages.plans import DENSITY, GRAVITY, LENGTH, MODULUS, PLATFORM, RADIUS, START, Pilot, pilot, standing_leg

pytestmark = pytest.mark.usefixtures("shared_results")


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Pilot:
    return pilot(standing_leg(tmp_path_factory.mktemp("leg")))


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
    leg, law = standing_leg(tmp_path), {"type": "step", "start": 0.0, "end": 4e-4, "change": 1e-4}
    speeds = []
    for interval in (1e-4, 2e-5):
        moved = edited(leg, {"drive.stroke": {"joint": "slide", "law": law}, "output.interval": interval})
        speeds.append(pilot(moved).response(Quantity("platform", "velocity")).influence["platform.velocity"])
    # what is left: the law between the breaks, straight from output to output; with a ramp the ratio is five
    assert speeds[1] == pytest.approx(speeds[0], rel=0.1)


def test_a_quantity_that_no_bound_holds_for_is_not_bounded_by_those_of_others():
    """A pose and a force asked for at once: the bound is of the pose alone."""
    bounds_of_joints = [{"a.position": 1.0}, {"a.position": 2.0}]
    assert sum_by_quantity(bounds_of_joints, {"a.position": 1.0, "b.force": 1.0}) == {
        "a.position": 3.0,
        "b.force": np.inf,
    }


def test_the_bound_of_a_loose_crank_pin_is_that_of_the_slider_crank(tmp_path: Path):
    """A slider follows an opening d of the crank pin by at most d/cos(b), b the rod's angle, at most asin(r/l)."""
    reach = pilot(load_scene(write("slider-crank", tmp_path)[0])).bounds(Quantity("slider", "position"))
    ratio = 1.0 / np.sqrt(1.0 - 0.25**2)
    # the depth to which the pin is pressed comes on top, some percent; the steepest angle lies between the poses seen
    assert 0.995 * ratio * 1e-4 < reach["pin"]["slider.position"] < 1.1 * ratio * 1e-4


def test_a_bound_includes_the_depth_to_which_ten_times_the_joints_force_presses_it(tmp_path: Path):
    """As docs/plan.md says: with F = K d^1.5 a bound is proportional to c + (10 F/K)^(2/3), here with softer pins."""
    scene = load_scene(write("slider-crank", tmp_path)[0])
    stiffnesses = (1e12, 1e9)
    found = [pilot(edited(scene, {"joint.pin.normal.stiffness": K})) for K in stiffnesses]
    force, clearance = np.linalg.norm(_force(found[0], "pin"), axis=1).max(), scene.joint["pin"].clearance
    separations = [clearance + (10.0 * force / K) ** (2.0 / 3.0) for K in stiffnesses]
    one, other = (p.bounds(Quantity("slider", "position"))["pin"]["slider.position"] for p in found)
    assert separations[1] > 1.5 * separations[0]  # the depth is no detail
    # both from the same ideal run
    assert other / one == pytest.approx(separations[1] / separations[0], rel=1e-12)


def _force(pilot: Pilot, joint: str) -> np.ndarray:
    """Force of a joint of the ideal mechanism, (time, 3) [N]."""
    return joint_wrenches(Motions(pilot.ideal.model, pilot.ideal.observed), [joint])[joint][1]


def test_where_joints_leave_a_freedom_there_is_no_bound(tmp_path: Path):
    loose = pilot(edited(standing_leg(tmp_path), {"drive": {}, "load": {}}))
    chosen = Quantity("platform", "position")
    assert loose.bounds(chosen)["ball"]["platform.position"] == np.inf
    assert loose.response(chosen).influence["platform.position"] == np.inf


def _tight(scene: Scene) -> Scene:
    """Without the clearance, which is another matter."""
    return variants.without_effects(scene, [e for e in variants.effects(scene) if e.name.startswith("joint.")])


def test_the_adjoint_of_a_pose_is_the_least_squares_response_to_openings(standing: Pilot):
    """Compared with the pseudoinverse of the joints' rates, which another computation gives."""
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
