"""Smooth mechanisms and single runs of the stepper, for tests of integrators."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import tabulate
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine, prepare
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.trajectory import Trajectory, integrate

#: a tolerance at which no projection is made within these short runs, so that the method alone is seen
NO_PROJECTION = 1e-2
GRAVITY = {"g": {"type": "gravity", "acceleration": [1.0, -4.0, -9.0]}}
INERTIA = [0.02, 0.03, 0.04]


def spatial_four_bar() -> dict[str, Any]:
    """Two cranks about crossed axes and a coupler with a ball joint at each end: one closed loop, no redundancy."""
    across = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}
    return {
        "title": "spatial four-bar linkage",
        "body": {
            "ground": {
                "type": "ground",
                "frames": {"O": {}, "P": {"position": [1.0, 0.0, 0.0], "axes": across}},
            },
            "crank": {
                "type": "rigid",
                "mass": 1.0,
                "com": [0.15, 0.0, 0.0],
                "inertia": INERTIA,
                "pose": {},
                "frames": {"O": {}, "tip": {"position": [0.3, 0.0, 0.0]}},
            },
            "coupler": {
                "type": "rigid",
                "mass": 0.7,
                "inertia": INERTIA,
                "pose": {"position": [0.65, 0.0, 0.3]},
                "frames": {"a": {"position": [-0.35, 0.0, -0.3]}, "b": {"position": [0.35, 0.0, 0.3]}},
            },
            "rocker": {
                "type": "rigid",
                "mass": 0.9,
                "com": [0.0, 0.02, 0.3],
                "inertia": INERTIA,
                "pose": {"position": [1.0, 0.0, 0.0]},
                "frames": {"P": {"axes": across}, "tip": {"position": [0.0, 0.0, 0.6]}},
            },
        },
        "joint": {
            "O": {"type": "revolute", "between": ["ground.O", "crank.O"]},
            "P": {"type": "revolute", "between": ["ground.P", "rocker.P"]},
            "A": {"type": "spherical", "between": ["crank.tip", "coupler.a"]},
            "B": {"type": "spherical", "between": ["rocker.tip", "coupler.b"]},
        },
        "load": GRAVITY,
        "time": {"end": 1.2},
        "output": {"interval": 0.0173},
    }


def double_pendulum() -> dict[str, Any]:
    """Two hinges about axes that are askew."""
    body = {"type": "rigid", "mass": 1.0, "com": [0.2, 0.0, 0.05], "inertia": INERTIA}
    askew = {"z": [0.3, 1.0, 0.2], "x": [1.0, 0.0, 0.0]}
    return {
        "title": "double pendulum",
        "body": {
            "ground": {"type": "ground", "frames": {"O": {}}},
            "one": {**body, "pose": {}, "frames": {"O": {}, "Q": {"position": [0.4, 0.0, 0.0], "axes": askew}}},
            "two": {**body, "frames": {"Q": {"axes": askew}}, "pose": {"position": [0.4, 0.0, 0.0]}},
        },
        "joint": {
            "O": {"type": "revolute", "between": ["ground.O", "one.O"]},
            "Q": {"type": "revolute", "between": ["one.Q", "two.Q"]},
        },
        "load": GRAVITY,
        "time": {"end": 1.2},
        "output": {"interval": 0.0173},
    }


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
