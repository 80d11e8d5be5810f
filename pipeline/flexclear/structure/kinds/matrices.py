"""Bodies given by the matrices of another code, as a kind of body."""

from __future__ import annotations

from flexclear.structure.fe.exchange import matrices
from flexclear.structure.kinds.interface import Kind

KIND = Kind(
    build=matrices.build,
    vtu=matrices.as_vtu,
    assemble=matrices.assemble,
    words=lambda model, families, vectors: ["elastic"] * vectors.shape[1],
)
