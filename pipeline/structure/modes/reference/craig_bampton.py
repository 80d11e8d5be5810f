"""Body frame clamped at the first interface; constraint modes of the others and fixed-interface normal modes.

The static response to forces and moments at the interfaces is exact with any number of normal modes.
Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse.linalg

from pipeline.core.errors import InputError
from pipeline.structure.fe.beam import N_DOFS, Beam, node_dofs
from pipeline.structure.modes import select
from pipeline.structure.modes.basis import Basis
from pipeline.structure.modes.reference.fixed_fixed import clamped_modes


def basis(beam: Beam, count: int | None, interfaces: tuple[int, ...]) -> Basis:
    """Six constraint modes per further interface and the lowest normal modes with all interfaces clamped.

    interfaces: node indices; the first one carries the body frame.
    count: constraint and normal modes together, None for all.
    Raises InputError without interfaces, when two share a node, and when the count cuts a cluster of the
    normal modes.
    """
    if not interfaces:
        raise InputError(
            "modes.interfaces", "a Craig-Bampton basis needs at least one interface", "name the recipe's frames"
        )
    if len(set(interfaces)) < len(interfaces):
        raise InputError("modes.interfaces", "two interfaces lie on the same node", "keep one of them")
    held = node_dofs(np.array(interfaces))
    free = np.setdiff1d(np.arange(beam.size), held)
    moving = held[N_DOFS:]
    wanted = select.request(count, free.size, static=moving.size)
    static = np.zeros((beam.size, moving.size))
    static[moving] = np.eye(moving.size)
    if moving.size and free.size:
        K = beam.stiffness.tocsc()
        response = scipy.sparse.linalg.splu(K[free][:, free]).solve(-K[free][:, moving].toarray())
        static[free] = response
    return Basis(np.hstack([static, clamped_modes(beam, free, wanted)]), np.empty(0))
