"""Starts: what the scene gives is kept where the joints allow it, and refused where they do not."""

import re
from typing import Any

import numpy as np
import pytest

from flexclear import dynamics
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.events.impulse import apply_impulses
from flexclear.dynamics.model.assembly import assemble
from flexclear.dynamics.model.given_start import corrected_starts
from flexclear.dynamics.model.mechanism import Mechanism, build
from flexclear.dynamics.model.mobility import analyse
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.coordinates import joint_coordinates
from flexclear.dynamics.run.evaluation.engine import engine_in_python, prepare
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.change_points import elbow
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import (
    Table,
    body,
    frame,
    ground,
    joint,
    matrix,
    rigid,
    scene,
    simulate,
    turned,
    two_loops,
)


@pytest.mark.slow
def test_one_body_sets_its_whole_loop_in_motion() -> None:
    """From rest all accelerations are admissible velocities: given one body's as velocity, the others' must follow."""
    at_rest = simulate(two_loops()).isel(time=0)
    moving = two_loops()
    given = {name: at_rest.sel(body=name) for name in ("a", "d")}
    for name, start in given.items():
        moving["body"][name]["angular_velocity"] = start.angular_acceleration.values.tolist()
        moving["body"][name]["velocity"] = start.acceleration.values.tolist()
    found = simulate(moving).isel(time=0)
    size = float(np.abs(at_rest.acceleration).max())
    # rounding of the equations at rest
    assert found.velocity.values == pytest.approx(at_rest.acceleration.values, abs=1e-11 * size)
    assert found.angular_velocity.values == pytest.approx(at_rest.angular_acceleration.values, abs=1e-11 * size)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a", "d"])
def test_velocities_that_would_open_a_loop_are_refused(name: str) -> None:
    table = two_loops()
    table["body"][name]["angular_velocity"] = [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=f"velocities given for {name}") as error:
        simulate(table)
    assert f"[body.{name}.velocity]" in str(error.value)
    assert "the error is" in str(error.value)


#: length [m], density times area [kg/m], and radius [m] of meshes/actuated_rod.toml
LENGTH, LINE, SECTION = 0.24, 2740.0 * np.pi * 1e-4, 0.01
THROWN = {"body.rod.velocity": (1.0, -2.0, 0.5), "body.rod.angular_velocity": (3.0, 10.0, -8.0)}


@pytest.mark.parametrize("reference, stiffening", [("craig-bampton", None), ("free-free", {})])
def test_a_flexible_body_thrown_starts_with_the_velocity_of_its_centre_of_mass(
    reference: str, stiffening: object
) -> None:
    """As a rigid rod of its mass and inertia would; without weight its centre then goes straight on."""
    changes = {
        "joint": {}, "load": {}, "time.end": 0.01, "output.interval": 0.001, "body.rod.stiffening": stiffening,
        "body.rod.modes": {"reference": reference, "count": 13}, "body.rod.pose": {"rotation_vector": (0.3, -0.4, 0.5)},
    }  # fmt: skip
    scene = load_scene(TREE / "scenes" / "checks" / "swinging_rod.toml", {**changes, **THROWN})
    rod = dynamics.simulate(scene, bundles(scene), lambda fraction, text: None).sel(body="rod")
    v, omega = (np.array(value) for value in THROWN.values())
    # the speeds follow from a linear system of full rank
    assert rod.velocity.values[0] == pytest.approx(v, rel=0, abs=1e-12)
    assert rod.angular_velocity.values[0] == pytest.approx(omega, rel=0, abs=1e-12)
    mass, R = LINE * LENGTH, quaternion_to_matrix(rod["quaternion"].values[0])
    slender = mass * (LENGTH**2 / 12.0 + SECTION**2 / 4.0)
    inertia = R @ np.diag([mass * SECTION**2 / 2.0, slender, slender]) @ R.T
    # the mesh's own inertia: consistent masses of cubic elements are exact for rigid motions
    assert float(rod.kinetic[0]) == pytest.approx(0.5 * mass * v @ v + 0.5 * omega @ inertia @ omega, rel=1e-9)
    way = rod.position.values - rod.position.values[0]
    # rtol 1e-10 of a run of some hundred steps
    assert way == pytest.approx(np.outer(rod.time.values, v), rel=0, abs=1e-9)


def test_velocity_and_spin_of_a_hinged_flexible_rod_agree_about_its_hinge() -> None:
    """A rod on a ball joint is given its centre's velocity, omega x r: it starts without speeds of deformation."""
    omega = np.array([0.0, 4.0, 3.0])
    centre = np.cross(omega, [0.5 * LENGTH, 0.0, 0.0])
    changes = {"time.end": 1e-3, "output.interval": 1e-3, "body.rod.angular_velocity": tuple(omega)}
    place = TREE / "scenes" / "checks" / "swinging_rod.toml"
    scene = load_scene(place, {**changes, "body.rod.velocity": tuple(centre)})
    rod = dynamics.simulate(scene, bundles(scene), lambda fraction, text: None).sel(body="rod")
    assert rod.velocity.values[0] == pytest.approx(centre, rel=0, abs=1e-12)
    about_end = LINE * LENGTH * (LENGTH**2 / 3.0 + SECTION**2 / 4.0)
    assert float(rod.kinetic[0]) == pytest.approx(0.5 * about_end * omega @ omega, rel=1e-9)


@pytest.mark.parametrize("turned", [False, True])
def test_bodies_without_a_given_velocity_start_at_rest_where_joints_allow_it(turned: bool) -> None:
    """Of a row of equal sliders, each guided by the one before, the one that is given a velocity moves alone.

    The joints may be written in either order, so that another slider is the root of the chain.
    """
    bodies: dict[str, Any] = {"world": ground(rail=(0.0, 0.0, 0.0))}
    joints, names = {}, ["world", "a", "b", "c"]
    for k, name in enumerate(names[1:]):
        bodies[name] = rigid(1.0, 1e-3, {"rail": {}}, pose={"position": [0.0, 0.0, 0.1 * k]})
        joints[f"g{k}"] = joint("prismatic", f"{names[k]}.rail", f"{name}.rail")
    joints["g0"] = joint("prismatic", "world.rail", "c.rail" if turned else "a.rail")
    bodies["b"]["velocity"] = [0.0, 0.0, 1.0]
    found = simulate(scene(bodies, joints, end=1e-3, rtol=1e-8)).isel(time=0)
    speeds = found.velocity.sel(body=["a", "b", "c"], axis="z").values
    assert speeds == pytest.approx([0.0, 1.0, 0.0], rel=0, abs=1e-12)  # rounding of a linear system of full rank


def test_a_push_at_one_bar_sets_the_next_in_motion_as_an_impulse_does() -> None:
    """Two bars of mass m and length l hang in line; the centre of the upper one is given a speed.

    Its angular velocity is w = 2 v/l. An impulse there leaves the lower bar's angular momentum about the pin at zero:
    m l w l/2 + m l^2/3 w' = 0, so that w' = -3 w/2.
    """
    length, speed, thin = 0.4, 0.1, 0.4**2 / 12.0
    ends = {"top": frame((0.0, 0.5 * length, 0.0)), "foot": frame((0.0, -0.5 * length, 0.0))}
    bars = {name: rigid(1.0, thin, ends, pose=frame((0.0, y * length, 0.0))) for name, y in (("a", -0.5), ("b", -1.5))}
    bars["a"]["velocity"] = [speed, 0.0, 0.0]
    joints = {"pin": joint("revolute", "world.pin", "a.top"), "knee": joint("revolute", "a.foot", "b.top")}
    found = simulate(scene({"world": ground(pin=(0.0, 0.0, 0.0)), **bars}, joints, end=1e-3, rtol=1e-8)).isel(time=0)
    w = 2.0 * speed / length
    turns = found.angular_velocity.sel(body=["a", "b"], axis="z").values
    assert turns == pytest.approx([w, -1.5 * w], rel=1e-12)  # rounding, as above


GROUND, CRANK, COUPLER, ROCKER = 0.5, 0.2, 0.4, 0.3


def angles(crank: float, side: float = 1.0) -> tuple[float, float, float]:
    """Angles of crank, coupler and rocker of a four-bar; side: of the elbow of the latter two."""
    return crank, *elbow(crank, side, (CRANK, COUPLER, ROCKER, GROUND))


def driven(given: float, law: float, **crank: Any) -> dict[str, Any]:
    """A four-bar whose poses are those of one crank angle, and whose drive starts at another, at 3 rad/s."""
    a, b, c = angles(given)
    pins = {"crank": (0.0, 0.0), "coupler": (CRANK * np.cos(a), CRANK * np.sin(a)), "rocker": (GROUND, 0.0)}
    lengths = {"crank": (CRANK, a), "coupler": (COUPLER, b), "rocker": (ROCKER, c)}
    bodies: dict[str, Any] = {"world": ground(a=(0.0, 0.0, 0.0), b=(GROUND, 0.0, 0.0))}
    for name, (length, angle) in lengths.items():
        pose = frame((*pins[name], 0.0), (0.0, 0.0, angle))
        bodies[name] = rigid(1.0, 1e-3, {"near": {}, "far": frame((length, 0.0, 0.0))}, pose=pose)
    bodies["crank"] |= crank
    pairs = ("world.a", "crank.near"), ("crank.far", "coupler.near"), ("coupler.far", "rocker.far")
    joints = {f"j{k}": joint("revolute", *pair) for k, pair in enumerate((*pairs, ("world.b", "rocker.near")))}
    law_of = {"type": "polynomial", "coefficients": [law, 3.0]}
    return scene(bodies, joints, end=1e-3, rtol=1e-8, drive={"motor": {"joint": "j0", "law": law_of}})


def start_of(table: dict[str, Any]) -> Mechanism:
    """The mechanism at its start; nothing is compiled for it."""
    return assemble(build(Scene.model_validate(table), {}))


def test_a_pose_that_contradicts_a_drive_is_refused_with_both_values() -> None:
    with pytest.raises(InputError) as error:
        start_of(driven(1.5, 0.9))
    for words in (
        "[drive.motor.law]",
        "joint 'j0'",
        "1.5 rad in the given poses",
        "0.9 rad by the law",
        "differ by 0.6 rad",
    ):
        assert words in str(error.value)


def test_a_slide_that_contradicts_its_drive_is_refused_beyond_a_share_of_the_mechanism() -> None:
    def slide(law: float) -> dict[str, Any]:
        bodies = {"world": ground(a=(0.0, 0.0, 0.0)), "b": body((0.0, 0.0, 1.0), frames={"o": frame((0.0, 0.0, 0.0))})}
        drive = {"d": {"joint": "j", "law": law}}
        return scene(bodies, {"j": joint("prismatic", "world.a", "b.o")}, drive=drive)

    near = start_of(slide(1.02))  # the mechanism's size is about half a metre
    assert near.start_residual == pytest.approx(0.02, rel=1e-12)
    with pytest.raises(InputError, match=r"\[drive.d.law\].*starts at 1 m in the given poses, but at 1.2 m"):
        start_of(slide(1.2))


def test_how_far_a_path_starts_from_its_frame_is_the_residual_of_the_start() -> None:
    def led(x: float, turn: float) -> dict[str, Any]:
        bodies = {"world": ground(a=(0.0, 0.0, 0.0)), "b": body((0.0, 0.0, 1.0), frames={"o": frame((0.2, 0.0, 0.0))})}
        path = {"frame": "b.o", "position": {"x": x, "y": 0.0, "z": 1.0}, "rotation": {"x": 0.0, "y": 0.0, "z": turn}}
        return scene(bodies, {}, drive={"p": path})

    assert start_of(led(0.2, 0.0)).start_residual == pytest.approx(0.0, abs=1e-15)
    assert start_of(led(0.201, 0.01)).start_residual == pytest.approx(0.01, rel=1e-9)
    assert start_of(led(0.5, 0.0)).start_residual == pytest.approx(0.3, rel=1e-9)
    assert start_of(led(0.2, 0.4)).start_residual == pytest.approx(0.4, rel=1e-9)


def test_whole_turns_contradict_nothing_and_bodies_without_a_pose_go_where_the_drive_says() -> None:
    assert start_of(driven(1.5, 1.5 + 4.0 * np.pi)).start_residual < 1e-14
    free = driven(1.5, 1.5)
    del free["body"]["crank"]["pose"]
    free["joint"] = {"j0": free["joint"]["j0"]}
    free["body"] = {name: free["body"][name] for name in ("world", "crank")}
    (_, crank) = start_of(free).links
    # rounding of a rotation
    assert crank.start.R[:2, 0] == pytest.approx([np.cos(1.5), np.sin(1.5)], abs=1e-14)


def test_the_moves_of_an_assembly_are_reported_with_amounts() -> None:
    mechanism = start_of(driven(1.5, 1.45))
    (reported,) = corrected_starts(mechanism, [link.start for link in mechanism.links])
    before, after = angles(1.5), angles(1.45)
    # three digits are printed
    amounts = dict(zip(("crank", "coupler", "rocker"), np.abs(np.subtract(before, after)), strict=True))
    for name, amount in amounts.items():
        found = re.search(rf"{name} [^;]*turned by (\S+) rad", reported)
        assert found is not None
        assert float(found[1]) == pytest.approx(amount, rel=5e-3)
    shift = re.search(r"coupler moved by (\S+) m", reported)
    assert shift is not None
    assert float(shift[1]) == pytest.approx(2.0 * CRANK * np.sin(0.025), rel=5e-3)
    assert "crank moved" not in reported
    assert mechanism.start_residual == pytest.approx(0.05, rel=1e-9)
    fitting = start_of(driven(1.5, 1.5))
    assert corrected_starts(fitting, [link.start for link in fitting.links]) == []


@pytest.mark.slow
def test_a_mended_start_is_in_the_runs_warnings_and_velocities_follow_the_mend() -> None:
    run = simulate(driven(1.5, 1.45))
    assert run.attrs["closure_residual_of_given_start"] == pytest.approx(0.05, rel=1e-9)
    assert "crank turned by 0.05 rad" in run.attrs["start_mended"]
    assert run.attrs["start_mended"] in run.attrs["warnings"]
    assert "start_mended" not in simulate(driven(1.5, 1.5, angular_velocity=[0.0, 0.0, 3.0])).attrs
    rough = simulate(driven(1.5, 1.5, angular_velocity=[0.0, 0.0, 3.1]))
    assert "velocities given for crank were corrected" in rough.attrs["start_mended"]
    assert "0.1 rad/s" in rough.attrs["start_mended"]
    # rounding of the projection
    assert rough.angular_velocity.sel(body="crank").values[0] == pytest.approx([0.0, 0.0, 3.0], abs=1e-12)
    with pytest.raises(InputError, match=r"given velocities of crank \(the error is 1 of"):
        simulate(driven(1.5, 1.5, angular_velocity=[0.0, 0.0, 4.0]))


@pytest.mark.parametrize("name", ["bennett", "expressions", "gears", "rubbing_slider_crank", "socket_rolling", "stops"])
def test_without_a_compiler_a_start_has_the_same_state_and_outputs(name: str) -> None:
    model = tabulate(build(load_scene(f"scenes/checks/{name}.toml"), {}))
    seen = list[Observed]()
    for engine in (prepare(model, silent), engine_in_python(model, analyse(model))):
        y = consistent_start(engine)
        seen.append(observe(engine, rows_of(engine, y[None], engine.start), after=True))
    # both evaluate the same sums, in another order
    for field in ("state", "accelerations", "energy", "drive_force"):
        ours, other = (getattr(one, field) for one in seen)
        if field == "energy":
            ours, other = (np.stack([each[k] for k in each.dtype.names]) for each in (ours, other))
        assert other == pytest.approx(ours, rel=1e-8, abs=1e-10 * max(1.0, float(np.abs(ours).max(initial=0.0))))


def oblique(turn: Any = (0.0, 0.0, 0.7)) -> Table:
    """A four-bar about axes along z, in a plane turned about these, and next to it a slider of 1e-11 kg."""
    R = matrix(turn)
    A, B, C = turned(R, (0.05, 0.12, 0.0)), turned(R, (0.34, 0.2, 0.0)), turned(R, (0.3, 0.0, 0.0))

    def bar(a: list[float], b: list[float]) -> Table:
        far = [y - x for x, y in zip(a, b, strict=True)]
        return rigid(1.0, 1e-2, {"a": {}, "b": frame(far)}, pose={"position": a})

    bodies = {
        "g": {"type": "ground", "frames": {"a": {}, "c": frame(C), "s": frame((1.0, 0.0, 0.0), (0.4, 0.9, 0.3))}},
        "crank": bar([0.0, 0.0, 0.0], A),
        "rod": bar(A, B),
        "rocker": bar(C, B),
        "s": rigid(1e-11, 1e-15, {"a": frame((0.0, 0.0, 0.0), (0.4, 0.9, 0.3))}, pose={"position": [1.0, 0.0, 0.0]}),
    }
    joints = {
        "O": joint("revolute", "g.a", "crank.a"),
        "A": joint("revolute", "crank.b", "rod.a"),
        "B": joint("revolute", "rod.b", "rocker.b"),
        "C": joint("revolute", "g.c", "rocker.a"),
        "s": joint("prismatic", "g.s", "s.a"),
    }
    return scene(bodies, joints)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.7), (0.3, -0.5, 0.7), (0.3, 0.5, -1.7)])
def test_impulses_on_coordinates_that_depend_on_each_other_are_the_least(turn: tuple[float, ...]) -> None:
    """Where the second rate follows from the first, the motion is that of the first alone, and nothing else moves.

    What is left of their difference is rounding: nothing in some planes, anything in others.
    """
    engine = engine_of(Scene.model_validate(oblique(turn)), {}, silent)
    y, model = consistent_start(engine), engine.model

    def rates(state: np.ndarray) -> dict[str, float]:
        seen = observe(engine, rows_of(engine, state[None], engine.start), after=True)
        return {name: float(rate[0]) for name, (_, rate, _) in joint_coordinates(model, seen).items()}

    alone = apply_impulses(engine, y, 0.0, {"O": 1.0})
    moved = rates(alone.y)
    assert (moved["O"], moved["s"]) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-9))
    both = apply_impulses(engine, y, 0.0, {"O": 1.0, "C": moved["C"]})
    assert both.y == pytest.approx(alone.y, abs=1e-9)
    # shared so that the sum of their squares is least
    share = alone.impulses["O"] / (1.0 + moved["C"] ** 2)
    assert both.impulses == pytest.approx({"O": share, "C": moved["C"] * share}, rel=1e-9)
    # next to bars of 1 kg: singular values in a ratio of some 1e5
    together = rates(apply_impulses(engine, y, 0.0, {"O": 1.0, "s": 1.0}).y)
    assert (together["O"], together["s"]) == (pytest.approx(1.0, rel=1e-9), pytest.approx(1.0, rel=1e-9))


def test_joints_share_a_self_stress_however_little_and_others_do_not() -> None:
    """A bar on two balls 1e-4 of its length apart, held by a strut at its end, carries 1e-4 of their forces there.

    The strut is held twice as well, so that what adds up to nothing on the slide is not paired.

    A loop of four hinges is redundant in space, the slide that carries both is not: what it holds is rounding.
    """
    table = oblique((0.0, 0.0, 0.7))
    slide = {"a": table["body"]["s"]["frames"]["a"] | {"position": [1.0, 0.0, 0.0]}, "o": {}}
    slide |= {"c": table["body"]["g"]["frames"]["c"], "p": frame((0.0, 0.0, 2.0)), "q": frame((1e-4, 0.0, 2.0))}
    table["body"]["s"] |= {"frames": slide | {"r": frame((1.0, 0.5, 2.0)), "m": frame((1.0, 0.3, 2.0))}, "pose": {}}
    table["joint"]["O"]["between"][0], table["joint"]["C"]["between"][0] = "s.o", "s.c"
    bar = {"p": {}, "q": frame((1e-4, 0.0, 0.0)), "r": frame((1.0, 0.0, 0.0))}
    table["body"]["bar"] = rigid(1.0, 1e-2, bar, pose={"position": [0.0, 0.0, 2.0]})
    strut = {"a": {}, "b": frame((0.0, 0.5, 0.0)), "m": frame((0.0, 0.3, 0.0))}
    table["body"]["strut"] = rigid(1.0, 1e-2, strut, pose={"position": [1.0, 0.0, 2.0]})
    table["joint"] |= {
        "p": joint("spherical", "s.p", "bar.p"), "q": joint("spherical", "s.q", "bar.q"),
        "r": joint("spherical", "bar.r", "strut.a"), "e": joint("spherical", "strut.b", "s.r"),
        "f": joint("spherical", "strut.m", "s.m"),
    }  # fmt: skip
    found = analyse(tabulate(build(Scene.model_validate(table), {})))
    assert found.redundant_joints == {"O", "A", "B", "C", "p", "q", "r", "e", "f"}
    assert found.redundant == 3 + 5
