"""One choice of axes and sign where the eigenproblem leaves it open, and the name of what a mode does."""

from __future__ import annotations

import numpy as np

from pipeline.structure.fe.beam import N_DOFS, Beam
from pipeline.structure.modes.select import clusters

#: families in the order that they take within a cluster of equal frequencies, with their degrees of freedom
FAMILIES: dict[str, tuple[int, ...]] = {"bending_y": (1, 5), "bending_z": (2, 4), "torsion": (3,), "axial": (0,)}


def orient(beam: Beam, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors of equal eigenvalues turned to the body's axes: bending in y, then z, torsion, axial.

    values: ascending, shape (n,).  vectors: mass-normalised, shape (ndof, n).
    """
    result = vectors.copy()
    weight = _rank(beam)
    for start, stop in clusters(values):
        if stop - start > 1:
            part = vectors[:, start:stop]
            measure = part.T @ (weight[:, None] * (beam.mass @ part))
            turn = np.linalg.eigh(0.5 * (measure + measure.T))[1]
            result[:, start:stop] = part @ turn[:, ::-1]
    return result


def _rank(beam: Beam) -> np.ndarray:
    """A weight per degree of freedom that separates the families, and within one the places along the body."""
    x = beam.node_position[:, 0]
    along = 0.25 * (x.max() - x) / (x.max() - x.min())
    weight = np.repeat(along[:, None], N_DOFS, axis=1)
    for rank, dofs in enumerate(reversed(FAMILIES.values())):
        weight[:, dofs] += rank
    return weight.ravel()


def family(beam: Beam, vectors: np.ndarray) -> list[str]:
    """For each vector the family with the largest share of its kinetic energy."""
    momentum = beam.mass @ vectors
    share = (vectors * momentum).reshape(-1, N_DOFS, vectors.shape[1]).sum(axis=0)
    totals = np.stack([share[list(dofs)].sum(axis=0) for dofs in FAMILIES.values()])
    return [list(FAMILIES)[k] for k in np.argmax(totals, axis=0)]


def signed(vectors: np.ndarray, families: list[str]) -> np.ndarray:
    """Each vector with its largest displacement positive (rotation, where it twists).

    Of components that are equally large up to rounding, as the two ends of an antisymmetric shape, the first counts.
    """
    result = vectors.copy()
    for j, name in enumerate(families):
        component = vectors[FAMILIES[name][0] :: N_DOFS, j]
        large = np.flatnonzero(np.abs(component) >= (1.0 - 1e-6) * np.abs(component).max())
        result[:, j] *= np.sign(component[large[0]])
    return result
