"""The tables of the laws of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.drives.pieces import Pieces


def fill(laws: Sequence[Pieces]) -> dict[Any, Any]:
    """The tables LAWS, PIECES, PIECE_HARMONICS and HARMONICS."""
    rows: list[tuple[int, int]] = []
    shares: list[tuple[int, int]] = []
    pieces = [np.zeros((0, m.PIECES.size))]
    harmonics: list[tuple[float, float, float]] = []
    for law in laws:
        table, terms = law.table()
        rows.append((len(shares), len(table)))
        pieces.append(table)
        for piece in terms:
            shares.append((len(harmonics), len(piece)))
            harmonics += piece
    return {m.LAWS: rows, m.PIECES: np.concatenate(pieces), m.PIECE_HARMONICS: shares, m.HARMONICS: harmonics}
