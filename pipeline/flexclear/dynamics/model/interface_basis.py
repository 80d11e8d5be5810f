"""Interface bases of the flexible bodies: combinations of modes that move, or hold still, the frames a scene uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.components import coupled_frames
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.numerics.rotations import index_of_largest

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.model.arrays import Arrays

#: a shape or moment below this fraction of the largest of its kind is rounding, not coupling
NO_COUPLING = 1e-13
#: products of inertia of two modes of unit modal mass below this are rounding: each is a sum over all elements
UNCOUPLED = 1e-11


@dataclass(frozen=True)
class InterfaceBasis:
    """Orthogonal T, q = T p, (mode, shape); `held`: number of the first shapes, which move no frame."""

    matrix: np.ndarray
    held: int

    @property
    def moving(self) -> np.ndarray:
        """Columns of T that move frames, shape (mode, moving shapes)."""
        return self.matrix[:, self.held :]

    def entries(self) -> list[tuple[int, int]]:
        """Return (mode, shape) of the nonzero entries of T, shape after shape."""
        return [(int(i), int(j)) for j, i in zip(*np.nonzero(self.matrix.T), strict=True)]


def interface_basis(mechanism: Mechanism, link: int) -> InterfaceBasis:
    """Return the interface basis of a flexible link.

    Modes are not mixed where they have common entries in the mass matrix, nor where bending shortens bodies, which
    moves all frames on them.
    """
    name, bundle = mechanism.links[link].flexible, mechanism.links[link].bundle
    assert bundle is not None
    n = bundle.sizes["mode"]
    if mass_coupled(bundle) or any(body.stiffening is not None for body in mechanism.scene.flexible().values()):
        return InterfaceBasis(np.eye(n), 0)
    used = {frame for part in coupled_frames(mechanism.scene) for frame in part if frame.partition(".")[0] == name}
    return basis(_motions(bundle, sorted(used)), np.diag(bundle["modal_stiffness"].values))


def mass_coupled(bundle: Labelled) -> bool:
    """Return True when the modal mass has entries between different modes."""
    mass = bundle["modal_mass"].values
    return bool(np.any(np.abs(mass - np.diag(np.diag(mass))) > UNCOUPLED))


def _motions(bundle: Labelled, frames: list[str]) -> np.ndarray:
    """Return displacements and rotations of frames per mode, both in units of the largest, shape (6 frames, mode)."""
    shapes = [frame_shapes(bundle, frame.partition(".")[2])[1:] for frame in frames]
    kinds = []
    for name, kind in zip(("frame_translation_shape", "frame_rotation_shape"), zip(*shapes, strict=True), strict=False):
        kinds += [shape / max(float(np.abs(bundle[name].values).max()), 1e-300) for shape in kind]
    return np.concatenate([*kinds, np.zeros((0, bundle.sizes["mode"]))])


def basis(motions: np.ndarray, stiffness: np.ndarray) -> InterfaceBasis:
    """Return the basis for the frames' motions per mode, (motions, mode), and the stiffness of each mode, (mode,).

    Held shapes are vibrations of the body with all frames held still: stiffness couples them only to moving shapes.
    Modes that move frames in different ways, as in bending and in torsion, are not mixed.
    """
    held, moving, n = list[np.ndarray](), list[np.ndarray](), len(stiffness)
    for modes in _families((np.abs(motions).T @ np.abs(motions)) > 0.0):
        for kind, columns in zip((held, moving), _family(motions[:, modes], stiffness[modes]), strict=True):
            for column in columns.T:
                kind.append(np.zeros(n))
                kind[-1][modes] = column
    return InterfaceBasis(np.array([*held, *moving]).T, len(held))


def _families(common: np.ndarray) -> list[list[int]]:
    """Return groups of modes with common motions, ascending; common: symmetric (modes, modes), true for such pairs."""
    reached = common | np.eye(len(common), dtype=bool)
    for _ in range(len(common).bit_length()):
        reached = reached @ reached
    return [np.flatnonzero(reached[first]).tolist() for first in np.unique(reached.argmax(axis=1))]


def _family(motions: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return held and moving shapes, as columns over the modes of one family."""
    n = len(stiffness)
    _, values, rows = np.linalg.svd(motions, full_matrices=True) if motions.size else (None, np.zeros(0), np.eye(n))
    # singular values of the frames' shapes below this fraction of the largest count as zero
    rank = int(np.sum(values > 1e-12 * values.max(initial=1e-300)))
    if rank == 0:
        return np.eye(n), np.zeros((n, 0))
    # least number of held shapes per moving shape at which modes are mixed: with fewer, mixing costs more than it saves
    if n - rank < 0.5 * rank or rank == n:
        return np.zeros((n, 0)), np.eye(n)
    still, moving = rows[rank:].T, rows[:rank].T
    _, axes = np.linalg.eigh(still.T @ (stiffness[:, None] * still))
    shapes = still @ axes
    shapes *= np.sign(shapes[index_of_largest(np.abs(shapes), axis=0), np.arange(shapes.shape[1])])
    # rotations before displacements: then only the first shapes rotate frames. With a heavy body on a frame, the mass
    # matrix of other moving shapes, scaled to a unit diagonal, is worse conditioned by a factor of 10 to 100
    turns_first, _ = np.linalg.qr((motions[np.any(motions != 0.0, axis=1)] @ moving)[::-1].T)
    return shapes, moving @ turns_first


def frame_index(bundle: Labelled, frame: str) -> int:
    """Return the index of a named frame of a bundle; raise ValueError when the bundle has none."""
    return [str(name) for name in bundle["frame"].values].index(frame)


def frame_shapes(bundle: Labelled, frame: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return undeformed pose (12,), translation shapes and rotation shapes (3, n each) of a named frame."""
    k = frame_index(bundle, frame)
    pose = np.concatenate([bundle["frame_position"].values[k], bundle["frame_rotation"].values[k].ravel()])
    shapes = [bundle[name].values[k].copy() for name in ("frame_translation_shape", "frame_rotation_shape")]
    for name, shape in zip(("frame_translation_shape", "frame_rotation_shape"), shapes, strict=True):
        # frames that the reference condition holds still must be exactly still
        scale = np.abs(bundle[name].values).max()
        shape[np.abs(shape) <= NO_COUPLING * 1e3 * scale] = 0.0
    return pose, shapes[0], shapes[1]


def modes_of(arrays: Arrays) -> np.ndarray:
    """Return the orthogonal matrix (nv, nv) from coordinates in the interface basis to those with eigenmodes."""
    matrix, entries = np.eye(arrays.size(m.NV)), arrays.table(m.BASIS)
    values = arrays.table(m.BASIS_VALUES)["value"]
    for body in arrays.table(m.FLEXES):
        mine, c = slice(body["basis0"], body["basis0"] + body["n_basis"]), body["c0"]
        block = np.zeros((body["n_modes"], body["n_modes"]))
        block[entries["mode"][mine], entries["shape"][mine]] = values[mine]
        matrix[c : c + len(block), c : c + len(block)] = block
    return matrix
