"""Both ends clamped to the body frame: first and last node, wherever the joints are.

Both end nodes stay rigid, so joints there see no compliance at all (which is the truth of this basis).
Source: Wang & Wang (2019), eq. (6), sec. 3.4 and Table 4.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.errors import InputError
from pipeline.structure.fe.beam import Beam, node_dofs
from pipeline.structure.modes import eigen, select
from pipeline.structure.modes.basis import Basis


def basis(beam: Beam, count: int | None, interfaces: tuple[int, ...]) -> Basis:
    """The lowest modes between clamped ends; `interfaces` play no part.

    count: number of modes, None for all.  Raises InputError when it cuts a cluster, or nothing is free.
    """
    x = beam.node_position[:, 0]
    clamped = node_dofs(np.array([np.argmin(x), np.argmax(x)]))
    free = np.setdiff1d(np.arange(beam.size), clamped)
    if free.size == 0:
        raise InputError("modes.reference", "one element has no coordinate between two clamped ends", "use at least 2")
    return Basis(clamped_modes(beam, free, select.request(count, free.size)), np.empty(0))


def clamped_modes(beam: Beam, free: np.ndarray, wanted: select.Request) -> np.ndarray:
    """Lowest modes with all but the `free` degrees of freedom held, shape (ndof, wanted.normal)."""
    shapes = np.zeros((beam.size, wanted.normal))
    if wanted.normal == 0:
        return shapes
    K, M = beam.stiffness[free][:, free], beam.mass[free][:, free]
    values, vectors = eigen.lowest(K, M, wanted.solve, shift=0.0)
    n = select.whole(values, wanted)
    shapes[free] = vectors[:, :n]
    return shapes
