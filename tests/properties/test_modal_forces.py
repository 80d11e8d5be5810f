"""Forces on deformations in a rigid motion: all that acts on a body is in balance along its motions as a whole."""

import numpy as np
import xarray as xr

from flexclear.dynamics.linear.clearance_response import modal_forces
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import joint_wrenches
from flexclear.dynamics.run.run import integrate
from flexclear.numerics.rotations import skew
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent

MASS, COM, INERTIA = 1.3, np.array([0.2, 0.05, -0.03]), np.diag([0.01, 0.03, 0.035])
FRAMES = {
    "root": {"position": [0.0, 0.0, 0.0], "rotation_vector": [0.3, -0.2, 0.5]},
    "rail": {"position": [0.4, 0.1, 0.0], "axis": [1.0, 2.0, 0.5]},
    "hook": {"position": [0.3, -0.1, 0.2]},
}

#: an arm that is driven about a slanted axis, and welded to it, off its origin and turned, the body that is examined:
#: a slider runs along it as on its first frame, a spring, a force and a bushing act on it
TABLE = {
    "title": "a body on which everything acts",
    "time": {"end": 0.3},
    "output": {"interval": 0.01},
    "body": {
        "ground": {"type": "ground", "frames": {"O": {"axis": [0.2, 0.1, 1.0]}, "far": {"position": [0.5, 1.0, 0.3]}}},
        "arm": {
            "type": "rigid",
            "mass": 0.7,
            "com": [0.1, 0.0, 0.0],
            "inertia": [0.002, 0.003, 0.004],
            "frames": {"O": {}, "end": {"position": [0.25, 0.1, 0.05]}},
        },
        "beam": {
            "type": "rigid",
            "mass": MASS,
            "com": COM.tolist(),
            "inertia": np.diag(INERTIA).tolist(),
            "frames": FRAMES,
        },
        "slider": {"type": "rigid", "mass": 0.4, "inertia": [1e-3, 1e-3, 1e-3], "frames": {"c": {}}},
    },
    "joint": {
        "axle": {"type": "revolute", "between": ["ground.O", "arm.O"]},
        "weld": {"type": "fixed", "between": ["arm.end", "beam.root"]},
        "slide": {"type": "prismatic", "between": ["beam.rail", "slider.c"]},
    },
    "drive": {"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, 4.0, 9.0]}}},
    "start": {"joint": {"slide": {"position": 0.07, "velocity": 0.4}}},
    "load": {
        "gravity": {"type": "gravity", "acceleration": [0.0, -9.81, 1.0]},
        "push": {"type": "point-force", "frame": "beam.hook", "force": [3.0, -2.0, 5.0]},
        "spring": {
            "type": "spring-damper",
            "between": ["ground.far", "beam.hook"],
            "stiffness": 50.0,
            "damping": 2.0,
            "free_length": 0.2,
        },
        "mount": {
            "type": "bushing",
            "between": ["ground.far", "beam.rail"],
            "stiffness": [30.0, 20.0, 10.0, 0.5, 0.4, 0.3],
            "damping": [1.0, 1.0, 1.0, 0.01, 0.01, 0.01],
        },
        "spur": {"type": "joint-spring", "joint": "slide", "stiffness": 40.0},
    },
}


def motions_as_a_whole() -> xr.Dataset:
    """Moments of the beam's mass with the three shifts and three turns as shapes, and these at its frames."""
    about_origin = 0.5 * np.trace(INERTIA) * np.eye(3) - INERTIA + MASS * np.outer(COM, COM)  # int rho x x^T
    turn = np.stack([skew(e) for e in np.eye(3)])  # of x by e_j: turn[j] @ x
    shift = np.eye(3)
    at = [np.array(frame["position"]) for frame in FRAMES.values()]
    return xr.Dataset(
        {
            "modal_first_moment": (("axis", "mode"), MASS * np.hstack([shift, (turn @ COM).T])),
            "position_mode_moment": (
                ("k", "axis", "mode"),
                np.concatenate(
                    [np.einsum("k,lj->klj", MASS * COM, shift), np.einsum("jlm,km->klj", turn, about_origin)], 2
                ),
            ),
            "frame_translation_shape": (("frame", "axis", "mode"), [np.hstack([shift, (turn @ r).T]) for r in at]),
            "frame_rotation_shape": (("frame", "axis", "mode"), [np.hstack([0.0 * shift, shift])] * len(at)),
        },
        {"frame": list(FRAMES)},
    )


def test_what_acts_on_a_body_is_in_balance_along_its_motions_as_a_whole() -> None:
    run = integrate(Scene.model_validate(TABLE), {}, silent)
    motions = Motions(run.model, run.observed)
    wrenches = joint_wrenches(motions, ["weld", "slide"])
    forces = modal_forces(motions, "beam", motions_as_a_whole(), wrenches)
    acting = np.linalg.norm(wrenches["weld"][1], axis=1).max()
    assert acting > 10.0
    # rounding of sums of some twenty terms, the motion's accelerations solved to 1e-13
    assert np.abs(forces).max() < 1e-11 * acting
