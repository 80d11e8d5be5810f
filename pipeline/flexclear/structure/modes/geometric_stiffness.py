r"""Geometric stiffness of a straight beam, as quadratic forms in its modal coordinates.

A bent axis of constant length moves the section at x towards the body frame, held at x0, by
:math:`\tfrac12 q^T B(x) q` along x,

.. math:: B_{ij}(x) = -\int_{x_0}^{x} (v_i' v_j' + w_i' w_j')\,ds .

An axial force N(s) does the work :math:`\tfrac12\int N (v'^2 + w'^2)\,ds` on it, so each load has its stiffness matrix:
an axial acceleration a of the frame :math:`a\int\rho A B\,dx`, turning at omega
:math:`-(\omega_y^2+\omega_z^2)\int\rho A\,x B\,dx`, a force N on the frame at x_k :math:`-N B(x_k)`. Turning about x
does not load the axis. The loads' own axial forces N(s), the mass and first moment of the rod beyond s,
turn the double integrals into single ones.

Source: Wallrapp & Schwertassek (1991), International Journal for Numerical Methods in Engineering 32, 1833-1850.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.structure.fe import beam as beams
from flexclear.structure.fe.section import POINTS
from flexclear.system.errors import InputError


def variables(mesh: xr.Dataset, modes: xr.Dataset) -> dict[str, Any]:
    """Return the bundle's optional shortening variables of a beam mesh (schema MESH) and its modes (schema MODES).

    The body frame is held at the first of the modes' interfaces (x0); without interfaces, at the lower end.
    Raises InputError for a body whose shortening is not along x of its frame, or not given by its axis alone.
    """
    _require_plain_rod(mesh)
    x, vectors = mesh["abscissa"].values, modes["vector"].values
    ends = np.sort(x[mesh["cell_node"].values], axis=1)
    s = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * POINTS
    node = {str(n): int(k) for n, k in zip(mesh["frame"].values, mesh["frame_node"].values, strict=True)}
    interfaces = modes.attrs["interfaces"].split()
    x0 = x[node[interfaces[0]]] if interfaces else x.min()
    line = mesh["density"].values * mesh["area"].values
    first, second = (-_form(mesh, vectors, _beyond(ends, s, x0, line, power)) for power in (0, 1))
    at_frames = [-_form(mesh, vectors, _between(ends, x0, x[k])) for k in mesh["frame_node"].values]
    square = ("mode", "mode2")
    return {
        "shortening_first_moment": (square, first),
        "shortening_second_moment": (square, second),
        "frame_shortening": (("frame", *square), np.array(at_frames)),
    }


def _require_plain_rod(mesh: xr.Dataset) -> None:
    where, remedy = "[body] stiffening", "remove stiffening, or describe the body by a straight rod along x"
    if "abscissa" not in mesh:
        raise InputError(where, "shortening is available for beams only", remedy)
    if not np.allclose(mesh["rod_rotation"].values, np.eye(3), rtol=0.0, atol=1e-12):
        raise InputError(where, "the rod does not lie along x of its mesh frame", remedy)
    if "area_profile" in mesh or "lump_mass" in mesh:
        raise InputError(where, "the rod is tapered or carries lumped masses", remedy)


def _form(mesh: xr.Dataset, vectors: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return int weight (v'_i v'_j + w'_i w'_j) dx, exactly symmetric; weight: per cell or per Gauss point."""
    result = vectors.T @ (beams.geometric_stiffness(mesh, weight) @ vectors)
    return 0.5 * (result + result.T)


def _between(ends: np.ndarray, x0: float, x: float) -> np.ndarray:
    """Return the sign of the direction from x0 to x for cells between them, else zero, shape (cells, 1)."""
    middle = ends.mean(axis=1)
    inside = (middle > min(x0, x)) & (middle < max(x0, x))
    return (np.sign(x - x0) * inside)[:, None]


def _beyond(ends: np.ndarray, s: np.ndarray, x0: float, line: np.ndarray, power: int) -> np.ndarray:
    """Return int rho A x^power dx over the rod beyond s, seen from x0; negative where s lies before x0.

    ends: of each cell, ascending, (cells, 2).  s: positions in the cells, (cells, points).  line: rho A of each cell.
    """
    k = power + 1
    whole = line * (ends[:, 1] ** k - ends[:, 0] ** k) / k
    after = np.array([whole[ends[:, 0] > e[0]].sum() for e in ends])[:, None]
    before = np.array([whole[ends[:, 0] < e[0]].sum() for e in ends])[:, None]
    to_end = line[:, None] * (ends[:, 1:] ** k - s**k) / k
    from_start = line[:, None] * (s**k - ends[:, :1] ** k) / k
    return np.where(ends.mean(axis=1)[:, None] > x0, after + to_end, -(before + from_start))
