"""Next to the reduced bundle: the rigid body that a mesh would be if nothing of it deformed."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import RIGID, conform
from flexclear.pipeline.structure.kinds.kind import of_mesh


def build(mesh: xr.Dataset) -> xr.Dataset:
    """Mass [kg], centre of mass [m], inertia about it [kg m^2] and frames of a mesh (schema RIGID), in its frame."""
    model = of_mesh(mesh).assemble(mesh)
    integrals = model.integrate(np.zeros((model.size, 0)))
    com = integrals.first_moment / integrals.mass
    second = integrals.second_moment - integrals.mass * np.outer(com, com)
    data = {
        "mass": ((), integrals.mass),
        "com": (("axis",), com),
        "inertia": (("axis", "axis2"), np.trace(second) * np.eye(3) - second),
        "frame_position": (("frame", "axis"), np.stack([frame.position for frame in model.interfaces])),
        "frame_rotation": (("frame", "axis", "axis2"), np.stack([frame.rotation for frame in model.interfaces])),
    }
    made = xr.Dataset(data, coords={"frame": [frame.name for frame in model.interfaces]})
    return conform(made, RIGID, title=f"Rigid body made of the mesh: {mesh.attrs['title']}")
