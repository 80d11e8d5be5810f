"""Next to the reduced bundle: the rigid body that a mesh would be if nothing of it deformed."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import RIGID, conform
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.kinds.kind import of_mesh


def build(mesh: xr.Dataset) -> xr.Dataset:
    """Mass [kg], centre of mass [m], inertia about it [kg m^2] and frames of a mesh (schema RIGID), in its frame."""
    return of_model(of_mesh(mesh).assemble(mesh), mesh.attrs["title"])


def of_model(model: Model, title: str) -> xr.Dataset:
    """The same of an assembled mesh with this title."""
    return conform(xr.Dataset(*_rigid(model)), RIGID, title=f"Rigid body made of the mesh: {title}")


def drawn(mesh: xr.Dataset) -> xr.Dataset:
    """The same with what is drawn of the body, and one mode in which nothing moves: to be shown without modes."""
    model = of_mesh(mesh).assemble(mesh)
    data, coordinates = _rigid(model)
    shown, still = model.drawn, np.zeros((len(model.drawn.position), 3, 1))
    data |= {
        "first_moment": (("axis",), float(data["mass"][1]) * data["com"][1]),
        "modal_first_moment": (("axis", "mode"), np.zeros((3, 1))),
        "shape_translation": (("node", "axis", "mode"), still),
        "shape_rotation": (("node", "axis", "mode"), still),
        **shown.variables(),
    }
    return xr.Dataset(data, coordinates)


def _rigid(model: Model) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables of schema RIGID, and their coordinates."""
    integrals = model.integrate(np.zeros((model.size, 0)))
    com = integrals.first_moment / integrals.mass
    second = integrals.second_moment - integrals.mass * np.outer(com, com)
    data: dict[str, Any] = {
        "mass": ((), integrals.mass),
        "com": (("axis",), com),
        "inertia": (("axis", "axis2"), np.trace(second) * np.eye(3) - second),
        "frame_position": (("frame", "axis"), np.stack([frame.position for frame in model.interfaces])),
        "frame_rotation": (("frame", "axis", "axis2"), np.stack([frame.rotation for frame in model.interfaces])),
    }
    return data, {"frame": [frame.name for frame in model.interfaces]}
