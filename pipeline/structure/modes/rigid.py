"""Next to the reduced bundle: the rigid body that a mesh would be if nothing of it deformed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import BUNDLE, RIGID, conform
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.kinds.kind import of_mesh


def build(mesh: xr.Dataset) -> xr.Dataset:
    """Mass [kg], centre of mass [m], inertia about it [kg m^2] and frames of a mesh (schema RIGID), in its frame."""
    return of_model(of_mesh(mesh).assemble(mesh), mesh.attrs["title"])


def of_model(model: Model, title: str) -> xr.Dataset:
    """The same of an assembled mesh with this title."""
    return conform(_dataset(model, _rigid(model)), RIGID, title=f"Rigid body made of the mesh: {title}")


def drawn(mesh: xr.Dataset) -> xr.Dataset:
    """The same with what is drawn of the body, and one mode in which nothing moves: to be shown without modes."""
    model = of_mesh(mesh).assemble(mesh)
    rigid, still = _rigid(model), np.zeros((len(model.drawn.position), 3, 1))
    shown = {
        "first_moment": rigid["mass"] * rigid["com"],
        "modal_first_moment": np.zeros((3, 1)),
        "shape_translation": still,
        "shape_rotation": still,
    }
    return _dataset(model, rigid | shown | model.drawn.at_rest())


def _rigid(model: Model) -> dict[str, Any]:
    """Values of the variables of schema RIGID."""
    integrals = model.integrate(np.zeros((model.size, 0)))
    com = integrals.first_moment / integrals.mass
    second = integrals.second_moment - integrals.mass * np.outer(com, com)
    inertia = np.trace(second) * np.eye(3) - second
    return {"mass": integrals.mass, "com": com, "inertia": inertia, **model.frames()}


def _dataset(model: Model, values: Mapping[str, Any]) -> xr.Dataset:
    data = {name: ((BUNDLE | RIGID)[name].dims, value) for name, value in values.items()}
    return xr.Dataset(data, {"frame": [frame.name for frame in model.interfaces]})
