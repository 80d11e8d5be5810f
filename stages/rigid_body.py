"""Next to stage 3: mesh -> mass, inertia and frames of the body as a rigid one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import Labelled
    from flexclear.pipeline.core.system.progress import Progress

#: how inputs are called that hold such bodies, before the body's name
PREFIX = "rigid/"
#: how well a mesh determines where its frames are, as a fraction of their distance: the middle of a hole is the mean of
#: its nodes, and with sixteen of them around, a chord leaves the circle by two percent of a radius of a twentieth of it
LEFT_BY_MESHES = 1e-3


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The rigid body (schema RIGID)."""
    from flexclear.pipeline.structure.modes import bundle

    progress(None, "mass and inertia")
    return {"nc": bundle.rigid(inputs["mesh"])}


def filled(bodies: Mapping[str, Any], inputs: Mapping[str, Labelled]) -> dict[str, Any]:
    """The table of bodies with the numbers of those that inputs ``rigid/<body>`` describe instead of their recipes."""
    import numpy as np

    from flexclear.pipeline.core.numerics.rotations import matrix_to_quaternion

    result = dict(bodies)
    for name, data in inputs.items():
        if not name.startswith(PREFIX):
            continue
        body = name.removeprefix(PREFIX)
        frames = {
            str(frame): {
                "position": data["frame_position"].values[k].tolist(),
                "quaternion": matrix_to_quaternion(data["frame_rotation"].values[k]).tolist(),
            }
            for k, frame in enumerate(data["frame"].values)
        }
        numbers = {
            "mass": float(data["mass"].values),
            "com": data["com"].values.tolist(),
            "inertia": data["inertia"].values.tolist(),
            "frames": frames,
            "frame_tolerance": LEFT_BY_MESHES * float(np.ptp(data["frame_position"].values, axis=0).max()),
        }
        result[body] = {key: value for key, value in bodies[body].items() if key != "mesh"} | numbers
    return result
