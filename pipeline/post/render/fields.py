"""How the skin of a reduced body moves with each of its modal coordinates; and frequencies in words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.post.render.mechanism import Flexible
from flexclear.pipeline.post.shapes.body_shape import surface

#: a small step of a coordinate, in which a skin moves linearly
SMALL = 1e-6


def hertz(frequency: float) -> str:
    """A frequency in words."""
    return "static" if not frequency > 0.0 else f"{frequency:.5g} Hz"


def linear_fields(body: Flexible, rest: np.ndarray) -> np.ndarray:
    """How each point of a flexible body's skin moves per unit of each coordinate, about its centre of mass.

    Shape (mode, point, 3); body axes.
    """
    bundle = body.bundle
    centre = bundle["modal_first_moment"].values / float(bundle["mass"])
    return np.array([field(bundle, k, rest) - centre[:, k] for k in range(bundle.sizes["mode"])])


def field(bundle: xr.Dataset, mode: int, rest: np.ndarray) -> np.ndarray:
    """How each point of a body's skin moves per unit of a modal coordinate, (point, 3); `rest`: the points at zero."""
    q = np.zeros(bundle.sizes["mode"])
    q[mode] = SMALL
    moved: np.ndarray = (surface(bundle, q)[0] - rest) / SMALL
    return moved
