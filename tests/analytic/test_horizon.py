"""The predictability horizon: growth of a small perturbation of the start."""

from functools import partial

import numpy as np
import pytest

from flexclear import dynamics
from flexclear.artifacts.quantities import PERTURBATION, SEPARATED, index_of_separation, indices_of_lasting
from flexclear.dynamics import analyses
from flexclear.dynamics.run.evaluation.observation import frames
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of, observe_run
from flexclear.dynamics.run.trajectory import integrate
from flexclear.post.single_run.series import separation_time
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic import mechanism_runs
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import ground, joint, rigid, scene

run = partial(mechanism_runs.run, horizon=True)
#: a good half of the stroke, at whose end runs with the flexible rod have long parted
HALF = (("time.end", 0.1),)


def test_rigid_clearance_converges_over_the_whole_stroke():
    """Perturbations grow 2 to 10 times over 0.18 s (28 impacts), measured independently with DOP853 at 1e-13."""
    csj = run("sps4/variants/first_csj")
    assert float(csj.horizon) == csj.time.values[-1]
    # of ten times the perturbation, but for moments of impacts; the bound has ten times of room
    assert np.median(csj.separation.values[-20:]) < 100.0 * PERTURBATION


def test_frames_by_which_runs_are_compared_are_those_of_full_rows_but_for_open_loops():
    engine = engine_of(load_scene(TREE / "scenes/sps4/variants/first_csj.toml"), {}, silent)
    trajectory = integrate(engine, consistent_start(engine), silent)
    seen, alone = observe_run(engine, trajectory).links, frames(engine, trajectory.rows)
    for field in ("origin", "axes", "omega", "velocity"):
        here, known = alone[field], seen[field]
        # rtol is 1e-10, at which loops drift; rates count per second, so that they are open by more
        assert np.abs(here - known).max() < 1e-7 * np.abs(known).max(), field


def test_the_perturbed_run_of_a_motion_that_does_not_return_starts_where_the_run_does():
    """Two lifts, one after the other: at the end other pieces of the law are in force than at the start."""
    law = (("type", "step"), ("start", (0.0, 0.01)), ("end", (0.01, 0.02)), ("change", (1e-3, 1e-3)))
    lifted = run("sps4/csj", (("drive.P1.law", law), ("drive.P2.law", law), ("time.end", 0.02)))
    assert float(lifted.horizon) == lifted.time.values[-1]
    assert np.median(lifted.separation.values[-20:]) < 100.0 * PERTURBATION


def test_the_undamped_flexible_mechanism_is_believed_for_a_part_of_the_stroke_only():
    """Perturbations grow by 1e6 to 1e7 within 0.1 s there, measured independently with DOP853."""
    far = run("sps4/far_csj_cb", HALF)
    # before the first impact, at 4.6 ms, nothing separates them
    assert 0.0046 < float(far.horizon) < 0.09
    after = far.separation_time.values > float(far.horizon)
    # by some hundred here, up to where the perturbed run ends
    assert far.separation.values[after].max() > 50.0 * far.separation.values[1:4].max()


def test_rare_outputs_do_not_hide_that_motions_part():
    """Impacts part them; a perturbed run compared once per stroke would agree for all of it."""
    often = run("sps4/far_csj_cb", HALF)
    rarely = run("sps4/far_csj_cb", (("output.interval", 0.1), *HALF))
    assert len(rarely.time.values) < len(often.time.values) - 800
    # looked at where contacts end, at most some milliseconds apart once they come in rows
    assert abs(float(rarely.horizon) - float(often.horizon)) < 0.01


def test_the_horizon_is_one_of_the_mechanism_and_hardly_of_the_tolerance():
    loose, tight = (float(run("sps4/far_csj_cb", (("solver.rtol", rtol), *HALF)).horizon) for rtol in (1e-6, 1e-11))
    assert 0.5 < loose / tight < 2.0


def four_bar(**changes: object) -> Scene:
    """A rigid four-bar with a loose pin between coupler and rocker, which turns about the ground as the crank does."""
    steel = {"youngs_modulus": 207e9, "poisson": 0.29}
    pin = joint("clearance-revolute", "coupler.B", "rocker.B", clearance=2e-4, pin_radius=8e-3, length=16e-3)
    pin |= {"normal": {"law": "flores", "restitution": 0.8}, "journal_material": steel, "pin_material": steel}
    bodies = {
        "ground": ground(O1=(0, 0, 0), O2=(0.2, 0, 0)),
        "crank": bar(0.3, 0.025, [1e-5, 1e-4, 1e-4], O=0.0, A=0.05),
        "coupler": bar(0.8, 0.09, [1e-4, 3e-3, 3e-3], A=0.0, B=0.18),
        "rocker": bar(0.4, 0.06, [1e-4, 6e-4, 6e-4], O=0.0, B=0.12),
    }
    joints = {
        "main": joint("revolute", "ground.O1", "crank.O"),
        "A": joint("revolute", "crank.A", "coupler.A"),
        "O2": joint("revolute", "ground.O2", "rocker.O"),
        "B": pin,
    }
    data = {
        "output": {"interval": 5e-4},
        "solver": {"integrator": "radau", "rtol": 1e-8},
        "drive": {"motor": {"joint": "main", "law": {"type": "polynomial", "coefficients": [0, 10.0 * np.pi]}}},
        "load": {"gravity": {"type": "gravity", "acceleration": [0, -9.81, 0]}},
        "start": {"at": "ideal", "joint": {"O2": {"near": np.deg2rad(110.0)}}},
    }
    return Scene.model_validate(scene(bodies, joints, 0.5, **data | changes))


def bar(mass: float, com: float, inertia: list[float], **ends: float) -> dict[str, object]:
    frames = {name: {"position": [x, 0, 0]} for name, x in ends.items()}
    return rigid(mass, inertia, frames, com=[com, 0, 0])


def test_bodies_that_only_turn_about_fixed_points_are_compared_as_well():
    """Frames of links lie on pins there, whose velocities are zero or prescribed; an ensemble diverges all the same."""
    loose = dynamics.simulate(four_bar(), {}, silent)
    members = analyses.ensemble(four_bar(ensemble={"members": 4}), {}, silent)
    diverged = separation_time(members.time.values, members.velocity.values)
    assert float(loose.horizon) < 0.5
    # two draws of an exponential growth from 4 and 10 nm: the same impact or one of the next
    assert 0.5 < diverged / float(loose.horizon) < 2.0


def test_a_perturbation_that_dies_out_ends_no_horizon():
    """Loose, with a rtol at which integration errs by more than the perturbation, and without an impact."""
    heavy = four_bar(load={"gravity": {"type": "gravity", "acceleration": [0, -981.0, 0]}})
    pressed = dynamics.simulate(edited(heavy, {"solver.rtol": 1e-5, "time.end": 0.05}), {}, silent)
    assert float(pressed.horizon) == 0.05


@pytest.mark.parametrize("what", ["stop", "ball"])
def test_without_a_free_coordinate_nothing_can_separate(what: str):
    law = {"type": "polynomial", "coefficients": [0.02, -0.05]}
    data = scene(
        {"ground": ground(rail=(0, 0, 0), floor=(0, 0, 0.006)), "slide": rigid(1.0, 1e-3, {"rail": {}})},
        {"guide": joint("prismatic", "ground.rail", "slide.rail")},
        drive={"push": {"joint": "guide", "law": law}},
        output={},
        solver={},
    )
    normal = {"law": "hertz", "stiffness": 1e5, "exponent": 1.5}
    if what == "stop":
        data["stop"] = {"end": {"joint": "guide", "lower": 0.015, "normal": normal}}
    else:
        data["joint"]["floor"] = joint("ball-on-plane", "ground.floor", "slide.rail", ball_radius=5e-3, normal=normal)
    held = dynamics.simulate(Scene.model_validate(data), {}, silent)
    assert float(held.contact_normal_force.max()) > 0.0
    assert float(held.horizon) == 0.2
    assert float(held.separation.max()) == 0.0


@pytest.mark.parametrize(
    "separated, first",
    [
        ([0, 1, 1, 0, 0, 0, 0, 0], []),
        ([0, 1, 1, 0, 1, 1, 1, 1], [4, 5, 6, 7]),
        ([0, 0, 0, 0, 0, 0, 1, 1], [6, 7]),
        ([1, 1, 1, 1, 0, 0, 0, 0], [0, 1]),
        ([0] * 8, []),
    ],
)
def test_a_separation_counts_where_it_lasts(separated: list[int], first: list[int]):
    assert indices_of_lasting(np.arange(8.0), np.array(separated, dtype=bool), 2.5).tolist() == first


#: separations of two runs as fractions of the largest motion: close, visible, diverged
CLOSE, VISIBLE, FAR = 5e-4, 1e-2, 5e-2


@pytest.mark.parametrize(
    "separation, first",
    [
        ([CLOSE] * 72, None),
        # a moment of an impact, and an impact that is forgotten after some others
        ([CLOSE] * 10 + [FAR] + [CLOSE] * 61, None),
        ([CLOSE] * 10 + [VISIBLE] * 20 + [CLOSE] * 42, None),
        # visible to the end, but for a moment
        ([CLOSE] * 10 + [VISIBLE] * 20 + [CLOSE] + [VISIBLE] * 41, 10),
        # one that is forgotten, then one that is not
        ([CLOSE] * 10 + [VISIBLE] * 5 + [CLOSE] * 35 + [VISIBLE] * 22, 50),
        # what comes after two runs have diverged counts no more
        ([CLOSE] * 10 + [VISIBLE] * 10 + [FAR] * 5 + [CLOSE] * 47, 10),
        ([CLOSE] * 10 + [FAR] * 5 + [CLOSE] * 57, 10),
    ],
)
def test_the_horizon_is_where_runs_are_separated_from_then_on(separation: list[float], first: int | None):
    assert index_of_separation(np.arange(72.0), np.array(separation), 71.0) == first


def test_damped_motion_that_forgets_its_impacts_is_believed_to_the_end():
    """Visibly separated for 20 ms by one impact, but at tighter tolerances it converges over the whole stroke."""
    loose, tight = (run("sps4/variants/far_csj_cb_damped", (("solver.rtol", rtol),)) for rtol in (1e-9, 1e-11))
    for damped in (loose, tight):
        assert float(damped.horizon) == damped.time.values[-1]
        assert damped.separation.values.max() > SEPARATED
    size = float(np.linalg.norm(tight.velocity, axis=-1).max())
    # 3e-4 here
    assert np.abs((loose.velocity - tight.velocity).values).max() < 10.0 * SEPARATED * size


def test_a_run_without_contacts_has_no_perturbed_run():
    ideal = run("sps4/ideal")
    assert "horizon" not in ideal
    assert "separation" not in ideal


def test_the_horizon_does_not_depend_on_where_in_a_bounce_outputs_meet_the_motion():
    """A ball falls 5 cm on a plane without loss: T = 2 sqrt(2 h / g) and its contact, of half a sine at sqrt(K h / m).

    At the top of each tenth bounce it rests. Neighbours part by a shift in time, which grows with the square of time.
    """
    mass, height, stiffness, power, g = 0.2, 0.05, 1e7, 1.5, 9.81
    speed = np.sqrt(2.0 * g * height)
    # a Hertzian impact, Johnson (1985), Contact Mechanics, sec. 11.4: 2.94 d / v with the largest depth d
    depth = (0.5 * (power + 1.0) * mass * speed**2 / stiffness) ** (1.0 / (power + 1.0))
    bounce = 2.0 * speed / g + 2.94 * depth / speed
    bodies = {"ground": {"type": "ground", "frames": {"f": {}}}, "b": rigid(mass, 1e-4, {"c": {}})}
    bodies["b"]["pose"] = {"position": [0.0, 0.0, height + 0.02]}
    floor = {"ball_radius": 0.02, "normal": {"law": "hertz", "stiffness": stiffness}}
    plane = {"f": joint("ball-on-plane", "ground.f", "b.c", **floor)}
    loads = {"g": {"type": "gravity", "acceleration": [0.0, 0.0, -g]}}
    found = []
    for interval in (10.0 * bounce, 5.0 * bounce, 0.0371):
        table = scene(bodies, plane, 600.0 * bounce, 1e-10, load=loads, output={"interval": interval})
        found.append(float(dynamics.simulate(Scene.model_validate(table), {}, silent).horizon))
    # one comparison of 180 apart
    assert np.ptp(found) < 600.0 * bounce / 90.0
    assert min(found) > 5.0
