"""Solids as a kind of body."""

from __future__ import annotations

import numpy as np

from flexclear.structure.fe.model import Model
from flexclear.structure.fe.solid import mesh as meshes
from flexclear.structure.fe.solid.model import assemble
from flexclear.structure.kinds.kind import Kind

#: a body is a rod where its second largest extent is below this fraction of the largest
SLENDER = 0.5
#: a mode is torsion where the swirl about the axis has this many times the energy of all other motion
SWIRL = 4.0


def _words(model: Model, families: list[str], vectors: np.ndarray) -> list[str]:
    """Return bending, torsion or axial for each mode of a rod, by its surface motion; elastic for other bodies."""
    X = model.drawn.position - model.drawn.position.mean(axis=0)
    _, extent, axes = np.linalg.svd(X, full_matrices=False)
    if extent[1] > SLENDER * extent[0]:
        return ["elastic"] * vectors.shape[1]
    u = model.drawn.moved(vectors)[:, :3]
    axis = axes[0]
    across = X - np.outer(X @ axis, axis)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    radial = np.divide(across, size, out=np.zeros_like(across), where=size > 1e-9 * extent[0])
    swirl = np.cross(axis, radial)
    along, out, turn = (np.einsum("nk,nkj->nj", e, u) for e in (np.broadcast_to(axis, X.shape), radial, swirl))
    energy = [(part**2).sum(axis=0) for part in (along, out, turn)]
    return [_word(*parts) for parts in zip(*energy, strict=True)]


def _word(along: float, out: float, turn: float) -> str:
    if turn > SWIRL * (along + out):
        return "torsion"
    return "axial" if along > out + turn else "bending"


KIND = Kind(build=meshes.build, vtu=meshes.as_vtu, assemble=assemble, words=_words)
