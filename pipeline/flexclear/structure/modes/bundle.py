"""Stage 3: reduced bundles, all that the dynamics needs of a flexible body without its finite elements; and the rigid
body that a mesh would be without deformation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.artifacts.schema import BUNDLE, DEFICITS, RIGID, conform
from flexclear.structure.fe.model import Model
from flexclear.structure.kinds.kind import of_mesh


def build(
    mesh: xr.Dataset, modes: xr.Dataset, extra: Mapping[str, Any] | None = None, *, stiffening: bool = False
) -> xr.Dataset:
    """Build the reduced bundle (schema BUNDLE) of a mesh and its modes.

    extra: further variables, such as those of stress recovery.  stiffening: with the second-order motion by which
    forces and accelerations stiffen the body, held at the first of the modes' interfaces.

    Without deformation the body frame is the mesh frame; how it follows the deformation is defined by the
    reference condition of the modes.  Units per modal coordinate: q in m, for modal masses of 1 kg.
    """
    kind = of_mesh(mesh)
    model = kind.assemble(mesh)
    vectors = modes["vector"].values
    drawn = model.drawn.nodal_motion(vectors)
    integrals = model.integrate(vectors)
    held = next((frame for frame in model.interfaces if frame.name in modes.attrs["interfaces"].split()[:1]), None)
    second = kind.second_order(mesh, model, vectors, stiffening, held)
    moved = np.stack([frame.motion @ vectors for frame in model.interfaces])
    values = {
        **vars(integrals),
        **({} if second is None else {name: value for name, value in vars(second).items() if value is not None}),
        "modal_mass": np.einsum("kkij->ij", integrals.mode_mode_moment),
        **model.frames(),
        "frame_translation_shape": moved[:, :3],
        "frame_rotation_shape": moved[:, 3:],
        "shape_translation": drawn[:, :3],
        "shape_rotation": drawn[:, 3:],
        **model.drawn.at_rest(),
        "modal_stiffness": np.diag((2.0 * np.pi * modes["frequency"].values) ** 2),
        "frequency": modes["frequency"].values,
    }
    data: dict[str, Any] = {name: (BUNDLE[name].dims, value) for name, value in values.items()}
    data |= {name: modes[name] for name in DEFICITS if name in modes} | dict(extra or {})
    return conform(xr.Dataset(data, coords={"frame": modes["frame"].values}), BUNDLE, **modes.attrs)


def rigid(mesh: xr.Dataset) -> xr.Dataset:
    """Return mass [kg], centre of mass [m], inertia about it [kg m^2] and frames (schema RIGID), in the mesh frame."""
    return rigid_of(of_mesh(mesh).assemble(mesh), mesh.attrs["title"])


def rigid_of(model: Model, title: str) -> xr.Dataset:
    """Return the rigid body (schema RIGID) of an assembled mesh with this title."""
    return conform(_dataset(model, _rigid(model)), RIGID, title=f"Rigid body made of the mesh: {title}")


def rigid_drawing(mesh: xr.Dataset) -> xr.Dataset:
    """Return the rigid body with its drawn geometry and one mode at rest, for pictures without modes."""
    model = of_mesh(mesh).assemble(mesh)
    still = np.zeros((len(model.drawn.position), 3, 1))
    whole = _rigid(model)
    shown = {
        "first_moment": whole["mass"] * whole["com"],
        "modal_first_moment": np.zeros((3, 1)),
        "shape_translation": still,
        "shape_rotation": still,
    }
    return _dataset(model, whole | shown | model.drawn.at_rest())


def _rigid(model: Model) -> dict[str, Any]:
    """Return the values of the variables of schema RIGID."""
    integrals = model.integrate(np.zeros((model.size, 0)))
    com = integrals.first_moment / integrals.mass
    second = integrals.second_moment - integrals.mass * np.outer(com, com)
    inertia = np.trace(second) * np.eye(3) - second
    return {"mass": integrals.mass, "com": com, "inertia": inertia, **model.frames()}


def _dataset(model: Model, values: Mapping[str, Any]) -> xr.Dataset:
    data = {name: ((BUNDLE | RIGID)[name].dims, value) for name, value in values.items()}
    return xr.Dataset(data, {"frame": [frame.name for frame in model.interfaces]})
