"""One choice of axes and sign where the eigenproblem leaves it open, and the family of each mode."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.numerics.rotations import first_largest
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.select import clusters


def orient(model: Model, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors of equal eigenvalues turned to the body's axes: its families in their order.

    values: ascending, shape (n,).  vectors: mass-normalised, shape (ndof, n).
    """
    result = vectors.copy()
    local, weight = model.families.local, _rank(model)
    for start, stop in clusters(values):
        if stop - start > 1:
            part = vectors[:, start:stop]
            measure = (local @ part).T @ (weight[:, None] * (local @ (model.mass @ part)))
            turn = np.linalg.eigh(0.5 * (measure + measure.T))[1]
            result[:, start:stop] = part @ turn[:, ::-1]
    return result


def _rank(model: Model) -> np.ndarray:
    """A weight per local component that separates the families, and within one the positions along the body."""
    families = model.families
    return 0.25 * (1.0 - families.along) + (len(families.names) - 1 - families.member)


def family(model: Model, vectors: np.ndarray) -> list[str]:
    """For each vector the family with the largest fraction of its kinetic energy."""
    families = model.families
    fraction = (families.local @ vectors) * (families.local @ (model.mass @ vectors))
    totals = np.stack([fraction[families.member == k].sum(axis=0) for k in range(len(families.names))])
    # a solid's torsion has equal fractions along y and z
    return [families.names[k] for k in first_largest(totals, axis=0)]


def signed(model: Model, vectors: np.ndarray, families: list[str]) -> np.ndarray:
    """Each vector with its largest displacement positive (rotation, where it twists).

    Of components that are equally large, as those at the two ends of an antisymmetric shape, the first counts.
    """
    result = vectors.copy()
    main = dict(zip(model.families.names, model.families.main, strict=True))
    for j, name in enumerate(families):
        component = model.families.local[main[name]] @ vectors[:, j]
        result[:, j] *= np.sign(component[first_largest(np.abs(component))])
    return result
