"""The tables of the laws of time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.dynamics.assembly.wiring import integers
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.tables import PIECE_SIZE

Named = dict[str, np.ndarray]


def fill(laws: Sequence[Pieces]) -> tuple[Named, Named]:
    """LAWS and PIECE_HARMONICS; PIECES and HARMONICS."""
    rows: list[tuple[int, int]] = []
    shares: list[tuple[int, int]] = []
    pieces = [np.zeros((0, PIECE_SIZE))]
    harmonics: list[tuple[float, float, float]] = []
    for law in laws:
        table, terms = law.table()
        rows.append((len(shares), len(table)))
        pieces.append(table)
        for piece in terms:
            shares.append((len(harmonics), len(piece)))
            harmonics += piece
    wiring = {"LAWS": integers(rows, 2), "PIECE_HARMONICS": integers(shares, 2)}
    numbers = {"PIECES": np.concatenate(pieces), "HARMONICS": np.array(harmonics, dtype=float).reshape(-1, 3)}
    return wiring, numbers
