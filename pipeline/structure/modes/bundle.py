"""Stage 3: everything that the dynamics needs of a flexible body, and nothing of its finite elements."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pipeline.core.artifacts.schema import BUNDLE, conform
from pipeline.structure.fe import beam as beams
from pipeline.structure.modes import geometric_stiffness
from pipeline.structure.modes.inertia_integrals import integrate

ATTRIBUTES = ("title", "reference", "count", "interfaces", "section", "inertia_section", "source")


def build(mesh: xr.Dataset, modes: xr.Dataset) -> xr.Dataset:
    """The reduced bundle (schema BUNDLE) of a mesh and its modes.

    The body frame is the mesh frame when nothing deforms; how it follows the deformation is what the
    reference condition of the modes says.  Units per modal coordinate: q in sqrt(kg) m.
    """
    beam = beams.assemble(mesh)
    shape = modes["shape"].values
    n = shape.shape[-1]
    integrals = integrate(mesh, beam, shape.reshape(-1, n))
    square = ("mode", "mode2")
    nodes = mesh["frame_node"].values
    translation, rotation = shape[:, :3], shape[:, 3:]
    omega = 2.0 * np.pi * modes["frequency"].values
    data: dict[str, Any] = {
        "mass": ((), integrals.mass),
        "first_moment": (("axis",), integrals.first_moment),
        "second_moment": (("axis", "axis2"), integrals.second_moment),
        "modal_first_moment": (("axis", "mode"), integrals.modal_first_moment),
        "position_mode_moment": (("axis", "axis2", "mode"), integrals.position_mode_moment),
        "mode_mode_moment": (("axis", "axis2", *square), integrals.mode_mode_moment),
        "modal_mass": (square, np.einsum("kkij->ij", integrals.mode_mode_moment)),
        "modal_stiffness": (square, np.diag(omega**2)),
        "frequency": (("mode",), modes["frequency"].values),
        "frame_position": (("frame", "axis"), mesh["frame_position"].values),
        "frame_rotation": (("frame", "axis", "axis2"), mesh["frame_rotation"].values),
        "frame_translation_shape": (("frame", "axis", "mode"), translation[nodes]),
        "frame_rotation_shape": (("frame", "axis", "mode"), rotation[nodes]),
        "node_position": (("node", "axis"), mesh["node_position"].values),
        "cell": (("cell", "corner"), mesh["cell"].values),
        "shape_translation": (("node", "axis", "mode"), translation),
        "shape_rotation": (("node", "axis", "mode"), rotation),
        # drawn as a round rod of the true area, whatever the section
        "radius": (("cell",), np.sqrt(mesh["area"].values / np.pi)),
    }
    data |= geometric_stiffness.variables(mesh, beam, shape.reshape(-1, n), tuple(modes.attrs["interfaces"].split()))
    attributes = {name: modes.attrs[name] for name in ATTRIBUTES}
    return conform(xr.Dataset(data, coords={"frame": mesh["frame"].values}), BUNDLE, **attributes)
