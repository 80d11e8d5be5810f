"""What reference conditions, reductions and inertia integrals need of a finite element model, beam or solid."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import skew

#: directions of a frame's motion, in the order of every six
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: the same of a node's unknowns
DOFS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Interface:
    """A named frame of the body and its motion as six functionals of the model's vector.

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
    """Volume integrals over the undeformed body; axes of the mesh frame, n vectors."""

    mass: float  #: [kg]
    first_moment: np.ndarray  #: int rho X [kg m], shape (3,)
    second_moment: np.ndarray  #: int rho X X^T [kg m^2], shape (3, 3)
    modal_first_moment: np.ndarray  #: int rho S, shape (3, n)
    position_mode_moment: np.ndarray  #: int rho X_k S_lj, shape (3, 3, n)
    mode_mode_moment: np.ndarray  #: int rho S_ki S_lj, shape (3, 3, n, n)


@dataclass(frozen=True)
class Families:
    """How modes are distinguished, named and signed.

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
    """What is drawn of the body: nodes, cells of one kind, and their motion.

    position: [m], shape (nodes, 3).  cell: shape (cells, corners).  radius: of line cells [m], else zero, (cells,).
    motion: of each node in turn along DIRECTIONS, shape (6 nodes, ndof).
    outline: of line cells that are not round: from the line to points around it [m], closed, (cells, points, 3).
    """

    position: np.ndarray
    cell: np.ndarray
    radius: np.ndarray
    motion: sp.csr_array
    outline: np.ndarray | None = None

    def moved(self, vectors: np.ndarray) -> np.ndarray:
        """Motion of the nodes along DIRECTIONS, shape (nodes, 6, n), for vectors of shape (ndof, n)."""
        shapes: np.ndarray = (self.motion @ vectors).reshape(-1, 6, vectors.shape[1])
        return shapes

    def at_rest(self) -> dict[str, np.ndarray]:
        """What is drawn of the body at rest, by names of schema BUNDLE."""
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

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]

    def frames(self) -> dict[str, np.ndarray]:
        """Places of the named frames at rest, by names of schema BUNDLE."""
        return {
            "frame_position": np.stack([frame.position for frame in self.interfaces]),
            "frame_rotation": np.stack([frame.rotation for frame in self.interfaces]),
        }


def interfaces(mesh: xr.Dataset, motion: Callable[[int], sp.csr_array]) -> tuple[Interface, ...]:
    """Every named frame of a mesh; motion: functionals of a frame by its number."""
    rows = zip(*(mesh[name].values for name in ("frame", "frame_position", "frame_rotation")), strict=True)
    return tuple(Interface(str(name), x, R, motion(k)) for k, (name, x, R) in enumerate(rows))


def grouped(groups: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Members of all groups, one after the other, and the number of the group of each."""
    members = [np.zeros(0, dtype=np.int64), *groups]
    return np.concatenate(members), np.repeat(np.arange(-1, len(members) - 1), [len(group) for group in members])


def selection(
    unknowns: np.ndarray, size: int, rows: np.ndarray | None = None, count: int | None = None
) -> sp.csr_array:
    """Rows that are one unknown of a vector each, shape (count, size); rows: which of them are not empty."""
    at = np.arange(len(unknowns)) if rows is None else rows
    return sp.csr_array((np.ones(len(unknowns)), (at, unknowns)), shape=(len(at) if count is None else count, size))


def node_motion(node: np.ndarray, component: np.ndarray, count: int) -> sp.csr_array:
    """The six motions of `count` nodes in turn, shape (6 count, ndof), zero where a node has no such unknown.

    node: index of that of each unknown.  component: index in DIRECTIONS, or more.
    """
    own = np.flatnonzero(component < 6)
    return selection(own, len(node), 6 * node[own] + component[own], 6 * count)


def carried(lever: np.ndarray) -> np.ndarray:
    """Displacement of points that follow a frame per unit of its six motions; lever: from there [m], (..., 3)."""
    unit = np.broadcast_to(np.eye(3), (*lever.shape[:-1], 3, 3))
    return np.concatenate([unit, -skew(lever)], axis=-1)  # e x X = -X x e


def rigid_motions(positions: np.ndarray, component: np.ndarray, about: np.ndarray) -> np.ndarray:
    """Three translations, three rotations about a point, shape (ndof, 6).

    positions: of each unknown [m], shape (ndof, 3).  component: its index in DIRECTIONS, shape (ndof,); else an unknown
    that rests in every rigid motion.  about: [m], shape (3,).
    """
    motion = np.zeros((len(positions), 7, 6))
    motion[:, range(6), range(6)] = 1.0
    motion[:, :3, :] = carried(positions - about)
    return motion[np.arange(len(positions)), np.minimum(component, 6)]


def symmetric(matrix: sp.csr_array) -> sp.csr_array:
    """The symmetric part: rounding differs above and below the diagonal, and eigensolvers expect exact symmetry."""
    return sp.csr_array(0.5 * (matrix + matrix.T))


def rows(interfaces: tuple[Interface, ...], size: int) -> sp.csr_array:
    """Motions of several frames on top of each other, shape (6 frames, size)."""
    if not interfaces:
        return sp.csr_array((0, size))
    return sp.csr_array(sp.vstack([frame.motion for frame in interfaces], format="csr"))


def own_dofs(held: sp.csr_array) -> np.ndarray | None:
    """The degrees of freedom that functionals select, one each; None when some functional mixes several."""
    single = np.all(np.diff(held.indptr) == 1) and np.unique(held.indices).size == held.shape[0]
    return held.indices.astype(np.int64) if single else None
