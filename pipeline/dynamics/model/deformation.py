"""How points of a flexible body move in its own frame, from its modal coordinates."""

from __future__ import annotations

import numpy as np

Shift = tuple[np.ndarray, np.ndarray, np.ndarray]  #: displacement, its rate, its second rate; (time, 3) each


def shift(shape: np.ndarray, bow: np.ndarray | None, q: np.ndarray, u: np.ndarray, du: np.ndarray) -> Shift:
    r"""Motion :math:`S q + \tfrac12 q^T B q\, e_x` of a point in the body frame.

    shape: S, (3, mode).  bow: B, (mode, mode), the shortening of a bent beam; None where the scene leaves it out.
    q, u, du: modal coordinates, rates and second rates, (time, mode).
    """
    place, rate, second = q @ shape.T, u @ shape.T, du @ shape.T
    if bow is None:
        return place, rate, second
    bent, turning = q @ bow, u @ bow
    along = np.stack(
        [
            0.5 * np.sum(bent * q, axis=1),
            np.sum(bent * u, axis=1),
            np.sum(bent * du, axis=1) + np.sum(turning * u, axis=1),
        ]
    )
    place, rate, second = place.copy(), rate.copy(), second.copy()
    place[:, 0] += along[0]
    rate[:, 0] += along[1]
    second[:, 0] += along[2]
    return place, rate, second
