"""Which closure rows are solved for, where some follow from the others.

Loops of a planar mechanism in space, or Bricard's, ask for the same thing several times. Their
multipliers are then not unique and J M^-1 J^T is singular, though the motion is as determined as
ever. A selection keeps as many rows as the rank says; the others are only looked at.
"""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import tables
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.assembly.packing import Packed, envelope_size
from pipeline.dynamics.assembly.places import N_KEPT_ROWS, SCHUR_SIZE
from pipeline.dynamics.assembly.wiring import closure_envelope

#: a row below this share of its natural length is rounding: the square root of what rounding leaves of a cancelling
#: sum, 1e-13 at worst, with some digits to spare
NOTHING = 1e-6


def choose(spread: np.ndarray, scale: np.ndarray, rank: int) -> tuple[np.ndarray, float]:
    """Rows to keep, as many as `rank`, and their least pivot: 1 for rows at right angles, 0 for dependent ones.

    spread: J L^-T, shape (rows, nv), a row each in the metric of the mass, M = L L^T.  scale: what a row's
    length is compared with, so that one that has shrunk to nothing is not mistaken for a good one; a row of the scale 0
    moves nothing.  QR decomposition with column pivoting (Golub & Van Loan, *Matrix Computations*, sec. 5.4.2): each
    row kept is the one that stands out most from those before.  Of rows that are no numbers the first ones are kept,
    with the pivot 0.
    """
    from scipy.linalg import qr  # slow to import, and most mechanisms have nothing to choose

    kept, count = np.zeros(len(spread), dtype=bool), min(rank, *spread.shape)
    if not count:
        return kept, 1.0
    compared = spread / np.where(scale > 0.0, scale, 1.0)[:, None]
    if not np.isfinite(compared).all():
        kept[:count] = True
        return kept, 0.0
    R, order = qr(compared.T, mode="r", pivoting=True)
    kept[order[:count]] = True
    return kept, float(R[count - 1, count - 1] ** 2)


def row_scales(built: Tables, spread: np.ndarray, natural: np.ndarray) -> np.ndarray:
    """Length of the longest row of the same closure and kind (along, turning), per row of all; shape (rows,).

    Not less than a small share of the row's natural length: rows that are nothing but rounding must stay small.
    """
    kinds, scales = built.packed.table("CLOSURE_ROWS")[:, 0], np.ones(len(spread))
    lengths = np.linalg.norm(spread, axis=1)
    for line in built.packed.table("CLOSURES"):
        span = slice(line[tables.ROW0], line[tables.ROW0] + line[tables.N_ROWS])
        for kind in (0, 1):
            mine = np.flatnonzero(kinds[span] == kind) + span.start
            scales[mine] = np.maximum(np.max(lengths[mine], initial=0.0), NOTHING * natural[mine])
    return scales


def natural_lengths(built: Tables, columns: np.ndarray, points: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Length in the metric of the mass that each closure row would have if nothing cancelled in it; shape (rows,).

    columns: twist of every column about the kernels' origin, (columns, 6); points: origins of all sites, (sites, 3);
    factor: L of the mass matrix.  A turn counts with the mechanism's size as its arm, which only rounding resolves.
    All are 0 where the mass matrix has no factor.
    """
    from scipy.linalg import solve_triangular

    packed, found = built.packed, np.zeros(built.packed.sizes["N_CLOSURE_ROWS"])
    if not np.all(factor.diagonal() > 0.0):
        return found
    kinds, entries, support = (packed.table(name) for name in ("CLOSURE_ROWS", "ENTRIES", "SUPPORT"))
    inverse = solve_triangular(factor, np.eye(len(factor)), lower=True, check_finite=False)
    mobility = np.sum(inverse**2, axis=0)  # diagonal of M^-1
    for c in packed.table("CLOSURES"):
        mine = entries[c[tables.ENTRY0] : c[tables.ENTRY0] + c[tables.N_ENTRIES]]
        turn, shift = columns[mine[:, 1], :3], columns[mine[:, 1], 3:]
        angle = np.linalg.norm(turn, axis=1)
        way = np.linalg.norm(shift + np.cross(turn, points[c[tables.SITE_B]]), axis=1) + built.system.length * angle
        share = mobility[support[c[tables.SUPPORT0] + mine[:, 0], 0]]
        rows = slice(c[tables.ROW0], c[tables.ROW0] + c[tables.N_ROWS])
        along, about = (np.sqrt(np.sum(size**2 * share)) for size in (way, angle))
        found[rows] = np.where(kinds[rows, 0] == 0, along, about)
    return found


def write(built: Tables, h: np.ndarray, kept: np.ndarray) -> None:
    """Write into h, a copy of the system's wiring, that the `kept` rows are solved for.

    kept: per row of the closure table.  No size and no offset changes except the number of rows solved for.
    """
    all_rows = built.packed.table("CLOSURES")
    closures, rows = view(built.packed, h, "CLOSURES"), view(built.packed, h, "CLOSURE_ROWS")
    declared = built.packed.table("CLOSURE_ROWS")
    start = 0
    for closure, was in zip(closures, all_rows, strict=True):
        span = slice(was[tables.ROW0], was[tables.ROW0] + was[tables.N_ROWS])
        order = np.argsort(~kept[span], kind="stable")
        rows[span] = declared[span][order]
        closure[tables.KEPT0], closure[tables.N_KEPT] = start, np.sum(kept[span])
        start += int(closure[tables.N_KEPT])
    envelope = view(built.packed, h, "CLOSURE_ENVELOPE")
    envelope[:start] = closure_envelope(closures, built.packed.table("CLOSURE_PAIRS"))
    h[N_KEPT_ROWS], h[SCHUR_SIZE] = start, envelope_size(envelope[:start])


def dense(built: Tables, h: np.ndarray, stored: np.ndarray) -> np.ndarray:
    """Kept rows against free coordinates, shape (..., kept, nv), from what the kernels store on the supports.

    stored: JACOBIAN or SPREAD of the work space, shape (..., size).
    """
    support = built.packed.table("SUPPORT")[:, 0]
    full = np.zeros((*stored.shape[:-1], int(h[N_KEPT_ROWS]), built.layout.nv))
    for c in view(built.packed, h, "CLOSURES"):
        count, slots = int(c[tables.N_KEPT]), int(c[tables.N_SUPPORT])
        columns = support[c[tables.SUPPORT0] : c[tables.SUPPORT0] + slots]
        block = stored[..., c[tables.JACOBIAN0] : c[tables.JACOBIAN0] + count * slots]
        block = block.reshape(*stored.shape[:-1], slots, count)
        full[..., c[tables.KEPT0] : c[tables.KEPT0] + count, columns] = np.swapaxes(block, -1, -2)
    return full


def kept_places(built: Tables, h: np.ndarray) -> np.ndarray:
    """Place of each kept row among all, as residuals and their rates are stored."""
    spans = (range(c[tables.ROW0], c[tables.ROW0] + c[tables.N_KEPT]) for c in view(built.packed, h, "CLOSURES"))
    return np.array([k for span in spans for k in span], dtype=np.int64)


def joints_of_rows(built: Tables, h: np.ndarray) -> list[str]:
    """Name of the joint to which each kept row belongs."""
    names = [built.system.closures[k][0].name for k in built.closure_order]
    counts = view(built.packed, h, "CLOSURES")[:, tables.N_KEPT]
    return [name for name, count in zip(names, counts, strict=True) for _ in range(count)]


def view(packed: Packed, h: np.ndarray, name: str) -> np.ndarray:
    """A wiring table inside h, not copied."""
    start, columns = packed.offset(name), tables.WIRING[name]
    return h[start : start + packed.sizes[f"rows of {name}"] * columns].reshape(-1, columns)
