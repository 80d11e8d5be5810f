"""Stage 3: everything that the dynamics needs of a flexible body, and nothing of its finite elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.schema import BUNDLE, DEFICITS, conform
from flexclear.pipeline.structure.kinds.kind import of_mesh


def build(mesh: xr.Dataset, modes: xr.Dataset, extra: Mapping[str, Any] | None = None) -> xr.Dataset:
    """The reduced bundle (schema BUNDLE) of a mesh and its modes.

    extra: further variables, as those of stress recovery.

    The body frame is the mesh frame when nothing deforms; how it follows the deformation is what the
    reference condition of the modes says.  Units per modal coordinate: q in m, for modal masses of 1 kg.
    """
    model = of_mesh(mesh).assemble(mesh)
    vectors = modes["vector"].values
    drawn = model.drawn.moved(vectors)
    integrals = model.integrate(vectors)
    moved = np.stack([frame.motion @ vectors for frame in model.interfaces])
    values = {
        **vars(integrals),
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
    data |= {name: modes[name] for name in DEFICITS} | dict(extra or {})
    return conform(xr.Dataset(data, coords={"frame": modes["frame"].values}), BUNDLE, **modes.attrs)
