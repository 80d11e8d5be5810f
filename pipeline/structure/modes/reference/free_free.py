r"""Mean axes: elastic shapes of the free body, free of linear and angular momentum.

.. math:: \int\rho\, S\,dV = 0, \qquad \int\rho\, (X - X_c)\times S\,dV = 0

Source: Wang & Wang (2019), sec. 3.4 and Table 5; mean axes after Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

import numpy as np

from pipeline.structure.fe.beam import Beam, rigid_vectors
from pipeline.structure.modes import eigen, select
from pipeline.structure.modes.basis import Basis


def basis(beam: Beam, count: int | None, interfaces: tuple[int, ...]) -> Basis:
    """The lowest elastic modes of the free body; `interfaces` play no part.

    count: number of elastic modes, None for all.  Raises InputError when it cuts a cluster.
    """
    rigid = rigid_vectors(beam)
    n_rigid = rigid.shape[1]
    wanted = select.request(count, beam.size - n_rigid)
    values, vectors = eigen.lowest(beam.stiffness, beam.mass, n_rigid + wanted.solve, shift=_below_zero(beam))
    select.without_rigid(values, n_rigid)
    n = select.whole(values[n_rigid:], wanted)
    elastic = vectors[:, n_rigid : n_rigid + n]
    # the solver leaves a trace of rigid motion; momentum is to vanish to rounding
    momentum = beam.mass @ rigid
    elastic = elastic - rigid @ np.linalg.solve(rigid.T @ momentum, momentum.T @ elastic)
    return Basis(elastic, np.sort(eigen.frequency(values[:n_rigid])))


def _below_zero(beam: Beam) -> float:
    """A negative shift [rad^2/s^2] of the size of the lowest elastic eigenvalue: K - shift M must be regular."""
    x = beam.node_position[:, 0] - beam.node_position[:, 0].mean()
    bend = np.zeros((beam.size, 1))
    bend[1::6, 0] = x**2
    bend[5::6, 0] = 2.0 * x
    energy = (bend.T @ (beam.stiffness @ bend)).item()
    return -energy / (bend.T @ (beam.mass @ bend)).item()
