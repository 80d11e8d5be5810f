"""Mechanisms that share no force are each as accurate as alone, however different their sizes are."""

from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear import dynamics
from flexclear.dynamics.model.mechanism import build
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent
from tests.properties.mechanisms import joint, rigid, scene

STIFFNESS, FREQUENCY = 400.0, 20.0


def pair(amplitude: float, reach: float, random: Random, **changes: Any) -> tuple[dict[str, Any], np.ndarray]:
    """A stage of 1 kg on a spring, and a pendulum that nothing connects with it; and the stage's axis.

    amplitude: of the stage [m].  reach: of the pendulum [m].  The scene is turned by a random rotation.
    """
    turn = Rotation.from_rotvec([random.uniform(-2.0, 2.0) for _ in range(3)]).as_matrix()
    x, y, z = turn.T
    axes = {"x": x.tolist(), "z": z.tolist()}
    at = turn @ [0.1, 0.0, 0.0]
    stage = rigid(1.0, 0.01, {"o": {}}, pose={"position": (at + amplitude * z).tolist(), "axes": axes})
    crane = rigid(1000.0, 10.0 * reach**2, {"o": {}}, com=[reach, 0.0, 0.0], pose={"axes": axes})
    bodies = [("stage", stage), ("crane", crane)]
    random.shuffle(bodies)
    frames = {"o": {"axes": axes}, "q": {"position": at.tolist(), "axes": axes}}
    load = {"g": {"type": "gravity", "acceleration": (-9.81 * y).tolist()}}
    load["s"] = {"type": "joint-spring", "joint": "p", "stiffness": STIFFNESS}
    joints = {"p": joint("prismatic", "ground.q", "stage.o"), "h": joint("revolute", "ground.o", "crane.o")}
    bodies.append(("ground", {"type": "ground", "frames": frames}))
    return scene(dict(bodies), joints, 2.0, load=load, **{"output": {"interval": 0.05}, "solver": {}} | changes), z


@pytest.mark.parametrize("seed", range(8))
def test_a_small_motion_keeps_its_accuracy_next_to_a_large_one(seed: int) -> None:
    """The error over seven periods of the exact vibration is a few times rtol, as of the stage alone: 3.3 at 1e-6."""
    random = Random(seed)
    rtol = 10.0 ** random.uniform(-10.0, -5.0)
    # places within 100 m of the origin are rounded by 1e-14 m, a share of 1e-6 of the smallest amplitude
    amplitude, reach = 10.0 ** random.uniform(-8.0, -3.0), 10.0 ** random.uniform(0.0, 2.0)
    table, z = pair(amplitude, reach, random, solver={"rtol": rtol})
    run = dynamics.simulate(Scene.model_validate(table), {}, silent)
    places = run.position.sel(body="stage").values @ z
    miss = np.abs(places - amplitude * np.cos(FREQUENCY * run.time.values)).max()
    assert miss < (100.0 * rtol + 1e-5) * amplitude


def test_the_energy_of_a_small_mechanism_is_balanced_by_itself() -> None:
    """rk4 with six steps per period damps the stage; the pendulum, with 10^12 times its energy, is resolved."""
    table, _ = pair(1e-3, 10.0, Random(1), solver={"integrator": "rk4", "step": 0.05})
    with pytest.raises(SolverError, match="energy balance of body stage and what it is connected to does not close"):
        dynamics.simulate(Scene.model_validate(table), {}, silent)


def test_what_acts_between_bodies_makes_them_one_mechanism() -> None:
    table, _ = pair(1e-3, 10.0, Random(1))
    assert len(build(Scene.model_validate(table), {}).components.lengths) == 2
    damper = {"type": "spring-damper", "between": ["stage.o", "crane.o"], "stiffness": 1.0, "free_length": 0.1}
    table["load"] |= {"d": damper}
    whole = build(Scene.model_validate(table), {})
    assert whole.components.lengths == (whole.length,)


def test_frames_of_the_ground_that_a_mechanism_does_not_use_are_none_of_its_size() -> None:
    table, _ = pair(1e-3, 10.0, Random(1))
    before = build(Scene.model_validate(table), {}).components.lengths
    table["body"]["ground"]["frames"]["far"] = {"position": [1e3, 0.0, 0.0]}
    assert build(Scene.model_validate(table), {}).components.lengths == before
