"""Friction of ideal joints that follows their reactions, against closed forms and against independent derivations.

Mechanisms without loops stand side by side in one scene, so that one set of kernels is compiled for all of them.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from flexclear.dynamics.effects.declared import BALL
from flexclear.dynamics.mechanics.bearings import solution
from flexclear.dynamics.mechanics.evaluation import loads_of
from flexclear.dynamics.routines.calls import CallList
from flexclear.dynamics.specialise import symbols
from flexclear.dynamics.vectors import UNIT, ZERO, Vector, Wrench
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from tests.analytic.mechanism_runs import run
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid, scene, simulate

G = 9.81
COULOMB = {"law": "modified-coulomb", "static": 0.2, "dynamic": 0.2, "v_static": 1e-3, "v_dynamic": 2e-3}
SMOOTH = {"law": "ambrosio", "dynamic": 0.2, "v0": 0.0, "v1": 1e-3}
BRISTLES = {
    "law": "lugre",
    "static": 0.2,
    "dynamic": 0.2,
    "v_stribeck": 0.05,
    "bristle_stiffness": 1e3,
    "bristle_damping": 30.0,
}
#: slopes of the guides of the blocks: above the coefficient of friction, and below
STEEP, FLAT = np.arctan(0.5), np.arctan(0.1)
#: guides: length, and how far next to them a force of 50 N pushes; the second one locks, as 2 * 0.2 * 0.15 > 0.04
LENGTH, ARMS, PUSH = 0.04, {"free": 0.05, "locked": 0.15}, 50.0
RADIUS, MASS, INERTIA = 0.01, 2.0, 0.005
#: the cart with a rod on it that friction may jam: masses, angle of the rod
CART, BOB, TILT = 0.1, 1.0, np.radians(30.0)
#: what its rail carries without friction [N]
SINE, COSINE = np.sin(TILT), np.cos(TILT)
SMOOTH_LOAD = CART * G + COSINE * BOB * (G * COSINE - SINE * BOB * G * SINE * COSINE / (CART + BOB * SINE**2))
#: at this coefficient friction of the cart has no solution any more while it moves towards the bob's side
JAMMING = (CART + BOB * SINE**2) / (BOB * SINE * COSINE)


def guide(slope: float) -> Table:
    """Axes of a guide that falls by this slope along x."""
    c, s = float(np.cos(slope)), float(np.sin(slope))
    return {"axes": {"z": [c, 0.0, -s], "x": [s, 0.0, c]}}


ACROSS: Table = {"axes": {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}}


def part(frames: Table | None = None, pose: Table | None = None, **more: Any) -> Table:
    return rigid(MASS, INERTIA, frames or {"centre": {}}, pose=pose or {}, **more)


def workshop(coefficient: float = 0.5) -> Table:
    """Blocks on slopes, guides pushed next to their axes, wheels, a ball, shaft, cardan joint and cart."""
    bodies: Table = {"ground": {"type": "ground", "frames": {"steep": guide(STEEP), "flat": guide(FLAT), "O": {}}}}
    bodies["ground"]["frames"] |= {"across": ACROSS, "level": guide(0.0), "cardan": {}}
    bodies["slider"] = part(pose=guide(STEEP))
    bodies["creeper"] = part(pose=guide(FLAT))
    bodies["bristly"] = part(pose=guide(FLAT))
    for name, arm in ARMS.items():
        bodies[name] = part({"centre": guide(0.0), "beside": {"position": [0.0, arm, 0.0]}})
    bodies["wheel"] = part({"pin": ACROSS}, angular_velocity=[0.0, 30.0, 0.0])
    bodies["motor"] = part({"pin": ACROSS})
    bodies["ball"] = part(angular_velocity=[6.0, 3.0, 6.0])
    bodies["shaft"] = part({"pin": ACROSS}, com=[0.0, 0.03, 0.02], angular_velocity=[0.0, 5.0, 0.0])
    bodies["cross"] = part(com=[0.02, 0.03, -0.1], angular_velocity=[2.0, 1.0, 0.0])
    moving = {"velocity": [-1.0, 0.0, 0.0]}
    bodies["cart"] = part({"rail": guide(0.0), "pin": ACROSS}, **moving) | {"mass": CART}
    bodies["bob"] = part({"pin": ACROSS}, {"rotation_vector": [0.0, TILT, 0.0]}, **moving)
    bodies["bob"] |= {"mass": BOB, "inertia": [0.0] * 3, "com": [0.0, 0.0, 0.5]}

    def rubs(kind: str, first: str, second: str, law: Table, **sizes: float) -> Table:
        return joint(kind, first, second) | {"friction": {**law, **sizes}}

    joints: Table = {
        "slide": rubs("prismatic", "ground.steep", "slider.centre", COULOMB),
        "creep": rubs("prismatic", "ground.flat", "creeper.centre", COULOMB),
        "bristle": rubs("prismatic", "ground.flat", "bristly.centre", BRISTLES),
        "hub": rubs("revolute", "ground.across", "wheel.pin", COULOMB, radius=RADIUS, preload=5.0),
        "driven": rubs("revolute", "motor.pin", "ground.across", COULOMB, radius=RADIUS),
        "socket": rubs("spherical", "ground.O", "ball.centre", COULOMB, radius=RADIUS),
        "sleeve": rubs("cylindrical", "shaft.pin", "ground.across", COULOMB, radius=RADIUS, length=LENGTH),
        "cardan": rubs("universal", "ground.cardan", "cross.centre", COULOMB, radius=RADIUS, length=LENGTH),
        "rail": rubs("prismatic", "ground.level", "cart.rail", SMOOTH | {"dynamic": coefficient}),
        "hinge": joint("revolute", "cart.pin", "bob.pin"),
    }
    for name in ARMS:
        joints[name] = rubs("prismatic", "ground.level", f"{name}.centre", COULOMB, length=LENGTH)
    pushed = {
        name: {"type": "point-force", "frame": f"{name}.beside", "force": [PUSH, 0.0, 0.0], "axes": "world"}
        for name in ARMS
    }
    drive = {"spin": {"joint": "driven", "law": {"type": "polynomial", "coefficients": [0.0, 7.0]}}}
    return scene(bodies, joints, end=0.3, rtol=1e-10, load=GRAVITY | pushed, drive=drive)


@cache
def made() -> xr.Dataset:
    return simulate(workshop())


def coefficient(speed: np.ndarray | float) -> np.ndarray:
    """Of COULOMB, whose static and dynamic coefficients are equal."""
    y = np.minimum(1.0, np.abs(speed) / COULOMB["v_static"])
    return 0.5 * COULOMB["static"] * y * (3.0 - y * y)


def creeping(fraction: float) -> float:
    """Speed [m/s] at which COULOMB gives this coefficient."""
    return float(brentq(lambda v: coefficient(v) - fraction, 0.0, COULOMB["v_static"]))


def speed(name: str) -> np.ndarray:
    values: np.ndarray = made()["joint_velocity"].sel(coordinate=name).values
    return values


def test_a_block_slides_down_a_slope_and_creeps_where_it_would_stick() -> None:
    t, a = made().time.values, G * (np.sin(STEEP) - 0.2 * np.cos(STEEP))
    # at the start, until it slides at v_static, friction is less: that leaves less than twice this speed
    assert speed("slide") == pytest.approx(a * t, abs=2.0 * COULOMB["v_static"])
    assert np.diff(speed("slide"))[2:] == pytest.approx(a * np.diff(t)[2:], rel=1e-8)  # rtol 1e-10, many mechanisms
    load = made().joint_bearing_load.sel(rubbing="slide").values
    assert load == pytest.approx(MASS * G * np.cos(STEEP), rel=1e-12)  # rounding
    # it has come to its creeping speed within m v_static/(1.5 mu N) = 0.3 ms; rtol is 1e-10 of speeds of some m/s,
    # up to ten thousand times this one
    assert speed("creep")[-1] == pytest.approx(creeping(np.tan(FLAT)), rel=1e-6)


def test_bristles_hold_a_block_on_a_slope() -> None:
    """They bend by z = tan(slope)/sigma_0; the way to there is -z_max ln(1 - z/z_max), as they relax meanwhile."""
    most = BRISTLES["static"] / BRISTLES["bristle_stiffness"]
    known = -most * np.log(1.0 - np.tan(FLAT) / BRISTLES["static"])
    at = made()["joint_position"].sel(coordinate="bristle").values
    # the slow root of their motion, 37/s, leaves exp(-11) = 2e-5 of it, or some times that
    assert at[-1] == pytest.approx(known, rel=5e-4)
    assert abs(speed("bristle")[-1]) < 1e-2 * speed("creep")[-1]


def test_a_guide_locks_where_twice_the_coefficient_times_the_arm_of_the_push_exceeds_its_length() -> None:
    """The push makes a couple across its ends, the weight presses them alike: N is the sum of two magnitudes."""
    t, fraction = made().time.values, 2.0 * 0.2 * np.hypot(ARMS["free"] / LENGTH, 0.5 * MASS * G / PUSH)
    assert np.diff(speed("free"))[2:] == pytest.approx(PUSH / MASS * (1.0 - fraction) * np.diff(t)[2:], rel=1e-8)
    # the locked one only creeps, at the speed where its friction carries the push, whatever that is
    fraction = 0.5 / np.hypot(ARMS["locked"] / LENGTH, 0.5 * MASS * G / PUSH)
    assert speed("locked")[-1] == pytest.approx(creeping(fraction), rel=1e-6)  # as of the one that creeps


def test_wheel_ball_and_motor_feel_the_moment_of_their_weight() -> None:
    t = made().time.values
    wheel = made()["angular_velocity"].sel(body="wheel").values[:, 1]
    rate = 0.2 * RADIUS * (MASS * G + 5.0) / INERTIA
    assert wheel == pytest.approx(30.0 - rate * t, rel=1e-9)  # rtol 1e-10
    ball, start = made()["angular_velocity"].sel(body="ball").values, np.array([6.0, 3.0, 6.0])
    left = 1.0 - 0.2 * RADIUS * MASS * G / INERTIA * t / np.linalg.norm(start)
    assert ball == pytest.approx(left[:, None] * start, rel=1e-8, abs=1e-8)
    torque = made()["drive_force"].sel(drive="spin").values
    assert torque == pytest.approx(0.2 * RADIUS * MASS * G, rel=1e-10)


def of_wrench(kind: str, sizes: dict[str, Any], axis: np.ndarray, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Normal forces in a bearing for what its joint carries; shape (time,)."""
    if kind == "spherical":
        return np.linalg.norm(force, axis=1) + sizes["preload"]
    along, about = np.sum(axis * force, axis=1), np.sum(axis * moment, axis=1)
    half = 0.5 * (force - along[:, None] * axis)
    tilt = np.cross(axis, moment) / sizes["length"] if sizes["length"] else 0.0 * half
    ends = np.linalg.norm(half + tilt, axis=1) + np.linalg.norm(half - tilt, axis=1)
    collar = np.abs(along) if kind == "revolute" else 0.0
    pads = np.abs(about) / sizes["radius"] if kind == "prismatic" and sizes["radius"] else 0.0
    return ends + collar + pads + sizes["preload"]


def axes_of(dataset: xr.Dataset, table: Scene, name: str) -> list[np.ndarray]:
    """Along which the bearings of a joint lie, world axes, (time, 3) each."""
    from flexclear.numerics.rotations import axes_to_matrix, quaternion_to_matrix

    found = []
    for frame, k in zip(table.joint[name].between, (0, 1), strict=True):
        owner, _, label = frame.partition(".")
        axes = table.body[owner].frames[label].axes
        R = np.eye(3) if axes is None else axes_to_matrix(axes)
        turn = np.eye(3)[None].repeat(dataset.sizes["time"], axis=0)
        if owner != "ground":
            turn = np.array([quaternion_to_matrix(q) for q in dataset.quaternion.sel(body=owner).values])
        found.append((turn @ R)[:, :, k] if table.joint[name].type == "universal" else (turn @ R)[:, :, 2])
    return found if table.joint[name].type == "universal" else found[:1]


def require_consistent(dataset: xr.Dataset, table: Scene) -> None:
    """The record's wrenches follow from the bodies' motion alone (Newton and Euler), and bearings carry them."""
    for name, one in table.joints_with_friction().items():
        force, moment = (dataset[f"joint_{half}"].sel(joint=name).values for half in ("force", "moment"))
        assert one.friction is not None
        sizes = one.friction.model_dump()
        known = sum(of_wrench(one.type, sizes, axis, force, moment) for axis in axes_of(dataset, table, name))
        load = dataset["joint_bearing_load"].sel(rubbing=name).values
        # rounding of sums of forces that cancel
        assert load == pytest.approx(known, rel=1e-10, abs=1e-10 * np.abs(known).max())
    error, lost = dataset.energy_error.values, dataset.dissipated.values[-1]
    assert np.abs(error).max() < 1e-7 * lost  # rtol 1e-10 at some hundred steps


def test_bearings_carry_what_newton_and_euler_say_of_the_motion() -> None:
    require_consistent(made(), Scene.model_validate(workshop()))
    known = made()["joint_friction_loss"].values
    assert np.all(np.diff(known, axis=0) >= -1e-12)
    assert made().dissipated.values == pytest.approx(known.sum(axis=1), rel=1e-12)


def test_friction_that_feeds_itself_grows_to_the_limit_beyond_which_it_jams() -> None:
    """A cart with a rod on it: N = N_0/(1 - mu k) when it moves to the rod's side, and nothing from mu k = 1 on."""
    load = made()["joint_bearing_load"].sel(rubbing="rail").values[0]
    assert load == pytest.approx(
        SMOOTH_LOAD / (1.0 - 0.5 / JAMMING), rel=1e-9
    )  # rounding, times some digits of the limit
    with pytest.raises(SolverError, match=r"joint rail increases its own normal force.*Painleve"):
        simulate(workshop(1.01 * JAMMING))


def cart(tilt: float, speed: float, coefficient: float, spin: float = 0.0) -> Table:
    """The cart with a rod on it alone, that turns."""
    table = workshop()
    s, c, lever = np.sin(tilt), np.cos(tilt), spin * table["body"]["bob"]["com"][2]
    cart = table["body"]["cart"] | {"velocity": [speed, 0.0, 0.0]}
    bob = table["body"]["bob"] | {"pose": {"rotation_vector": [0.0, tilt, 0.0]}, "angular_velocity": [0.0, spin, 0.0]}
    bob["velocity"] = [speed + c * lever, 0.0, -s * lever]  # of its mass
    bodies = {"ground": {"type": "ground", "frames": {"level": guide(0.0)}}, "cart": cart, "bob": bob}
    rail = joint("prismatic", "ground.level", "cart.rail") | {"friction": SMOOTH | {"dynamic": coefficient}}
    joints = {"rail": rail, "hinge": table["joint"]["hinge"]}
    return scene(bodies, joints, end=0.3, rtol=1e-10, load=GRAVITY)


def test_friction_that_takes_load_off_is_what_it_grows_to_not_another_solution() -> None:
    """N = |N_0 - 3 N| has a second solution, which Newton's method finds from N_0: friction is turned on in strides."""
    found = simulate(cart(TILT, 1.0, 3.0 * JAMMING) | {"time": {"end": 1e-3}, "output": {"interval": 1e-3}})
    assert found.joint_bearing_load.values[0, 0] == pytest.approx(SMOOTH_LOAD / 4.0, rel=1e-9)  # rounding


def test_strides_begin_afresh_where_newtons_method_ends_nowhere() -> None:
    """N = |N - 1| + 1/2: at 3/2, the load without friction, the slopes are singular; the solution is 3/4."""
    smooth, part = (Wrench(ZERO, Vector([np.float64(x), 0.0, 0.0])) for x in (-1.0, 1.0))
    ball = SimpleNamespace(kind=BALL), SimpleNamespace(preload=0.5), UNIT
    with np.errstate(all="ignore"):
        loads, _, jammed = loads_of([ball], [smooth], [[part]], cast("CallList", symbols))
    assert not jammed
    assert loads == pytest.approx([0.75], rel=1e-12)  # Newton's method ends at 1e-13


def test_friction_that_jams_on_the_way_is_named_there() -> None:
    """The rod falls; the limit, 0.76 at first, is least at 17 degrees: 0.66."""
    with pytest.raises(
        SolverError, match=r"at t = 0\.[0-9]+ s: the friction of joint rail increases its own normal force"
    ):
        simulate(cart(np.radians(10.0), -5.0, 0.7, 5.0))


def test_the_loads_equations_are_solved_with_the_sign_of_their_determinant() -> None:
    """Of equations whose largest entries are off the diagonal, as under strong friction; and of singular ones."""
    random = np.random.default_rng(3)
    for size in (1, 2, 3, 5, 5, 5):
        A, b = random.normal(size=(size, size)), random.normal(size=size)
        found, sign = solution([[*row, right] for row, right in zip(A, b, strict=True)])
        assert sign == np.sign(np.linalg.det(A))
        assert found == pytest.approx(np.linalg.solve(A, b), rel=1e-11)  # conditions up to a thousand
    with np.errstate(all="ignore"):
        assert solution(list(np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 1.0]])))[1] == 0.0


@pytest.mark.parametrize(
    "kind, friction, words",
    [
        ("fixed", COULOMB, "no friction of its own"),
        ("revolute", COULOMB, "needs a radius"),
        ("spherical", {**COULOMB, "radius": 0.01, "length": 0.02}, "has no length"),
    ],
)
def test_joints_that_cannot_rub_so_are_refused(kind: str, friction: Table, words: str) -> None:
    table = workshop()
    table["joint"]["slide"] = joint(kind, "ground.steep", "slider.centre") | {"friction": friction}
    with pytest.raises(ValueError, match=words):
        Scene.model_validate(table)


@pytest.mark.slow
def test_bearings_on_a_flexible_rod_carry_what_the_record_says() -> None:
    """Modes take part in what the links beyond a joint need, and a joint of the tree lies on the rod."""
    law = tuple({**COULOMB, "radius": 0.005}.items())
    names = ("main", "crank_pin", "slider_pin")
    edits = (*((f"joint.{name}.friction", law) for name in names), ("time.end", 2e-3))
    dataset = run("checks/flexible_slider_crank", edits)
    assert dataset.sizes["mode"] > 0
    force = dataset["joint_force"].sel(joint=list(names)).values
    known = np.linalg.norm(force[..., :2], axis=-1) + np.abs(force[..., 2])  # z is the axis of all pins
    load = dataset["joint_bearing_load"].sel(rubbing=list(names)).values
    assert load == pytest.approx(known, rel=1e-9)  # rounding of sums over stiff modes
    # rtol 1e-10 at some hundred steps
    assert np.abs(dataset.energy_error.values).max() < 1e-7 * dataset.dissipated.values[-1]
