r"""Second-order motion of a beam, and what its elastic energy is of more than second order.

A section tilts by b and twists by :math:`\varphi` about its tilted axis e; its centre moves by u. To second order a
geometrically exact beam has the strains, in axes of the tilted section,

.. math:: \Gamma = u' - b\times e + \tfrac12\,b\times(b\times e) - b\times u', \qquad
          \kappa = b' + \bigl(\varphi' - \tfrac12\,e\cdot(b\times b')\bigr)\,e ,

and fibres shorten by twist by :math:`\tfrac12 r^2\varphi'^2`. The internal force of each load does work on the
quadratic parts of :math:`\Gamma` and on the fibres: this is the load's geometric stiffness. The same forms are the
second-order motion of the loaded points, held at one frame.

Twist and bending couple in the elastic energy of :math:`\kappa`, whose bending the twisted section resists in its own
axes (`bodies.stiffening`). So the rod's inertia across its axis is complete, and a cantilever buckles sideways
by the moments of its own bending. The twisted section's axes for shear are those before the twist.

Source: Wallrapp & Schwertassek (1991), International Journal for Numerical Methods in Engineering 32, 1833-1850; Simo
(1985), Comput. Methods Appl. Mech. Eng. 49, 55-70 (strains); Houbolt & Brooks (1957), NACA Technical Note 3905 (twist).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from flexclear.structure.fe import beam as beams
from flexclear.structure.fe import slices as sections
from flexclear.structure.fe.beam import Beam, at_points
from flexclear.structure.fe.model import SecondOrder
from flexclear.structure.fe.section import POINTS, WEIGHTS

#: part of a slice's integral between each Gauss point of its cell and the cell's end: integrals of the polynomials
#: through the points
_POWERS = np.arange(len(POINTS))
BEYOND = ((1.0 - POINTS[:, None] ** (_POWERS + 1)) / (_POWERS + 1)) @ np.linalg.inv(np.vander(POINTS, increasing=True))
BEYOND /= WEIGHTS


@dataclass(frozen=True)
class Loads:
    """Forces of m loads, mesh axes: at the Gauss points, (m, cells, points, 3), and at p points of the rod.

    at: positions of these p points along the rod [m].  point_force: shape (m, p, 3).
    """

    force: np.ndarray
    at: np.ndarray
    point_force: np.ndarray


def second_order(mesh: xr.Dataset, x0: float, vectors: np.ndarray) -> SecondOrder:
    """Return integrals of the second-order motion of vectors, shape (ndof, n), held at x0 [m] along the rod."""
    beam = beams.assemble(mesh)
    body = sections.slices(mesh, beam)
    fields = _fields(beam, vectors)
    form = _stiffness_form(mesh, beam, fields)

    def forms(loads: Loads) -> np.ndarray:
        return np.stack([form(force) for force in _internal_forces(mesh, beam, loads, x0)])

    of_sections = sections.section_rotation(body, vectors, beam.axes[:, 0])
    moments = of_sections - forms(_inertial(mesh, beam, body)).reshape(of_sections.shape)
    nodes = mesh["frame_node"].values
    moved = np.stack([-forms(_unit(beam, x)) for x in mesh["abscissa"].values[nodes]])
    rotation = vectors[beams.node_dofs(nodes)].reshape(len(nodes), 6, -1)[:, 3:]
    twist, tilt = (
        np.einsum("i,fij->fj", beam.axes[:, 0], rotation),
        np.cross(rotation, beam.axes[:, 0], axisa=1, axisc=1),
    )
    half = 0.5 * np.einsum("fi,flj->flij", twist, tilt)
    return SecondOrder(moments[:3], moments[3], moved, half + half.swapaxes(2, 3), *_bending(mesh, beam, fields))


def _inertial(mesh: xr.Dataset, beam: Beam, body: sections.Slices) -> Loads:
    """Return loads rho X_k e_l of all slices, k from 0 to 3 (X_3 = 1), then l: the twelve of `SecondOrder`."""
    n = beam.basis.dx.size
    place = np.column_stack([body.position, np.ones(len(body.mass))])
    force = np.einsum("p,pk,li->klpi", body.mass, place, np.eye(3)).reshape(12, -1, 3)
    at = mesh["abscissa"].values[mesh["lump_node"].values] if "lump_node" in mesh else np.zeros(0)
    return Loads(force[:, :n].reshape(12, *beam.basis.dx.shape, 3), at, force[:, n:])


def _unit(beam: Beam, x: float) -> Loads:
    """Return unit forces along the axes at a point of the rod."""
    return Loads(np.zeros((3, *beam.basis.dx.shape, 3)), np.array([x]), np.eye(3)[:, None])


def _internal_forces(mesh: xr.Dataset, beam: Beam, loads: Loads, x0: float) -> np.ndarray:
    """Return the internal force of each load, shape (m, points, 3): loads beyond each Gauss point, seen from x0."""
    middle = mesh["abscissa"].values[mesh["cell_node"].values].mean(axis=1)
    of_cell = loads.force.sum(axis=2)
    total = of_cell.sum(axis=1) + loads.point_force.sum(axis=1)
    after = np.cumsum(of_cell[:, ::-1], axis=1)[:, ::-1] - of_cell
    after += np.einsum("cp,mpi->mci", loads.at > middle[:, None], loads.point_force)
    inside = np.einsum("pq,mcqi->mcpi", BEYOND, loads.force)
    force = after[:, :, None] + inside - (middle < x0)[:, None, None] * total[:, None, None]
    return force.reshape(len(force), -1, 3)


def _fields(beam: Beam, vectors: np.ndarray) -> np.ndarray:
    """Return rotations of sections, and rates of displacement and rotation along the rod, shape (3, points, 3, n).

    They are at the Gauss points, in axes of the rod.  vectors: shape (ndof, n).
    """

    def rates(*fields: Any) -> tuple[Any, ...]:
        strain, (_, v, w) = beam.kinematics.strains(*fields), beam.kinematics.section(*fields)[0]
        return strain["stretch"], v.grad[0], w.grad[0], strain["twist"], -1.0 * strain["bend_w"], strain["bend_v"]

    def at_gauss(matrix: Any) -> np.ndarray:
        values = (matrix @ vectors).reshape(-1, 2, 3, vectors.shape[1])
        turned: np.ndarray = np.einsum("ki,pakn->pain", beam.axes, values)
        return turned

    both = at_gauss(sections.fields_at_points(beam, rates))
    return np.stack([at_gauss(sections.section_motion(beam))[:, 1], both[:, 0], both[:, 1]])


def _stiffness_form(mesh: xr.Dataset, beam: Beam, fields: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the geometric stiffness (n, n) of fields, from the internal force at the points, (points, 3)."""
    e, n = np.array([1.0, 0.0, 0.0]), fields.shape[-1]
    tilt, twist = fields[0] * np.array([0.0, 1.0, 1.0])[:, None], fields[2, :, 0]
    work = (0.5 * np.cross(tilt, e, axisa=1, axisc=1) - fields[1]).reshape(-1, n)
    second, area = at_points(mesh, "second_moment"), at_points(mesh, "area")
    gyration, weight = ((second[..., 1] + second[..., 2]) / area).ravel(), beam.basis.dx.ravel()

    def form(force: np.ndarray) -> np.ndarray:
        weighted = weight[:, None] * force @ beam.axes
        half = np.cross(weighted[:, None], tilt, axisb=1, axisc=1).reshape(-1, n).T @ work
        fibres: np.ndarray = twist.T @ ((gyration * weighted[:, 0])[:, None] * twist)
        return half + half.T + 0.5 * (fibres + fibres.T)

    return form


def _bending(mesh: xr.Dataset, beam: Beam, fields: np.ndarray) -> list[np.ndarray]:
    """Return rotation and curvature of sections (stations, 3, n), and their stiffness times length (stations, 3, 3).

    Three stations of each cell integrate products of three of these fields exactly.
    """
    stiffness = beams.stiffness(mesh)
    matrix = np.zeros((*beam.basis.dx.shape, 3, 3))
    for k, name in enumerate(("twist", "bend_w", "bend_v")):
        matrix[..., k, k] = stiffness[name]
    matrix[..., 1, 2] = matrix[..., 2, 1] = -stiffness["bend_both"]
    points, weights = np.polynomial.legendre.leggauss(3)
    at_stations = np.vander(0.5 + 0.5 * points, len(POINTS)) @ np.linalg.inv(np.vander(POINTS, len(POINTS)))
    lengths = 0.5 * weights[:, None] * beam.basis.dx.sum(axis=1)[:, None, None]
    parts = (fields[0], fields[2], matrix)
    rotation, curvature, resisting = (
        np.einsum("sp,cp...->cs...", at_stations, part.reshape(*beam.basis.dx.shape, 3, -1)) for part in parts
    )
    return [part.reshape(-1, *part.shape[2:]) for part in (rotation, curvature, resisting * lengths[..., None])]
