r"""Second-order motion of a beam whose strains are linear in the nodal unknowns, as the stiffness of its loads.

A section at x turns by the rotation vector :math:`\theta` and moves by u. To second order the strains of a
geometrically exact beam are, with e along the rod,

.. math:: \Gamma = u' - \theta\times e + \tfrac12\,\theta\times(\theta\times e) - \theta\times u', \qquad
          \kappa = \theta' - \tfrac12\,\theta\times\theta',

and fibres shorten by twist by :math:`\tfrac12 r^2\varphi'^2`. The internal force F and moment M of each load do work on
the quadratic parts: this is the load's geometric stiffness. An axial force shortens the axis by bending
(:math:`\tfrac12 N (v'^2+w'^2)`) and by twist, a torque and a lateral load couple bending and twist. The same forms are
the second-order motion of the loaded points, held at one frame: a force f does the work :math:`\tfrac12 f^T q^T G q`.

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
    """Forces and moments of m loads, mesh axes: at the Gauss points, (m, cells, points, 3), and at p points of the rod.

    at: positions of these p points along the rod [m].  point_force, point_moment: shape (m, p, 3).
    """

    force: np.ndarray
    moment: np.ndarray
    at: np.ndarray
    point_force: np.ndarray
    point_moment: np.ndarray


def second_order(mesh: xr.Dataset, x0: float, vectors: np.ndarray) -> SecondOrder:
    """Return integrals of the second-order motion of vectors, shape (ndof, n), held at x0 [m] along the rod."""
    beam = beams.assemble(mesh)
    body = sections.slices(mesh, beam)
    form = _stiffness_form(mesh, beam, vectors)

    def forms(loads: Loads) -> np.ndarray:
        return np.stack([form(*resultants) for resultants in _resultants(mesh, beam, loads, x0)])

    of_sections = sections.section_rotation(body, vectors)
    moments = of_sections - forms(_inertial(mesh, beam, body)).reshape(of_sections.shape)
    x = mesh["abscissa"].values[mesh["frame_node"].values]
    at_frames = np.stack([-forms(_unit(beam, position)) for position in x])
    return SecondOrder(moments[:3], moments[3], at_frames[:, :3], at_frames[:, 3:])


def _inertial(mesh: xr.Dataset, beam: Beam, body: sections.Slices) -> Loads:
    """Return loads rho X_k e_l of all slices, k from 0 to 3 (X_3 = 1), then l: the twelve of `SecondOrder`."""
    n = beam.basis.dx.size
    place = np.column_stack([body.position, np.ones(len(body.mass))])
    force = np.einsum("p,pk,li->klpi", body.mass, place, np.eye(3)).reshape(12, -1, 3)
    spread = np.concatenate([body.spread, np.zeros((len(body.mass), 3, 1))], axis=2)
    moment = np.cross(spread.transpose(2, 0, 1)[:, None], np.eye(3)[None, :, None]).reshape(12, -1, 3)
    if np.any(body.rigid_spread != body.spread):
        # sections that twist only take no moment from their own inertia but about the rod
        axis = beam.axes[:, 0]
        moment[:, :n] = (moment[:, :n] @ axis)[..., None] * axis
    at = mesh["abscissa"].values[mesh["lump_node"].values] if "lump_node" in mesh else np.zeros(0)
    shape = (12, *beam.basis.dx.shape, 3)
    lumped = moment[:, n:] + np.cross(body.offset[n:], force[:, n:])
    return Loads(force[:, :n].reshape(shape), moment[:, :n].reshape(shape), at, force[:, n:], lumped)


def _unit(beam: Beam, x: float) -> Loads:
    """Return unit forces, then unit moments, along the axes at a point of the rod."""
    empty = np.zeros((6, *beam.basis.dx.shape, 3))
    both = np.eye(6).reshape(6, 2, 3)
    return Loads(empty, empty, np.array([x]), both[:, :1], both[:, 1:])


def _resultants(mesh: xr.Dataset, beam: Beam, loads: Loads, x0: float) -> Any:
    """Yield internal force and moment of each load, shape (points, 3): loads beyond each Gauss point, seen from x0."""
    e, ends = beam.axes[:, 0], mesh["abscissa"].values[mesh["cell_node"].values]
    x = np.asarray(beam.basis.global_coordinates())[0]
    before = (ends.mean(axis=1) < x0)[:, None, None]
    middle = ends.mean(axis=1)
    parts = (
        (loads.force, loads.point_force),
        (
            loads.moment + np.cross(x[..., None] * e, loads.force),
            loads.point_moment + np.cross(loads.at[:, None] * e, loads.point_force),
        ),
    )
    sums = []
    for spread, lumped in parts:
        of_cell = spread.sum(axis=2)
        total = of_cell.sum(axis=1) + lumped.sum(axis=1)
        after = np.cumsum(of_cell[:, ::-1], axis=1)[:, ::-1] - of_cell
        after += np.einsum("cp,mpi->mci", loads.at > middle[:, None], lumped)
        inside = np.einsum("pq,mcqi->mcpi", BEYOND, spread)
        sums.append(after[:, :, None] + inside - before * total[:, None, None])
    force, about_start = sums
    moment = about_start - np.cross(x[..., None] * e, force)
    return ((F.reshape(-1, 3), M.reshape(-1, 3)) for F, M in zip(force, moment, strict=True))


def _stiffness_form(
    mesh: xr.Dataset, beam: Beam, vectors: np.ndarray
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return the geometric stiffness (n, n) of vectors, from internal force and moment at the points, (points, 3)."""
    e, n = beam.axes[:, 0], vectors.shape[1]

    def strains(*fields: Any) -> tuple[Any, ...]:
        strain, (_, v, w) = beam.kinematics.strains(*fields), beam.kinematics.section(*fields)[0]
        return strain["stretch"], v.grad[0], w.grad[0], strain["twist"], -1.0 * strain["bend_w"], strain["bend_v"]

    def at_gauss(matrix: Any) -> np.ndarray:
        values: np.ndarray = (matrix @ vectors).reshape(-1, 2, 3, n)
        return values

    theta = at_gauss(sections.motion(beam))[:, 1]
    slope, curvature = at_gauss(sections.fields_at_points(beam, strains)).transpose(1, 0, 2, 3)
    work = (0.5 * np.cross(theta, e, axisa=1, axisc=1) - slope).reshape(-1, n)
    bend, twist = 0.5 * curvature.reshape(-1, n), np.einsum("i,pij->pj", e, curvature)
    second, area = at_points(mesh, "second_moment"), at_points(mesh, "area")
    gyration, weight = ((second[..., 1] + second[..., 2]) / area).ravel(), beam.basis.dx.ravel()

    def form(force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        F, M = (
            np.cross((weight[:, None] * part)[:, None], theta, axisb=1, axisc=1).reshape(-1, n)
            for part in (force, moment)
        )
        half = F.T @ work - M.T @ bend
        fibres: np.ndarray = twist.T @ ((weight * gyration * (force @ e))[:, None] * twist)
        return half + half.T + 0.5 * (fibres + fibres.T)

    return form
