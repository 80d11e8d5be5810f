"""Smooth mechanisms and single runs of the stepper, for tests of integrators."""

from functools import cache
from typing import Any

import numpy as np

from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.evaluation.engine import Engine, prepare
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import Trajectory, integrate
from flexclear.scene.schema import Scene
from tests.properties.mechanisms import joint, rigid

#: a tolerance at which no projection is made within these short runs, so that the method alone is seen
NO_PROJECTION = 1e-2
GRAVITY = {"g": {"type": "gravity", "acceleration": [1.0, -4.0, -9.0]}}
INERTIA = [0.02, 0.03, 0.04]
TIMES = {"time": {"end": 1.2}, "output": {"interval": 0.0173}}


def spatial_four_bar() -> dict[str, Any]:
    """Two cranks about crossed axes and a coupler with a ball joint at each end: one closed loop, no redundancy."""
    across = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}
    coupled = {"a": {"position": [-0.35, 0.0, -0.3]}, "b": {"position": [0.35, 0.0, 0.3]}}
    turning = {"O": {}, "tip": {"position": [0.3, 0.0, 0.0]}}
    rocking = {"P": {"axes": across}, "tip": {"position": [0.0, 0.0, 0.6]}}
    bodies = {
        "ground": {"type": "ground", "frames": {"O": {}, "P": {"position": [1.0, 0.0, 0.0], "axes": across}}},
        "crank": rigid(1.0, INERTIA, turning, com=[0.15, 0.0, 0.0], pose={}),
        "coupler": rigid(0.7, INERTIA, coupled, pose={"position": [0.65, 0.0, 0.3]}),
        "rocker": rigid(0.9, INERTIA, rocking, com=[0.0, 0.02, 0.3], pose={"position": [1.0, 0.0, 0.0]}),
    }
    joints = {
        "O": joint("revolute", "ground.O", "crank.O"),
        "P": joint("revolute", "ground.P", "rocker.P"),
        "A": joint("spherical", "crank.tip", "coupler.a"),
        "B": joint("spherical", "rocker.tip", "coupler.b"),
    }
    return {"title": "spatial four-bar linkage", "body": bodies, "joint": joints, "load": GRAVITY, **TIMES}


def double_pendulum() -> dict[str, Any]:
    """Two hinges about axes that are askew."""
    com, elbow = [0.2, 0.0, 0.05], [0.4, 0.0, 0.0]
    askew = {"z": [0.3, 1.0, 0.2], "x": [1.0, 0.0, 0.0]}
    bodies = {
        "ground": {"type": "ground", "frames": {"O": {}}},
        "one": rigid(1.0, INERTIA, {"O": {}, "Q": {"position": elbow, "axes": askew}}, com=com, pose={}),
        "two": rigid(1.0, INERTIA, {"Q": {"axes": askew}}, com=com, pose={"position": elbow}),
    }
    joints = {"O": joint("revolute", "ground.O", "one.O"), "Q": joint("revolute", "one.Q", "two.Q")}
    return {"title": "double pendulum", "body": bodies, "joint": joints, "load": GRAVITY, **TIMES}


SCENES = {"spatial four-bar": spatial_four_bar, "double pendulum": double_pendulum}


def engine_with(scene: Scene) -> Engine:
    return prepare(tabulate(build(scene, {})), lambda fraction, text: None)


def trajectory(table: dict[str, Any], solver: dict[str, Any]) -> Trajectory:
    """The run with this solver table."""
    engine = engine_with(Scene.model_validate({**table, "solver": solver}))
    start = consistent_start(engine)
    return integrate(engine, start, lambda fraction, text: None)


@cache
def reference(name: str) -> np.ndarray:
    """Rows of a converged run: DOP853 at 1e-13."""
    return trajectory(SCENES[name](), {"rtol": 1e-13}).rows


def ledger_free(rows: np.ndarray) -> np.ndarray:
    """Positions and speeds of rows of a scene without contact (two ledger variables)."""
    return rows[:, 1:-2]
