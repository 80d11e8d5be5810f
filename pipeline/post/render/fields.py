"""How the skin of a reduced body moves with each of its modal coordinates; and frequencies in words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.post.shapes.body_shape import surface

#: a small step of a coordinate, in which a skin moves linearly
SMALL = 1e-6


def hertz(frequency: float) -> str:
    """A frequency in words."""
    return "static" if not frequency > 0.0 else f"{frequency:.5g} Hz"


def fields_of(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Points of a body's skin at rest (point, 3), and how each moves per unit of each coordinate, (mode, point, 3)."""
    count = bundle.sizes["mode"]
    rest = surface(bundle, np.zeros(count))[0]
    return rest, np.array([(surface(bundle, SMALL * unit)[0] - rest) / SMALL for unit in np.eye(count)])


def linear_fields(bundle: xr.Dataset) -> np.ndarray:
    """How each point of a body's skin moves per unit of each coordinate, about its centre of mass; body axes."""
    centre = bundle["modal_first_moment"].values / float(bundle["mass"])
    fields: np.ndarray = fields_of(bundle)[1] - centre.T[:, None, :]
    return fields
