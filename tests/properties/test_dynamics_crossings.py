"""No contact is stepped over, however long the steps: a sprung ball swings a little beyond its socket's wall."""

from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear.scene.clearance import Hysteretic
from flexclear.scene.schema import Scene
from tests.properties.mechanisms import Table, joint, rigid, scene, simulate, simulated

#: radius of the swing [m] and its rate [rad/s]; the period is 2 pi s
SWING, RATE = 1.0, 1.0


def sprung(clearance: float, phase: float, solver: dict[str, Any]) -> Table:
    """A ball on a spring along x, let go inside the socket at a phase of its swing, until it is back there."""
    along = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}
    start = {
        "pose": {"position": [SWING * np.sin(phase), 0.0, 0.0]},
        "velocity": [SWING * RATE * np.cos(phase), 0.0, 0.0],
    }
    normal = {"law": "hertz", "stiffness": 1e6}
    contact = joint("clearance-spherical", "ground.socket", "ball.centre", clearance=clearance, ball_radius=0.5)
    return scene(
        {
            "ground": {"type": "ground", "frames": {"socket": {}, "rail": along}},
            "ball": rigid(1.0, 0.1, {"centre": {}, "rail": along}, **start),
        },
        {"rail": joint("prismatic", "ground.rail", "ball.rail"), "contact": contact | {"normal": normal}},
        end=2.0 * np.pi / RATE,
        output={"interval": 10.0},
        solver={**solver, "ledger_tolerance": 1.0},  # loose on purpose
        load={"spring": {"type": "joint-spring", "joint": "rail", "stiffness": RATE**2}},
    )


@pytest.mark.parametrize("clearance", [0.9, 0.97, 0.995])
@pytest.mark.parametrize("phase", [-1.0, -0.5, 0.0, 0.6])
@pytest.mark.parametrize(
    "solver", [{"rtol": 1e-2}, {"rtol": 1e-3}, {"rtol": 1e-6}, {"rtol": 1e-3, "integrator": "dopri5"}]
)
def test_the_first_touch_is_located_at_any_tolerance(clearance: float, phase: float, solver: dict[str, Any]) -> None:
    """Steps of order 8 at loose tolerances are longer than the swing takes to and from the wall."""
    run = simulate(sprung(clearance, phase, solver))
    touch = (np.arcsin(clearance / SWING) - phase) / RATE
    assert len(run.event_time) > 0
    # the error of a step is rtol of the swing, and the ball meets the wall at sqrt(1 - c^2) of its largest speed
    allowed = 10.0 * solver["rtol"] / np.sqrt(1.0 - clearance**2)
    assert float(run.event_time[0]) == pytest.approx(touch, abs=allowed)


@pytest.mark.parametrize("clearance", [1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("solver", [{"rtol": 1e-3}, {"rtol": 1e-10}, {"rtol": 1e-6, "integrator": "dopri5"}])
def test_the_first_touch_is_located_in_a_step_of_many_clearances(clearance: float, solver: dict[str, Any]) -> None:
    """A parabola 3 m away is one step: beyond the socket's wall by a fiftieth of the clearance, and out below."""
    gravity, below = 10.0, 0.3 * clearance
    up = np.sqrt(2.0 * gravity * (1.02 * clearance + below))
    touch = (up - np.sqrt(up**2 - 2.0 * gravity * (clearance + below))) / gravity
    parts = sprung(clearance, 0.0, solver)
    del parts["joint"]["rail"]
    parts["load"] = {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -gravity]}}
    parts["body"]["ground"]["frames"]["socket"] = {"position": [3.0, 0.0, 0.0]}
    parts["body"]["ball"] |= {"pose": {"position": [3.0, 0.0, -below]}, "velocity": [0.0, 0.0, up]}
    parts["time"] = {"end": 1000.0 * touch}  # the first step may be that long
    run = simulate(parts)
    # every method integrates a parabola exactly, and the ball stays exactly 3 m away: left are the root, to 1e-12
    # of the clearance, and the rounding of differences where the ball has an eighth of its speed left
    assert float(run.event_time[0]) == pytest.approx(touch, rel=1e-8)


# Contacts that only just touch: each closing approaches and each opening leaves, at any tolerance -------------------

FREQUENCY, RADIUS = 10.0, 0.02


def graze(random: Random, rtol: float, unit: float = 0.0, depth: float = 0.0) -> tuple[Scene, float]:
    """A ball on a spring that would swing through a plane by a depth, a share of its amplitude; that depth [m].

    Turned by a random rotation.  unit, depth: what lengths are magnified by and the share; by default at random, from
    1e-4 to 10 and from 1e-10 to 1e-4.
    """
    turn = Rotation.from_rotvec([random.uniform(-2.0, 2.0) for _ in range(3)]).as_matrix()
    unit, depth = unit or 10.0 ** random.uniform(-4.0, 1.0), depth or 10.0 ** random.uniform(-10.0, -4.0)
    axes = {"x": turn[:, 0].tolist(), "z": turn[:, 2].tolist()}

    def at(height: float) -> dict[str, object]:
        return {"position": (unit * height * turn[:, 2]).tolist(), "axes": axes}

    ground = {"type": "ground", "frames": {"o": at(0.0), "f": at(-0.1 - RADIUS + 0.1 * depth)}}
    normal = {"law": "hertz", "stiffness": 1e8 / unit**0.5}
    plane = joint("ball-on-plane", "ground.f", "b.c", ball_radius=unit * RADIUS, normal=normal)
    table = scene(
        {"ground": ground, "b": rigid(1.0, 1.0, {"c": {}}, pose=at(0.1))},
        {"p": joint("prismatic", "ground.o", "b.c"), "f": plane},
        end=3.0,
        output={"interval": 0.5},
        load={"s": {"type": "joint-spring", "joint": "p", "stiffness": FREQUENCY**2}},
        solver={"rtol": rtol, "ledger_tolerance": 0.1},  # a few periods at 1e-3 gain a percent
    )
    return Scene.model_validate(table), 0.1 * unit * depth


@pytest.mark.parametrize("seed", range(24))
def test_closings_approach_and_openings_leave(seed: int) -> None:
    random = Random(seed)
    grazing, _ = graze(random, 10.0 ** random.uniform(-10.0, -3.0))
    run = simulated(grazing)
    kinds, speeds = run.event_kind.values, run.event_approach_speed.values
    assert np.all(speeds[kinds == "closing"] > 0.0)
    assert np.all(speeds[kinds == "opening"] > 0.0)
    assert np.all(run.event_duration.values[kinds == "closing"] > 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_graze_deeper_than_the_tolerance_is_seen_at_its_speed(seed: int) -> None:
    """It meets the plane with the speed that the spring leaves there, sqrt(2 w^2 A d) to first order in d/A."""
    grazing, depth = graze(Random(seed), 1e-13)
    run = simulated(grazing)
    amplitude = float(np.linalg.norm(grazing.body["b"].pose.position))
    first = float(run.event_approach_speed.values[run.event_kind.values == "closing"][0])
    assert first == pytest.approx(FREQUENCY * np.sqrt(2.0 * amplitude * depth - depth**2), rel=1e-2)


@pytest.mark.parametrize("seed", range(6))
def test_a_mechanism_of_any_size_bounces_alike(seed: int) -> None:
    """Lengths and speeds of a lossy bounce have the scene's unit, and impacts their number, if nothing is absolute.

    Impact rates amplify rounding and tolerance, so that the last speeds agree to some 1e-7.
    """
    random = Random(seed)
    runs = []
    for unit in (1.0, 10.0 ** random.uniform(-7.0, -4.0)):
        grazing, _ = graze(Random(seed), 1e-10, unit, 0.3)
        joint = grazing.joint["f"]
        keys = joint.normal.model_dump(exclude_none=True) | {"law": "lankarani-nikravesh", "restitution": 0.6}
        law = Hysteretic.model_validate(keys)
        lossy = grazing.model_copy(update={"joint": grazing.joint | {"f": joint.model_copy(update={"normal": law})}})
        run = simulated(lossy)
        runs.append(run.event_approach_speed.values[run.event_kind.values == "closing"] / unit)
    assert len(runs[0]) == len(runs[1]) >= 5
    np.testing.assert_allclose(runs[1], runs[0], rtol=1e-6)
