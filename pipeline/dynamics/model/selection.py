"""Which closure rows are solved for, where some follow from the others.

Loops of a planar mechanism in space, or Bricard's, ask for the same thing several times. Their
multipliers are then not unique and J M^-1 J^T is singular, though the motion is as determined as
ever. A selection keeps as many rows as the rank says; the others are only looked at.
"""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.model.arrays import envelope_size
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.wiring import closure_envelope

#: rows below this share of the longest are rounding
NOTHING = 1e-6


def choose(spread: np.ndarray, scale: np.ndarray, rank: int) -> tuple[np.ndarray, float]:
    """Rows to keep, as many as `rank`, and their least pivot: 1 for rows at right angles, 0 for dependent ones.

    spread: J L^-T, shape (rows, nv), a row each in the metric of the mass, M = L L^T.  scale: what a row's
    length is compared with, so that one that has shrunk to nothing is not mistaken for a good one.  QR decomposition
    with column pivoting (Golub & Van Loan, *Matrix Computations*, sec. 5.4.2): each row kept is the one that stands
    out most from those before.
    """
    from scipy.linalg import qr  # slow to import, and most mechanisms have nothing to choose

    kept, count = np.zeros(len(spread), dtype=bool), min(rank, *spread.shape)
    if not count:
        return kept, 1.0
    R, order = qr((spread / scale[:, None]).T, mode="r", pivoting=True)
    kept[order[:count]] = True
    return kept, float(R[count - 1, count - 1] ** 2)


def row_scales(model: Model, spread: np.ndarray) -> np.ndarray:
    """Length of the longest row of the same closure and kind (along, turning), per row of all; shape (rows,).

    Not less than a small share of the longest of all, a length of the mechanism's size counting like a radian: rows
    that are nothing but rounding must stay small.
    """
    kinds, scales = model.arrays.table(m.CLOSURE_ROWS)["kind"], np.ones(len(spread))
    units = np.where(kinds == 0, model.mechanism.length, 1.0)
    lengths = np.linalg.norm(spread, axis=1)
    floor = NOTHING * units * float(np.max(lengths / units, initial=0.0))
    for line in model.arrays.table(m.CLOSURES):
        span = slice(line["row0"], line["row0"] + line["n_rows"])
        for kind in (0, 1):
            mine = np.flatnonzero(kinds[span] == kind) + span.start
            scales[mine] = np.maximum(np.max(lengths[mine], initial=0.0), floor[mine])
    return scales


def write(model: Model, h: np.ndarray, kept: np.ndarray) -> None:
    """Write into h, a copy of the system's wiring, that the `kept` rows are solved for.

    kept: per row of the closure table.  No size and no offset changes except the number of rows solved for.
    """
    all_rows = model.arrays.table(m.CLOSURES)
    closures, rows = model.arrays.table(m.CLOSURES, h), model.arrays.table(m.CLOSURE_ROWS, h)
    declared = model.arrays.table(m.CLOSURE_ROWS)
    start = 0
    for closure, was in zip(closures, all_rows, strict=True):
        span = slice(was["row0"], was["row0"] + was["n_rows"])
        order = np.argsort(~kept[span], kind="stable")
        rows[span] = declared[span][order]
        closure["kept0"], closure["n_kept"] = start, np.sum(kept[span])
        start += int(closure["n_kept"])
    envelope = model.arrays.table(m.CLOSURE_ENVELOPE, h)
    envelope["first"][:start], envelope["start"][:start] = closure_envelope(
        closures, model.arrays.table(m.CLOSURE_PAIRS)
    ).T
    h[m.N_KEPT_ROWS], h[m.SCHUR_SIZE] = start, envelope_size(envelope[:start])


def dense(model: Model, h: np.ndarray, stored: np.ndarray) -> np.ndarray:
    """Kept rows against free coordinates, shape (..., kept, nv), from what the kernels store on the supports.

    stored: JACOBIAN or SPREAD of the work space, shape (..., size).
    """
    support = model.arrays.table(m.SUPPORT)["coordinate"]
    full = np.zeros((*stored.shape[:-1], int(h[m.N_KEPT_ROWS]), model.numbering.nv))
    for c in model.arrays.table(m.CLOSURES, h):
        count, slots = int(c["n_kept"]), int(c["n_support"])
        columns = support[c["support0"] : c["support0"] + slots]
        block = stored[..., c["jacobian0"] : c["jacobian0"] + count * slots]
        block = block.reshape(*stored.shape[:-1], slots, count)
        full[..., c["kept0"] : c["kept0"] + count, columns] = np.swapaxes(block, -1, -2)
    return full


def kept_places(model: Model, h: np.ndarray) -> np.ndarray:
    """Place of each kept row among all, as residuals and their rates are stored."""
    spans = (range(c["row0"], c["row0"] + c["n_kept"]) for c in model.arrays.table(m.CLOSURES, h))
    return np.array([k for span in spans for k in span], dtype=np.int64)


def coordinates_of_rows(model: Model, h: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Which free coordinates the closures of the chosen kept rows depend on; masks (kept rows,) -> (nv,)."""
    support, found = model.arrays.table(m.SUPPORT)["coordinate"], np.zeros(model.numbering.nv, dtype=bool)
    for c in model.arrays.table(m.CLOSURES, h):
        if np.any(chosen[c["kept0"] : c["kept0"] + c["n_kept"]]):
            found[support[c["support0"] : c["support0"] + c["n_support"]]] = True
    return found


def joints_of_rows(model: Model, h: np.ndarray) -> list[str]:
    """Name of the joint to which each kept row belongs."""
    names = [model.mechanism.closures[k][0].name for k in model.closure_order]
    counts = model.arrays.table(m.CLOSURES, h)["n_kept"]
    return [name for name, count in zip(names, counts, strict=True) for _ in range(count)]
