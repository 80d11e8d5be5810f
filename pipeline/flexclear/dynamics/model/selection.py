"""Selection of independent closure rows, for which an evaluation solves.

Loops of a planar mechanism in space, or Bricard's linkage, impose the same condition several times. Their multipliers
are then not unique and J M^-1 J^T is singular, although the motion is determined. A selection keeps as many rows as the
rank; the others are only observed.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.model import Model


def choose(spread: np.ndarray, scale: np.ndarray, rank: int) -> tuple[np.ndarray, float]:
    """Return the mask of `rank` rows to keep, and their least pivot: 1 for rows at right angles, 0 for dependent ones.

    spread: J L^-T, shape (rows, nv), each row in the metric of the mass, M = L L^T.  scale: reference of each row's
    length, so that a row that has shrunk to rounding is not selected; a row of scale 0 moves nothing.  Method: QR
    decomposition with column pivoting (Golub & Van Loan, *Matrix Computations*, sec. 5.4.2): each row selected is the
    most independent of the previous ones.  If any number is not finite, the first rows are selected, with the pivot 0.
    """
    from scipy.linalg import qr  # slow to import, and most mechanisms have no redundant rows

    selected, count = np.zeros(len(spread), dtype=bool), min(rank, *spread.shape)
    if not count:
        return selected, 1.0
    compared = spread / np.where(scale > 0.0, scale, 1.0)[:, None]
    if not np.isfinite(compared).all():
        selected[:count] = True
        return selected, 0.0
    R, order = qr(compared.T, mode="r", pivoting=True)
    selected[order[:count]] = True
    return selected, float(R[count - 1, count - 1] ** 2)


def row_scales(model: Model, spread: np.ndarray, natural: np.ndarray) -> np.ndarray:
    """Return, per row, the length of the longest row of the same closure and kind (along, turning); shape (rows,).

    The scale is at least a small fraction of the row's natural length, so that rows of mere rounding stay small.
    """
    kinds, scales = model.arrays.table(m.CLOSURE_ROWS)["kind"], np.ones(len(spread))
    lengths = np.linalg.norm(spread, axis=1)
    for line in model.arrays.table(m.CLOSURES):
        span = slice(line["row0"], line["row0"] + line["n_rows"])
        for kind in (0, 1):
            mine = np.flatnonzero(kinds[span] == kind) + span.start
            # rows below this fraction of their natural length are rounding: the square root of the rounding in a
            # cancelling sum, 1e-13 at worst, with some digits to spare
            scales[mine] = np.maximum(np.max(lengths[mine], initial=0.0), 1e-6 * natural[mine])
    return scales


def write(model: Model, h: np.ndarray, selected: np.ndarray) -> None:
    """Write into h, a copy of the model's topology tables, the `selected` rows to solve for.

    selected: mask over all closure rows.  Sizes and offsets do not change, except the number of rows solved for.
    """
    all_rows = model.arrays.table(m.CLOSURES)
    closures, rows = model.arrays.table(m.CLOSURES, h), model.arrays.table(m.CLOSURE_ROWS, h)
    declared = model.arrays.table(m.CLOSURE_ROWS)
    start = 0
    for closure, was in zip(closures, all_rows, strict=True):
        span = slice(was["row0"], was["row0"] + was["n_rows"])
        order = np.argsort(~selected[span], kind="stable")
        rows[span] = declared[span][order]
        closure["kept0"], closure["n_kept"] = start, np.sum(selected[span])
        start += int(closure["n_kept"])
    h[m.N_KEPT_ROWS] = start


def dense_rows(model: Model, h: np.ndarray, stored: np.ndarray) -> np.ndarray:
    """Return selected rows by free coordinates, (..., kept, nv), from those by their supports; stored: JACOBIAN of the
    work space, shape (..., size)."""
    support = model.arrays.table(m.SUPPORT)["coordinate"]
    full = np.zeros((*stored.shape[:-1], int(h[m.N_KEPT_ROWS]), model.nv))
    for c in model.arrays.table(m.CLOSURES, h):
        count, size = int(c["n_kept"]), int(c["n_support"])
        block = stored[..., c["jacobian0"] : c["jacobian0"] + count * size].reshape(*stored.shape[:-1], count, size)
        full[..., c["kept0"] : c["kept0"] + count, support[c["support0"] : c["support0"] + size]] = block
    return full


def selected_indices(model: Model, h: np.ndarray) -> np.ndarray:
    """Return the index of each selected row among all rows, the order of residuals and their rates."""
    spans = (range(c["row0"], c["row0"] + c["n_kept"]) for c in model.arrays.table(m.CLOSURES, h))
    return np.array([k for span in spans for k in span], dtype=np.int64)


def coordinates_of_rows(model: Model, h: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the mask (nv,) of free coordinates in the closures of some rows; chosen: mask (selected rows,)."""
    support, mask = model.arrays.table(m.SUPPORT)["coordinate"], np.zeros(model.nv, dtype=bool)
    for c in model.arrays.table(m.CLOSURES, h):
        if np.any(chosen[c["kept0"] : c["kept0"] + c["n_kept"]]):
            mask[support[c["support0"] : c["support0"] + c["n_support"]]] = True
    for body in model.arrays.table(m.FLEXES):  # a closure may involve only some shapes of a body
        modes = slice(body["c0"], body["c0"] + body["n_modes"])
        mask[modes] = np.any(mask[modes])
    return mask


def joints_of_rows(model: Model, h: np.ndarray) -> list[str]:
    """Return the name of the joint of each selected row."""
    counts = model.arrays.table(m.CLOSURES, h)["n_kept"]
    return [closure.name for closure, count in zip(model.closures, counts, strict=True) for _ in range(count)]
