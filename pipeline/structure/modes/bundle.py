"""Stage 3: everything that the dynamics needs of a flexible body, and nothing of its finite elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import BUNDLE, DEFICITS, conform
from flexclear.pipeline.structure.fe.model import Integrals, Model
from flexclear.pipeline.structure.kinds.kind import of_mesh


def build(mesh: xr.Dataset, modes: xr.Dataset, extra: Mapping[str, Any] | None = None) -> xr.Dataset:
    """The reduced bundle (schema BUNDLE) of a mesh and its modes.

    extra: further variables, as those of stress recovery.

    The body frame is the mesh frame when nothing deforms; how it follows the deformation is what the
    reference condition of the modes says.  Units per modal coordinate: q in m, for modal masses of 1 kg.
    """
    model = of_mesh(mesh).assemble(mesh)
    vectors = modes["vector"].values
    data = _integrals(model.integrate(vectors)) | _frames(model, vectors) | _drawn(model, vectors)
    omega = 2.0 * np.pi * modes["frequency"].values
    data["modal_stiffness"] = (("mode", "mode2"), np.diag(omega**2))
    data["frequency"] = (("mode",), modes["frequency"].values)
    lacks = {name: modes[name] for name in DEFICITS}
    return conform(
        xr.Dataset(data | lacks | dict(extra or {}), coords={"frame": modes["frame"].values}), BUNDLE, **modes.attrs
    )


def _integrals(integrals: Integrals) -> dict[str, Any]:
    square = ("mode", "mode2")
    return {
        "mass": ((), integrals.mass),
        "first_moment": (("axis",), integrals.first_moment),
        "second_moment": (("axis", "axis2"), integrals.second_moment),
        "modal_first_moment": (("axis", "mode"), integrals.modal_first_moment),
        "position_mode_moment": (("axis", "axis2", "mode"), integrals.position_mode_moment),
        "mode_mode_moment": (("axis", "axis2", *square), integrals.mode_mode_moment),
        "modal_mass": (square, np.einsum("kkij->ij", integrals.mode_mode_moment)),
    }


def _frames(model: Model, vectors: np.ndarray) -> dict[str, Any]:
    moved = np.stack([frame.motion @ vectors for frame in model.interfaces])
    return {
        "frame_position": (("frame", "axis"), np.stack([frame.position for frame in model.interfaces])),
        "frame_rotation": (("frame", "axis", "axis2"), np.stack([frame.rotation for frame in model.interfaces])),
        "frame_translation_shape": (("frame", "axis", "mode"), moved[:, :3]),
        "frame_rotation_shape": (("frame", "axis", "mode"), moved[:, 3:]),
    }


def _drawn(model: Model, vectors: np.ndarray) -> dict[str, Any]:
    drawn, n = model.drawn, vectors.shape[1]
    return {
        "shape_translation": (("node", "axis", "mode"), (drawn.translation @ vectors).reshape(-1, 3, n)),
        "shape_rotation": (("node", "axis", "mode"), (drawn.rotation @ vectors).reshape(-1, 3, n)),
        **drawn.variables(),
    }
