"""Finite element model of a body, beam or solid, as reference conditions, reductions and integrals use it.

The functions that each kind of body has are listed by `Kind`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.numerics.rotations import skew
from flexclear.system.errors import InputError

#: directions of a frame's motion, in the order of all arrays of six
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: unknowns of a node, in the same order
DOFS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Interface:
    """A named frame of the body, with its motion as six functionals of the model's vector.

    position: origin, mesh frame [m], shape (3,).  rotation: R_MF, frame to mesh axes, shape (3, 3).
    motion: translation and rotation vector in mesh axes, shape (6, ndof). A frame with degrees of freedom of its own
    (beam node, RBE2) has one entry per row; a weighted mean (RBE3) has many.
    """

    name: str
    position: np.ndarray
    rotation: np.ndarray
    motion: sp.csr_array


@dataclass(frozen=True)
class Integrals:
    """Volume integrals over the undeformed body, for n vectors, in axes of the mesh frame."""

    mass: float  #: [kg]
    first_moment: np.ndarray  #: int rho X [kg m], shape (3,)
    second_moment: np.ndarray  #: int rho X X^T [kg m^2], shape (3, 3)
    modal_first_moment: np.ndarray  #: int rho S, shape (3, n)
    position_mode_moment: np.ndarray  #: int rho X_k S_lj, shape (3, 3, n)
    mode_mode_moment: np.ndarray  #: int rho S_ki S_lj, shape (3, 3, n, n)
    second_order_moment: np.ndarray  #: of sections that turn, see `SecondOrder`; zero for solids
    untilted_inertia: np.ndarray  #: of sections that twist but do not tilt [kg m^2], shape (3, 3)


@dataclass(frozen=True)
class SecondOrder:
    """Integrals of the displacements that are quadratic in n modal coordinates, 1/2 q^T G q, in axes of the mesh frame.

    They count where they multiply rigid motion, and forces at named frames.  All but the first are None where forces
    and accelerations do not stiffen the body, the last three but for rods.
    """

    second_order_moment: np.ndarray  #: int rho X_k G_l [kg], shape (3, 3, n, n)
    second_order_first_moment: np.ndarray | None = None  #: int rho G [kg/m], shape (3, n, n)
    frame_second_translation: np.ndarray | None = None  #: G of the frames' origins [1/m], shape (frames, 3, n, n)
    frame_second_rotation: np.ndarray | None = None  #: of their rotation vectors [1/m^2], shape (frames, 3, n, n)
    station_rotation: np.ndarray | None = None  #: of a rod's sections, in its axes [rad/m], shape (stations, 3, n)
    station_curvature: np.ndarray | None = None  #: rates of twist and bending [rad/m^2], shape (stations, 3, n)
    station_stiffness: np.ndarray | None = None  #: to them, times length [N m^3], shape (stations, 3, 3)


@dataclass(frozen=True)
class Families:
    """Rules by which modes are ordered in clusters, named and signed.

    names: families in the order that they take within a cluster of equal frequencies.
    local: the model's vector to components along the body's own axes, orthogonal, shape (ndof, ndof).
    member: family of each local component, index into names, shape (ndof,).
    main: local components that decide a mode's sign, by family, in node order.
    along: position of each local component along the body, 0 at its start, 1 at its end, shape (ndof,).
    """

    names: tuple[str, ...]
    local: sp.csr_array
    member: np.ndarray
    main: tuple[np.ndarray, ...]
    along: np.ndarray


@dataclass(frozen=True)
class Drawn:
    """Geometry of the body that is drawn: nodes, cells of one kind, and their motion.

    position: [m], shape (nodes, 3).  cell: shape (cells, corners).  radius: of line cells [m], else zero, (cells,).
    motion: of each node in turn along DIRECTIONS, shape (6 nodes, ndof).
    outline: of line cells that are not round: from the line to points around it [m], closed, (cells, points, 3).
    """

    position: np.ndarray
    cell: np.ndarray
    radius: np.ndarray
    motion: sp.csr_array
    outline: np.ndarray | None = None

    def nodal_motion(self, vectors: np.ndarray) -> np.ndarray:
        """Return the motion of the nodes along DIRECTIONS, shape (nodes, 6, n), for vectors of shape (ndof, n)."""
        shapes: np.ndarray = (self.motion @ vectors).reshape(-1, 6, vectors.shape[1])
        return shapes

    def at_rest(self) -> dict[str, np.ndarray]:
        """Return the drawn geometry at rest, by names of schema BUNDLE."""
        shown = {"node_position": self.position, "cell_node": self.cell, "radius": self.radius}
        return shown if self.outline is None else shown | {"outline": self.outline}


@dataclass(frozen=True)
class Model:
    """A free body: stiffness [N/m ...] and mass [kg ...] of its degrees of freedom, both (ndof, ndof).

    rigid: three translations, three rotations about the middle of the body, shape (ndof, 6); about an origin far away
        they would differ from translations by rounding only.
    position: of each degree of freedom [m], shape (ndof, 3).
    interfaces: every named frame.  ends: the two ends that a fixed-fixed condition clamps.
    integrate: volume integrals of vectors, shape (ndof, n); exact but for rounding.
    given: shapes that came with the body, shape (ndof, n); None where none did.
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    rigid: np.ndarray
    position: np.ndarray
    interfaces: tuple[Interface, ...]
    ends: tuple[Interface, ...]
    integrate: Callable[[np.ndarray], Integrals]
    families: Families
    drawn: Drawn
    given: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]

    def frames(self) -> dict[str, np.ndarray]:
        """Return position and rotation of the named frames at rest, by names of schema BUNDLE."""
        return {
            "frame_position": np.stack([frame.position for frame in self.interfaces]),
            "frame_rotation": np.stack([frame.rotation for frame in self.interfaces]),
        }


def interfaces(mesh: xr.Dataset, motion: Callable[[int], sp.csr_array]) -> tuple[Interface, ...]:
    """Return every named frame of a mesh; motion: maps a frame's number to its functionals, shape (6, ndof)."""
    rows = zip(*(mesh[name].values for name in ("frame", "frame_position", "frame_rotation")), strict=True)
    return tuple(Interface(str(name), x, R, motion(k)) for k, (name, x, R) in enumerate(rows))


def flatten_groups(groups: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the members of all groups, one after the other, and the group number of each."""
    members = [np.zeros(0, dtype=np.int64), *groups]
    return np.concatenate(members), np.repeat(np.arange(-1, len(members) - 1), [len(group) for group in members])


def selection(
    unknowns: np.ndarray, size: int, rows: np.ndarray | None = None, count: int | None = None
) -> sp.csr_array:
    """Return a matrix whose rows each select one unknown, shape (count, size); rows: which of them are not empty."""
    at = np.arange(len(unknowns)) if rows is None else rows
    return sp.csr_array((np.ones(len(unknowns)), (at, unknowns)), shape=(len(at) if count is None else count, size))


def node_motion(node: np.ndarray, component: np.ndarray, count: int) -> sp.csr_array:
    """Return the six motions of `count` nodes in turn, (6 count, ndof); zero where a node has no such unknown.

    node: node index of each unknown.  component: its index in DIRECTIONS, or more for internal unknowns.
    """
    own = np.flatnonzero(component < 6)
    return selection(own, len(node), 6 * node[own] + component[own], 6 * count)


def rigid_displacements(lever: np.ndarray) -> np.ndarray:
    """Return displacements of points per unit of a frame's six motions; lever: from frame to point [m], (..., 3)."""
    unit = np.broadcast_to(np.eye(3), (*lever.shape[:-1], 3, 3))
    return np.concatenate([unit, -skew(lever)], axis=-1)  # e x X = -X x e


def rigid_motions(positions: np.ndarray, component: np.ndarray, about: np.ndarray) -> np.ndarray:
    """Return three translations and three rotations about a point, shape (ndof, 6).

    positions: of each unknown [m], shape (ndof, 3).  component: its index in DIRECTIONS, (ndof,); 6 marks an unknown
    that rests in every rigid motion.  about: [m], shape (3,).
    """
    motion = np.zeros((len(positions), 7, 6))
    motion[:, range(6), range(6)] = 1.0
    motion[:, :3, :] = rigid_displacements(positions - about)
    return motion[np.arange(len(positions)), np.minimum(component, 6)]


def symmetric_part(matrix: sp.csr_array) -> sp.csr_array:
    """Return the symmetric part: eigensolvers need exact symmetry; rounding differs above and below the diagonal."""
    return sp.csr_array(0.5 * (matrix + matrix.T))


def rigid_motion_force(stiffness: sp.csr_array, rigid: np.ndarray) -> np.ndarray:
    """Return the largest force of each rigid motion, relative to the largest term of the sums, shape (6,)."""
    left: np.ndarray = np.abs(stiffness @ rigid).max(axis=0) / (abs(stiffness) @ np.abs(rigid)).max(axis=0)
    return left


def rows(interfaces: tuple[Interface, ...], size: int) -> sp.csr_array:
    """Return the motions of several frames on top of each other, shape (6 frames, size)."""
    if not interfaces:
        return sp.csr_array((0, size))
    return sp.csr_array(sp.vstack([frame.motion for frame in interfaces], format="csr"))


def own_dofs(held: sp.csr_array) -> np.ndarray | None:
    """Return the degree of freedom that each functional selects; None when a functional mixes several."""
    single = np.all(np.diff(held.indptr) == 1) and np.unique(held.indices).size == held.shape[0]
    return held.indices.astype(np.int64) if single else None


def no_stresses(mesh: xr.Dataset, model: Model, vectors: np.ndarray, stiffening: bool, held: Interface | None) -> None:
    """Return None: the stresses of the body are unknown; raise InputError where they are needed."""
    if stiffening:
        raise InputError("[body] stiffening", "matrices do not give the stresses of a body", "remove stiffening")


@dataclass(frozen=True)
class Kind:
    """Functions of one kind of body.

    build: the mesh dataset, from the recipe, the folder that its paths are relative to, and its name in messages.
    vtu: a VTU file of the mesh dataset, for ParaView.
    assemble: the model of the mesh dataset.
    words: one word for the motion of each mode, from its family and vectors of shape (ndof, n).
    cut: one segment of a mesh dataset; None for kinds without any.
    exact: closed-form frequencies [Hz] next to those of a reference condition, by variable, from the modes'
        families and the interfaces' names; None for kinds without any.
    second_order: second-order motion of vectors (ndof, n) that follows from stresses: without stiffening by forces and
        accelerations (False), or with it, held at an interface, if any; None where it has no such part.
    """

    build: Callable[[Any, Path, str], xr.Dataset]
    vtu: Callable[[xr.Dataset], bytes]
    assemble: Callable[[xr.Dataset], Model]
    words: Callable[[Model, list[str], np.ndarray], list[str]]
    cut: Callable[[xr.Dataset, Sequence[int]], xr.Dataset] | None = None
    exact: Callable[[xr.Dataset, str, list[str], tuple[str, ...]], dict[str, np.ndarray]] | None = None
    second_order: Callable[[xr.Dataset, Model, np.ndarray, bool, Interface | None], SecondOrder | None] = no_stresses
