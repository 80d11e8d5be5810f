"""Von Mises stress on the drawn surface of a flexible body, out of its bundle and a run that records stress."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import von_mises
from flexclear.pipeline.post.shapes import rod_shape
from flexclear.pipeline.post.shapes.body_shape import is_rod


def recorded(run: xr.Dataset) -> list[str]:
    """Bodies whose stress a run has."""
    return list(dict.fromkeys(map(str, run["gauge_body"].values))) if "von_mises_stress" in run else []


def of_bodies(run: xr.Dataset) -> np.ndarray:
    """Von Mises stress of whole bodies, at their nodes or sections where it is largest [Pa], shape (time, body)."""
    return np.asarray(run["von_mises_stress"].values[:, run["gauge"].values == run["gauge_body"].values])


def largest(run: xr.Dataset) -> float:
    """Largest of these over the run [Pa]."""
    return float(of_bodies(run).max())


def on_surface(run: xr.Dataset, bundle: xr.Dataset, body: str, step: int) -> np.ndarray:
    """Von Mises stress [Pa] at the points of `body_shape.surface`, of one body at one output, shape (point,).

    Of a rod the largest of the section, linear between sections.
    """
    if not is_rod(bundle):
        factor = run["stress_factor"].values[step, run["stress_field_body"].values == body]
        return von_mises(bundle["stress_field"].values @ factor)
    peaks = run["peak_von_mises_stress"].values[step, run["section_body"].values == body].reshape(-1, 2)
    s = np.linspace(0.0, 1.0, rod_shape.PER_CELL, endpoint=False)
    along = np.append(peaks[:, :1] * (1.0 - s) + peaks[:, 1:] * s, peaks[-1, 1])
    return np.repeat(np.concatenate([along[:1], along, along[-1:]]), rod_shape.AROUND + 1)
