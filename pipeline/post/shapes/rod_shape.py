"""Surface of a deformed rod out of its bundle; pure numbers, whoever draws them."""

from __future__ import annotations

import numpy as np
import xarray as xr

#: points drawn per element, and around the section; fine enough that no facet is seen at 1000 pixels
PER_CELL, AROUND = 6, 24


def centre_line(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Undeformed points [m], displacements [m] and section rotation vectors [rad] along the rod.

    bundle: schema BUNDLE with its cells in order from start to end.  q: modal coordinates
    [kg^0.5 m], shape (mode,).  scale: factor on the deformation.  Each result has shape (point, 3),
    body axes; bending is interpolated by cubics from the node rotations, twist linearly.
    """
    x = bundle.node_position.values
    u = scale * bundle.shape_translation.values @ q
    rotation = scale * bundle.shape_rotation.values @ q
    s = np.linspace(0.0, 1.0, PER_CELL, endpoint=False)[:, None]
    parts = [_element(x[[a, b]], u[[a, b]], rotation[[a, b]], s) for a, b in bundle.cell_node.values.astype(int)]
    last = int(bundle.cell_node.values[-1, 1])
    parts.append((x[[last]], u[[last]], rotation[[last]]))
    points, displacement, turn = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return points, displacement, turn


def rod_surface(bundle: xr.Dataset, q: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of the deformed rod_surface [m], shape (ring, around, 3), and the displacement size [m], (ring,).

    The sections stay plane and turn with the rod, so that torsion is seen too; both ends are capped.
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
    """From the centre line to the outline of each cell [m], shape (cell, around, 3)."""
    if "outline" in bundle:
        return np.asarray(bundle["outline"].values)
    return np.asarray(bundle.radius.values[:, None, None] * circle(points[-1] - points[0]))


def circle(axis: np.ndarray, around: int = AROUND) -> np.ndarray:
    """Points around an axis, at the distance one from it, the last one the first, shape (around + 1, 3)."""
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    phi = np.linspace(0.0, 2.0 * np.pi, around + 1)
    return np.outer(np.cos(phi), side) + np.outer(np.sin(phi), np.cross(axis, side))


def rod_scale_to(bundle: xr.Dataset, q: np.ndarray, fraction: float) -> float:
    """Factor that makes the largest displacement `share` of the rod's length; 1 for no displacement.

    Where the centre line does not move (torsion), the largest section rotation is made 1 rad.
    """
    points, displacement, turn = centre_line(bundle, q)
    length = float(np.linalg.norm(points[-1] - points[0]))
    largest = float(np.linalg.norm(displacement, axis=1).max())
    rotation = float(np.linalg.norm(turn, axis=1).max())
    if largest > 1e-3 * rotation * length:
        return fraction * length / largest
    return 1.0 / rotation if rotation > 0.0 else 1.0


def _element(
    x: np.ndarray, u: np.ndarray, rotation: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, displacements and rotations inside one element at local coordinates s in [0, 1)."""
    axis = x[1] - x[0]
    along = (u[1] - u[0]) @ axis / (axis @ axis) * axis
    slope = np.cross(rotation, axis) + along
    h00, h10 = 1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3
    h01, h11 = 3 * s**2 - 2 * s**3, s**3 - s**2
    displacement = h00 * u[0] + h10 * slope[0] + h01 * u[1] + h11 * slope[1]
    return x[0] + s * axis, displacement, (1 - s) * rotation[0] + s * rotation[1]
