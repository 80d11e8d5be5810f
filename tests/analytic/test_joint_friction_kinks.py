"""Joints of every type, and a contact, that slide through the speeds at which friction bends: own equations.

Joints stand side by side in one scene, of the kinds of `test_joint_friction`, so that nothing more is compiled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from tests.analytic.mechanism_runs import run
from tests.analytic.test_joint_friction import ACROSS, guide
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid, scene, simulate
from tests.reference.contact_solutions import modified_coulomb
from tests.reference.kinks import from_kink_to_kink
from tests.reference.rubbing_slider_crank import released

G, MASS, INERTIA, RADIUS = 9.81, 2.0, 5e-4, 0.02
COULOMB = {"law": "modified-coulomb", "static": 0.5, "dynamic": 0.4, "v_static": 5e-3, "v_dynamic": 2e-2}
RAMP = {"law": "ambrosio", "dynamic": 0.4, "v0": 5e-3, "v1": 2e-2}
BRISTLES = {"law": "lugre", "static": 0.5, "dynamic": 0.4, "v_stribeck": 2e-2, "bristle_stiffness": 2e3}
#: sliding speeds at first [m/s], of the sleeve along its axis and around it; force against the blocks [N]
SPEED, HELIX, PUSH = 0.06, (0.05, 0.03), 12.0
END = 0.012
#: rates [1/s^2] of sliding velocities around and along per unit of force coefficient: of what turns, and of what moves
TURNING, MOVING = RADIUS**2 * MASS * G / INERTIA, G
TOLERANCES = tuple(float(10.0**-k) for k in np.arange(6.0, 10.1, 0.5))


@dataclass(frozen=True)
class Slide:
    """Equation of a sliding velocity: its start [m/s], and rates(v, z) of it and of bristles z; kinks: of its size."""

    start: tuple[float, ...]
    rates: Callable[[np.ndarray, float], tuple[np.ndarray, float]]
    kinks: tuple[float, ...]


def coulomb(speed: float) -> float:
    return modified_coulomb(speed, **{name: value for name, value in COULOMB.items() if name != "law"})


def ramp(speed: float) -> float:
    return float(np.clip((speed - RAMP["v0"]) / (RAMP["v1"] - RAMP["v0"]), 0.0, 1.0) * RAMP["dynamic"])


def without_memory(
    mu: Callable[[float], float], rates: tuple[float, ...], push: float = 0.0
) -> Callable[[np.ndarray, float], tuple[np.ndarray, float]]:
    """Friction mu against a sliding velocity whose components follow it at these rates, and a push along it."""

    def found(v: np.ndarray, z: float) -> tuple[np.ndarray, float]:
        speed = float(np.linalg.norm(v))
        direction = v / speed if speed > 0.0 else 0.0 * v
        return -np.array(rates) * mu(speed) * direction - push, 0.0

    return found


def bristly(v: np.ndarray, z: float) -> tuple[np.ndarray, float]:
    """Canudas de Wit et al. (1995) without damping, with a push."""
    s0, mu_s, mu_d = BRISTLES["bristle_stiffness"], BRISTLES["static"], BRISTLES["dynamic"]
    g = mu_d + (mu_s - mu_d) * np.exp(-((v[0] / BRISTLES["v_stribeck"]) ** 2))
    return np.array([-s0 * z * G - PUSH / MASS]), float(v[0] - s0 * abs(v[0]) / g * z)


LEVELS = (COULOMB["v_dynamic"], COULOMB["v_static"])
SLIDING = {
    "block": Slide((SPEED,), without_memory(coulomb, (MOVING,), PUSH / MASS), LEVELS),
    "braked": Slide((SPEED,), without_memory(coulomb, (MOVING,), PUSH / MASS), LEVELS),
    "bristly": Slide((SPEED,), bristly, (0.0,)),
    "wheel": Slide((SPEED,), without_memory(ramp, (TURNING,)), LEVELS),
    "ball": Slide((SPEED,), without_memory(coulomb, (TURNING,)), LEVELS),
    "shaft": Slide(HELIX, without_memory(ramp, (MOVING, TURNING)), LEVELS),
    "cross": Slide((SPEED,), without_memory(coulomb, (TURNING,)), LEVELS),
}


@cache
def known(name: str) -> np.ndarray:
    """Sliding velocities at the recorded times, from kink to kink; shape (component, time)."""
    what, times = SLIDING[name], np.linspace(0.0, END, 21)
    size = len(what.start)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return np.append(*what.rates(y[:size], y[size]))

    def speed(y: np.ndarray) -> float:
        return float(y[0]) if size == 1 else float(np.linalg.norm(y[:size]))

    levels = np.array(sorted({s * k for k in what.kinks for s in (-1.0, 1.0)}))
    return from_kink_to_kink(rates, lambda y: speed(y) - levels, np.array([*what.start, 0.0]), times)[:size]


def brakes(rtol: float) -> Table:
    """A block, one on bristles and one that a load brakes, pushed back; a wheel, a ball, a helix, a cross."""

    def one(frames: Table, **more: Any) -> Table:
        return rigid(MASS, INERTIA, frames, pose={}, **more)

    level, turning = {"velocity": [SPEED, 0.0, 0.0]}, SPEED / RADIUS
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"level": guide(0.0), "across": ACROSS, "O": {}}},
        "block": one({"centre": guide(0.0)}, **level),
        "bristly": one({"centre": guide(0.0)}, **level),
        "braked": one({"centre": guide(0.0)}, **level),
        "wheel": one({"pin": ACROSS}, angular_velocity=[0.0, turning, 0.0]),
        "ball": one({"centre": {}}, angular_velocity=[2 / 3 * turning, 1 / 3 * turning, 2 / 3 * turning]),
        "shaft": one({"pin": ACROSS}, velocity=[0.0, HELIX[0], 0.0], angular_velocity=[0.0, HELIX[1] / RADIUS, 0.0]),
        "cross": one({"centre": {}}, angular_velocity=[turning, 0.0, 0.0]),
    }
    joints = {
        "block": joint("prismatic", "ground.level", "block.centre") | {"friction": COULOMB},
        "braked": joint("prismatic", "ground.level", "braked.centre"),
        "bristly": joint("prismatic", "ground.level", "bristly.centre") | {"friction": BRISTLES},
        "wheel": joint("revolute", "ground.across", "wheel.pin") | {"friction": RAMP | {"radius": RADIUS}},
        "ball": joint("spherical", "ground.O", "ball.centre") | {"friction": COULOMB | {"radius": RADIUS}},
        "shaft": joint("cylindrical", "ground.across", "shaft.pin") | {"friction": RAMP | {"radius": RADIUS}},
        "cross": joint("universal", "ground.O", "cross.centre") | {"friction": COULOMB | {"radius": RADIUS}},
    }
    pushed = {
        name: {"type": "point-force", "frame": f"{name}.centre", "force": [-PUSH, 0.0, 0.0], "axes": "world"}
        for name in ("block", "bristly", "braked")
    }
    # of the same strength as that of the block, which its weight presses
    strength = {name: COULOMB[name] * MASS * G for name in ("static", "dynamic")}
    speeds = {name: COULOMB[name] for name in ("v_static", "v_dynamic")}
    pushed["brake"] = {"type": "joint-friction", "joint": "braked", "coulomb": strength | speeds}
    return scene(bodies, joints, end=END, rtol=rtol, load=GRAVITY | pushed)


def sliding(dataset: xr.Dataset, name: str) -> np.ndarray:
    """Sliding velocities of a joint; shape (component, time)."""
    body = dataset.sel(body=name)
    v, around = body.velocity.values, RADIUS * body.angular_velocity.values
    found = {"wheel": around[:, 1:2], "cross": around[:, :1], "shaft": np.column_stack([v[:, 1], around[:, 1]])}
    found["ball"] = around @ np.array([[2.0], [1.0], [2.0]]) / 3.0
    return np.asarray(found.get(name, v[:, :1])).T


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_errors_of_joints_whose_friction_bends_follow_the_tolerance(rtol: float) -> None:
    """They are up to 1.7 times rtol here, with bristles 5.7 times; steps over kinks made that up to 120 times, and of
    friction along a joint coordinate 240 times."""
    dataset = simulate(brakes(rtol))
    for name in SLIDING:
        most = 60.0 if name == "bristly" else 20.0
        assert np.abs(sliding(dataset, name) - known(name)).max() < most * rtol * SPEED, name


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_errors_of_a_slider_crank_whose_loads_and_sliding_reverse_follow_the_tolerance(rtol: float) -> None:
    """They are 0.2 to 1.1 times rtol here, of 1 rad and 1 m/s; steps over kinks made that up to 30 times."""
    known = released()
    dataset = run("checks/rubbing_slider_crank", (("solver.rtol", rtol),))
    angle = dataset["joint_position"].sel(coordinate="O").values
    assert angle - angle[0] == pytest.approx(known.angle - known.angle[0], abs=12.0 * rtol)
    assert dataset["joint_velocity"].sel(coordinate="P").values == pytest.approx(known.speed, abs=12.0 * rtol)


@pytest.mark.parametrize("rtol", TOLERANCES[2:])
def test_errors_of_a_ball_that_slides_down_a_slope_follow_the_tolerance(rtol: float) -> None:
    """Against one equation, s' = g sin - mu(s) g cos (1 + m r^2 / J): friction is larger than its weight's pull.

    They are 0.02 to 0.18 times rtol here; steps over the kinks made that up to 26 times, at single tolerances.
    """
    s, c = float(np.sin(np.radians(30.0))), float(np.cos(np.radians(30.0)))
    radius, mass, inertia = 0.1, 1.0, 0.004
    down, up = np.array([c, 0.0, -s]), np.array([s, 0.0, c])
    # where its weight presses it into the slope, 1e6 N/m, so that its normal force is constant
    resting = (radius - mass * G * c / 1e6) * up
    changes = (
        ("time.end", 20e-3),
        ("output.interval", 1e-3),
        ("solver.rtol", rtol),
        ("body.sliding.pose", (("position", tuple(resting.tolist())),)),
        ("body.sliding.velocity", tuple((SPEED * down).tolist())),
        ("joint.slip.friction", tuple(COULOMB.items())),
    )
    dataset = run("checks/ball_on_plane", changes)
    moving = dataset.sel(body="sliding")
    speeds = moving.velocity.values @ down - radius * moving.angular_velocity.values[:, 1]

    def rate(_: float, speed: np.ndarray) -> list[float]:
        return [G * s - G * c * (1.0 + mass * radius**2 / inertia) * coulomb(float(speed[0]))]

    kinks = np.array([*LEVELS, 0.0])
    known = from_kink_to_kink(rate, lambda v: v - kinks, np.array([SPEED]), dataset.time.values)[0]
    assert speeds.min() < COULOMB["v_static"]
    assert np.abs(speeds - known).max() < 2.0 * rtol * SPEED


def test_a_slider_crank_with_friction_in_every_joint_moves_as_derived_in_other_coordinates() -> None:
    dataset = run("checks/rubbing_slider_crank")
    known = released()
    # the run is good to 1e-9 or better; friction changes the angle by half a radian
    angle = dataset["joint_position"].sel(coordinate="O").values
    assert angle - angle[0] == pytest.approx(known.angle - known.angle[0], abs=1e-6)
    assert dataset["joint_velocity"].sel(coordinate="P").values == pytest.approx(known.speed, abs=1e-5)
    for k, name in enumerate("OABP"):
        load = dataset["joint_bearing_load"].sel(rubbing=name).values
        assert load == pytest.approx(known.loads[k], rel=1e-4, abs=1e-4)
    assert dataset.dissipated.values[-1] == pytest.approx(known.lost, rel=1e-6)
    assert known.lost > 0.1
    assert "friction of O, A, B, P depends on reactions" in dataset.attrs["warnings"]
