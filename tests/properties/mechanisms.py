"""Small mechanisms for tests, as scenes in tables of SI numbers."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.dynamics.run.horizon.horizon import Pair
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent

Table = dict[str, Any]
GRAVITY = {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}}


def simulate(table: Table) -> xr.Dataset:
    return simulated(Scene.model_validate(table))


def simulated(scene: Scene, bundles: Mapping[str, xr.Dataset] = MappingProxyType({})) -> xr.Dataset:
    """The run of a scene without its perturbed run, which takes as long again, and hence without a horizon."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pair, "perturbed_run", lambda *_: None)
        return dynamics.simulate(scene, bundles, silent)


def body(position: Any, mass: float = 1.0, frames: Table | None = None, **more: Any) -> Table:
    """A body of unequal moments of inertia whose frame starts parallel to the world's."""
    return {
        "type": "rigid",
        "mass": mass,
        "inertia": [0.012 * mass, 0.02 * mass, 0.015 * mass],
        "com": [0.01, -0.02, 0.015],
        "pose": {"position": list(position)},
        "frames": frames or {},
        **more,
    }


def rigid(mass: float, inertia: float | list[float], frames: Table, **more: Any) -> Table:
    """A rigid body; inertia: one number [kg m^2] where it is alike about all axes."""
    moments = [inertia] * 3 if isinstance(inertia, float) else inertia
    return {"type": "rigid", "mass": mass, "inertia": moments, "frames": frames, **more}


def ground(**frames: Any) -> Table:
    return {"type": "ground", "frames": {name: {"position": list(p)} for name, p in frames.items()}}


def frame(position: Any, turn: Any = (0.0, 0.0, 0.0)) -> Table:
    return {"position": list(position), "rotation_vector": list(turn)}


def scene(bodies: Table, joints: Table, end: float = 0.2, rtol: float = 1e-12, **more: Any) -> Table:
    """A scene that is recorded twenty times."""
    return {
        "title": "test",
        "body": bodies,
        "joint": joints,
        "time": {"end": end},
        "output": {"interval": end / 20.0},
        "solver": {"rtol": rtol},
        **more,
    }


def joint(kind: str, first: str, second: str, **more: Any) -> Table:
    return {"type": kind, "between": [first, second], **more}


def turned(R: np.ndarray, vector: Any) -> list[float]:
    return [float(x) for x in R @ np.asarray(vector)]


def matrix(vector: Any) -> np.ndarray:
    return rotation_vector_to_matrix(np.asarray(vector, dtype=float))


#: turns of frames
TILT, LEAN = (0.3, -0.2, 0.1), (-0.1, 0.4, 0.2)


def two_loops() -> Table:
    """Ground-universal-a-cylindrical-b-spherical-ground, and ground-planar-c-revolute-d-spherical-ground."""
    bodies = {
        "base": {
            "type": "ground",
            "frames": {
                "U": frame((0.0, 0.0, 0.0), TILT),
                "S": frame((0.5, 0.3, 0.2)),
                "P": frame((1.0, 0.0, 0.0), LEAN),
                "T": frame((1.4, 0.3, -0.2)),
            },
        },
        "a": body((0.0, 0.0, 0.0), frames={"U": frame((0.0, 0.0, 0.0), TILT), "Y": frame((0.3, 0.0, 0.1), LEAN)}),
        "b": body((0.3, 0.0, 0.1), frames={"Y": frame((0.0, 0.0, 0.0), LEAN), "S": frame((0.2, 0.3, 0.1))}),
        "c": body((1.0, 0.0, 0.0), frames={"P": frame((0.0, 0.0, 0.0), LEAN), "R": frame((0.2, 0.0, 0.0), TILT)}),
        "d": body((1.2, 0.0, 0.0), frames={"R": frame((0.0, 0.0, 0.0), TILT), "T": frame((0.2, 0.3, -0.2))}),
    }
    joints = {
        "U": joint("universal", "base.U", "a.U"),
        "Y": joint("cylindrical", "a.Y", "b.Y"),
        "S": joint("spherical", "b.S", "base.S"),
        "P": joint("planar", "base.P", "c.P"),
        "R": joint("revolute", "c.R", "d.R"),
        "T": joint("spherical", "d.T", "base.T"),
    }
    return scene(bodies, joints, end=0.2, load=GRAVITY)
