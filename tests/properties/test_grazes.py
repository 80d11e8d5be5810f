"""Contacts that only just touch: each closing approaches and each opening leaves, whatever the tolerance."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent

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

    table = {
        "title": "graze",
        "time": {"end": 3.0},
        "output": {"interval": 0.5},
        "body": {
            "ground": {"type": "ground", "frames": {"o": at(0.0), "f": at(-0.1 - RADIUS + 0.1 * depth)}},
            "b": {"type": "rigid", "mass": 1.0, "inertia": [1.0] * 3, "pose": at(0.1), "frames": {"c": {}}},
        },
        "joint": {
            "p": {"type": "prismatic", "between": ["ground.o", "b.c"]},
            "f": {
                "type": "ball-on-plane",
                "between": ["ground.f", "b.c"],
                "ball_radius": unit * RADIUS,
                "normal": {"law": "hertz", "stiffness": 1e8 / unit**0.5},
            },
        },
        "load": {"s": {"type": "joint-spring", "joint": "p", "stiffness": FREQUENCY**2}},
        "solver": {"rtol": rtol, "ledger_tolerance": 0.1},  # a few periods at 1e-3 gain a percent
    }
    return Scene.model_validate(table), 0.1 * unit * depth


@pytest.mark.parametrize("seed", range(24))
def test_closings_approach_and_openings_leave(seed: int) -> None:
    random = Random(seed)
    scene, _ = graze(random, 10.0 ** random.uniform(-10.0, -3.0))
    run = dynamics.simulate(scene, {}, silent)
    kinds, speeds = run.event_kind.values, run.event_approach_speed.values
    assert np.all(speeds[kinds == "closing"] > 0.0)
    assert np.all(speeds[kinds == "opening"] > 0.0)
    assert np.all(run.event_duration.values[kinds == "closing"] > 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_graze_deeper_than_the_tolerance_is_seen_at_its_speed(seed: int) -> None:
    """It meets the plane with the speed that the spring leaves there, sqrt(2 w^2 A d) to first order in d/A."""
    scene, depth = graze(Random(seed), 1e-13)
    run = dynamics.simulate(scene, {}, silent)
    amplitude = float(np.linalg.norm(scene.body["b"].pose.position))
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
        scene, _ = graze(Random(seed), 1e-10, unit, 0.3)
        joint = scene.joint["f"]
        law = joint.normal.model_copy(update={"law": "lankarani-nikravesh", "restitution": 0.6})
        lossy = scene.model_copy(update={"joint": scene.joint | {"f": joint.model_copy(update={"normal": law})}})
        run = dynamics.simulate(lossy, {}, silent)
        runs.append(run.event_approach_speed.values[run.event_kind.values == "closing"] / unit)
    assert len(runs[0]) == len(runs[1]) >= 5
    np.testing.assert_allclose(runs[1], runs[0], rtol=1e-6)
