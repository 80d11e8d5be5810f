"""Surface of a deformed body out of its bundle, rod or solid; pure numbers, whoever draws them.

A bundle draws its body by cells of one kind: two corners are a rod's, three or four a face of a solid's boundary,
and one a node of a body that is known by matrices alone.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import von_mises
from flexclear.pipeline.post.shapes import rod_shape


def is_rod(bundle: xr.Dataset) -> bool:
    """Whether the body is drawn as a rod."""
    return bundle.sizes["corner"] == 2


def has_edges(bundle: xr.Dataset) -> bool:
    """Whether the surface has edges, and is not round all over."""
    return not is_rod(bundle) or "outline" in bundle


def surface(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of the deformed surface [m], shape (point, 3), and the size of their displacement [m], (point,).

    bundle: schema BUNDLE.  q: modal coordinates [kg^0.5 m], shape (mode,).  scale: factor on the deformation.
    Body axes; of a rod the displacement is that of the section's centre.
    """
    if is_rod(bundle):
        rings, size = rod_shape.rod_surface(bundle, q, scale)
        return rings.reshape(-1, 3), np.repeat(size, rings.shape[1])
    displacement = scale * bundle.shape_translation.values @ q
    return bundle.node_position.values + displacement, np.linalg.norm(displacement, axis=1)


def faces(bundle: xr.Dataset) -> np.ndarray:
    """Corners of the faces between the points of `surface`, shape (face, corners); of one corner for bare nodes."""
    if not is_rod(bundle):
        return bundle.cell_node.values.astype(int)
    around = rod_shape.AROUND + 1
    rings = rod_shape.PER_CELL * bundle.sizes["cell"] + 3
    index = np.arange(rings * around).reshape(rings, around)
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    return np.stack(corners, axis=-1).reshape(-1, 4)


def scale_to(bundle: xr.Dataset, q: np.ndarray, fraction: float) -> float:
    """Factor that makes the largest displacement `share` of the body's length; 1 for no displacement."""
    if is_rod(bundle):
        return rod_shape.rod_scale_to(bundle, q, fraction)
    largest = float(surface(bundle, q)[1].max())
    return fraction * float(box(bundle)[1][0]) / largest if largest > 0.0 else 1.0


def box(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Principal directions of the undeformed nodes, rows of shape (3, 3), and their extents [m], longest first."""
    x = bundle.node_position.values
    axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=True)[2]
    extent = np.ptp(x @ axes.T, axis=0)
    order = np.argsort(-extent, kind="stable")
    return axes[order], extent[order]


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
    return fields_of(bundle)[1] - centre.T[:, None, :]


def stress_recorded(run: xr.Dataset) -> list[str]:
    """Bodies whose stress a run has."""
    return list(dict.fromkeys(map(str, run["gauge_body"].values))) if "von_mises_stress" in run else []


def stress_of_bodies(run: xr.Dataset) -> np.ndarray:
    """Von Mises stress of whole bodies, at their nodes or sections where it is largest [Pa], shape (time, body)."""
    return np.asarray(run["von_mises_stress"].values[:, run["gauge"].values == run["gauge_body"].values])


def largest_stress(run: xr.Dataset) -> float:
    """Largest of these over the run [Pa]."""
    return float(stress_of_bodies(run).max())


def stress_on_surface(run: xr.Dataset, bundle: xr.Dataset, body: str, step: int) -> np.ndarray:
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
