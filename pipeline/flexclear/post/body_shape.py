"""Surface of a deformed body from its bundle, rod or solid; pure numbers for any drawing library.

A bundle draws its body by cells of one kind: two corners are a rod's, three or four a face of a solid's boundary, and
one a node of a body that is known by matrices alone.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.numerics.rotations import von_mises

#: points drawn per element, and around the section; fine enough that no facet is visible at 1000 pixels
PER_CELL, AROUND = 6, 24


def is_rod(bundle: xr.Dataset) -> bool:
    """Return True when the body is drawn as a rod."""
    return bundle.sizes["corner"] == 2


def has_edges(bundle: xr.Dataset) -> bool:
    """Return True when the surface has edges, unlike that of a round rod."""
    return not is_rod(bundle) or "outline" in bundle


def surface(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the deformed surface [m], shape (point, 3), and the size of their displacement [m], (point,).

    bundle: schema BUNDLE.  q: modal coordinates [kg^0.5 m], shape (mode,).  scale: factor on the deformation. Body
    axes; for a rod the displacement is that of the section's centre.
    """
    if is_rod(bundle):
        rings, size = rod_surface(bundle, q, scale)
        return rings.reshape(-1, 3), np.repeat(size, rings.shape[1])
    displacement = scale * bundle.shape_translation.values @ q
    return bundle.node_position.values + displacement, np.linalg.norm(displacement, axis=1)


def faces(bundle: xr.Dataset) -> np.ndarray:
    """Return corners of the faces between the points of `surface`, shape (face, corners); one corner for bare nodes."""
    if not is_rod(bundle):
        return bundle.cell_node.values.astype(int)
    around = AROUND + 1
    rings = PER_CELL * bundle.sizes["cell"] + 3
    index = np.arange(rings * around).reshape(rings, around)
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    return np.stack(corners, axis=-1).reshape(-1, 4)


def scale_to(bundle: xr.Dataset, q: np.ndarray, fraction: float) -> float:
    """Return the factor that makes the largest displacement this fraction of the body's length; 1 without displacement.

    Where the centre line of a rod does not move (torsion), the largest section rotation is made 1 rad.
    """
    length, largest, rotation = float(box(bundle)[1][0]), float(surface(bundle, q)[1].max()), 0.0
    if is_rod(bundle):
        points, _, turn = centre_line(bundle, q)
        length, rotation = float(np.linalg.norm(points[-1] - points[0])), float(np.linalg.norm(turn, axis=1).max())
    if largest > 1e-3 * rotation * length:
        return fraction * length / largest
    return 1.0 / rotation if rotation > 0.0 else 1.0


def box(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return principal directions of the undeformed nodes, rows, (3, 3), and their extents [m], longest first."""
    x = bundle.node_position.values
    axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=True)[2]
    extent = np.ptp(x @ axes.T, axis=0)
    order = np.argsort(-extent, kind="stable")
    return axes[order], extent[order]


#: small step of a coordinate, for which a skin moves linearly
SMALL = 1e-6


def format_frequency(frequency: float) -> str:
    """Format a frequency."""
    return "static" if not frequency > 0.0 else f"{frequency:.5g} Hz"


def fields_of(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a body's skin at rest (point, 3), and their derivatives by each coordinate, (mode, point, 3)."""
    count = bundle.sizes["mode"]
    rest = surface(bundle, np.zeros(count))[0]
    return rest, np.array([(surface(bundle, SMALL * unit)[0] - rest) / SMALL for unit in np.eye(count)])


def linear_fields(bundle: xr.Dataset) -> np.ndarray:
    """Return derivatives of a body's skin points by each coordinate, relative to its centre of mass; body axes."""
    centre = bundle["modal_first_moment"].values / float(bundle["mass"])
    return fields_of(bundle)[1] - centre.T[:, None, :]


def bodies_with_stress(run: xr.Dataset) -> list[str]:
    """Return the bodies whose stress a run records."""
    return list(dict.fromkeys(map(str, run["gauge_body"].values))) if "von_mises_stress" in run else []


def stress_of_bodies(run: xr.Dataset) -> np.ndarray:
    """Return the largest von Mises stress of whole bodies, over their nodes or sections [Pa], shape (time, body)."""
    return np.asarray(run["von_mises_stress"].values[:, run["gauge"].values == run["gauge_body"].values])


def largest_stress(run: xr.Dataset) -> float:
    """Return the largest stress of any body over the run [Pa]."""
    return float(stress_of_bodies(run).max())


def stress_on_surface(run: xr.Dataset, bundle: xr.Dataset, body: str, step: int) -> np.ndarray:
    """Return von Mises stress [Pa] at the points of `surface`, of one body at one output, shape (point,).

    For a rod it is the largest of the section, linear between sections.
    """
    if not is_rod(bundle):
        factor = run["stress_factor"].values[step, run["stress_field_body"].values == body]
        return von_mises(bundle["stress_field"].values @ factor)
    peaks = run["peak_von_mises_stress"].values[step, run["section_body"].values == body].reshape(-1, 2)
    s = np.linspace(0.0, 1.0, PER_CELL, endpoint=False)
    along = np.append(peaks[:, :1] * (1.0 - s) + peaks[:, 1:] * s, peaks[-1, 1])
    return np.repeat(np.concatenate([along[:1], along, along[-1:]]), AROUND + 1)


def centre_line(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return undeformed points [m], displacements [m] and section rotation vectors [rad] along the rod.

    bundle: schema BUNDLE with its cells in order from start to end.  q: modal coordinates [kg^0.5 m], shape (mode,).
    scale: factor on the deformation.  Each result has shape (point, 3), body axes; bending is interpolated by cubics
    from the node rotations, twist linearly.
    """
    known = bundle.variables
    x = known["node_position"].values
    u = scale * known["shape_translation"].values @ q
    rotation = scale * known["shape_rotation"].values @ q
    cells = known["cell_node"].values.astype(int)
    s = np.linspace(0.0, 1.0, PER_CELL, endpoint=False)[:, None]
    parts = [_element(x[[a, b]], u[[a, b]], rotation[[a, b]], s) for a, b in cells]
    last = cells[-1, 1]
    parts.append((x[[last]], u[[last]], rotation[[last]]))
    points, displacement, turn = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return points, displacement, turn


def rod_surface(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the deformed rod surface [m], shape (ring, around, 3), and the displacement size [m], (ring,).

    The sections stay plane and turn with the rod, so that torsion is visible too; both ends are capped.
    """
    points, displacement, turn = centre_line(bundle, q, scale)
    cells = _spokes(bundle, points)
    spokes = np.concatenate([np.repeat(cells, PER_CELL, axis=0), cells[-1:]])
    turned = spokes + np.cross(turn[:, None, :], spokes)
    # a large drawn rotation stretches linearised spokes: keep the section's size
    turned *= np.linalg.norm(spokes, axis=-1, keepdims=True) / np.linalg.norm(turned, axis=-1, keepdims=True)
    centres = (points + displacement)[:, None, :]
    rings = centres + turned
    # flat caps: the first and last rings, shrunk to their centres
    rings = np.concatenate([np.repeat(centres[:1], AROUND + 1, 1), rings, np.repeat(centres[-1:], AROUND + 1, 1)])
    size = np.linalg.norm(displacement, axis=-1)
    return rings, np.concatenate([size[:1], size, size[-1:]])


def _spokes(bundle: xr.Dataset, points: np.ndarray) -> np.ndarray:
    """Return vectors from the centre line to the outline of each cell [m], shape (cell, around, 3)."""
    if "outline" in bundle:
        return np.asarray(bundle["outline"].values)
    return np.asarray(bundle.radius.values[:, None, None] * circle(points[-1] - points[0]))


def circle(axis: np.ndarray, around: int = AROUND) -> np.ndarray:
    """Return points of a unit circle about an axis, the last one the first, shape (around + 1, 3)."""
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    phi = np.linspace(0.0, 2.0 * np.pi, around + 1)
    return np.outer(np.cos(phi), side) + np.outer(np.sin(phi), np.cross(axis, side))


def _element(
    x: np.ndarray, u: np.ndarray, rotation: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, displacements and rotations inside one element at local coordinates s in [0, 1)."""
    axis = x[1] - x[0]
    along = (u[1] - u[0]) @ axis / (axis @ axis) * axis
    slope = np.cross(rotation, axis) + along
    h00, h10 = 1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3
    h01, h11 = 3 * s**2 - 2 * s**3, s**3 - s**2
    displacement = h00 * u[0] + h10 * slope[0] + h01 * u[1] + h11 * slope[1]
    return x[0] + s * axis, displacement, (1 - s) * rotation[0] + s * rotation[1]
