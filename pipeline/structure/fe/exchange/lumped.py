r"""Mass matrices that lump: every node is a small rigid body, as most programs have it for beams and shells.

A node's block of such a matrix, with the mass m, its centre c from the node and the inertia J about that centre, is

.. math:: \begin{bmatrix} m 1 & -m\tilde c \\ m\tilde c & J - m\tilde c\tilde c \end{bmatrix},

and from it every integral over the volume follows (`fe.slices`). A consistent mass of nodes that turn does not tell
them: it has forgotten where in the element each fraction of mass is.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexclear.pipeline.core.numerics.rotations import skew
from flexclear.pipeline.structure.fe.model import node_motion
from flexclear.pipeline.structure.fe.slices import Slices, at_centres, spread

#: entries that differ by less than this fraction of the mass (times a length, where they do) are the same
ALIKE = 1e-9


def nodes(M: sp.csr_array, node: np.ndarray, component: np.ndarray, positions: np.ndarray) -> Slices | None:
    """The nodes as slices; None where the mass matrix is not that of rigid nodes.

    M: shape (n, n).  node: number, shape (n,).  component: index of ux uy uz rx ry rz, (n,).  positions: [m], (n, 3).
    """
    _, first, index = np.unique(node, return_index=True, return_inverse=True)
    index = index.ravel()
    blocks = _blocks(M, index, component, len(first))
    if blocks is None:
        return None
    mass, c = blocks[:, 0, 0], _axial(blocks[:, 3:, :3]) / blocks[:, :1, 0]
    lever = skew(c)
    J = blocks[:, 3:, 3:] + mass[:, None, None] * lever @ lever
    made = np.zeros_like(blocks)
    made[:, range(3), range(3)] = mass[:, None]
    made[:, 3:, :3] = mass[:, None, None] * lever
    made[:, :3, 3:] = -made[:, 3:, :3]
    made[:, 3:, 3:] = blocks[:, 3:, 3:]
    size = np.array([1.0] * 3 + [np.ptp(positions, axis=0).max()] * 3)
    if np.any(np.abs(made - blocks) > ALIKE * mass[:, None, None] * np.outer(size, size)):
        return None
    motion = at_centres(node_motion(index, component, len(first)), c)
    return Slices(mass, positions[first] + c, spread(J), motion)


def _blocks(M: sp.csr_array, index: np.ndarray, component: np.ndarray, count: int) -> np.ndarray | None:
    """The mass of each node, shape (count, 6, 6), zero for what it lacks; None where nodes share mass or have none."""
    if component.max() >= 6:
        return None
    entries = sp.coo_array(M)
    scale = np.sqrt(M.diagonal())
    mask = np.abs(entries.data) > ALIKE * scale[entries.row] * scale[entries.col]
    row, column, value = entries.row[mask], entries.col[mask], entries.data[mask]
    if np.any(index[row] != index[column]):
        return None
    blocks = np.zeros((count, 6, 6))
    blocks[index[row], component[row], component[column]] = value
    return blocks if blocks[:, range(3), range(3)].all() else None


def _axial(matrices: np.ndarray) -> np.ndarray:
    """Vectors of the antisymmetric parts, shape (n, 3)."""
    a = 0.5 * (matrices - matrices.transpose(0, 2, 1))
    return np.stack([a[:, 2, 1], a[:, 0, 2], a[:, 1, 0]], axis=1)
