"""Bodies given by the matrices of another code."""

from __future__ import annotations

from flexclear.pipeline.structure.fe.exchange import mesh as meshes
from flexclear.pipeline.structure.fe.exchange.model import assemble
from flexclear.pipeline.structure.kinds.kind import Kind

KIND = Kind(
    build=meshes.build,
    vtu=meshes.as_vtu,
    assemble=assemble,
    words=lambda model, families, vectors: ["elastic"] * vectors.shape[1],
)
