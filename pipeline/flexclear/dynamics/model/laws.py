"""Laws of time of drives and loads: validation and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces, covers, jump, pieces_of
from flexclear.dynamics.model.driving import prescribed
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

#: no laws that replace the scene's
NO_LAWS: Mapping[str, Pieces] = MappingProxyType({})


def drive_laws(scene: Scene, given: Mapping[str, Pieces]) -> list[Pieces]:
    """Return the law of each prescribed coordinate; laws in `given` replace the scene's unchecked.

    Raises InputError where a value has the wrong dimension, a law does not cover the run, or value or rate jump: no
    finite force could follow.
    """
    laws = []
    for one in prescribed(scene):
        law = given[one.name] if one.name in given else checked_law(scene, one.law, one.dimension, one.place)
        broken = None if one.name in given else jump(law, scene.time.start, scene.time.end)
        if broken is not None:
            raise InputError(
                one.place,
                f"the {broken[1]} of the prescribed motion jumps at {broken[0]:.6g} s",
                "let value and rate continue without a jump; the second derivative may have one",
            )
        laws.append(law)
    return laws


def checked_law(scene: Scene, law: Any, dimension: str, path: str) -> Pieces:
    """Return the pieces of a law; raise InputError for a wrong dimension, or a law that does not cover the run."""
    try:
        made = pieces_of(law, dimension)
    except ValueError as error:
        raise InputError(path, str(error)) from None
    start, end = scene.time.start, scene.time.end
    if not covers(made, start, end):
        low, high = made.span
        raise InputError(
            path,
            f"its points cover {low:.6g} s to {high:.6g} s, the run from {start:.6g} s to {end:.6g} s",
            "add points, or shorten the run",
        )
    return made


def fill(laws: Sequence[Pieces]) -> dict[Any, Any]:
    """Return the tables LAWS, PIECES, PIECE_HARMONICS and HARMONICS."""
    rows: list[tuple[int, int]] = []
    parts: list[tuple[int, int]] = []
    pieces = [np.zeros((0, m.PIECES.size))]
    harmonics: list[tuple[float, float, float]] = []
    for law in laws:
        table, terms = law.table()
        rows.append((len(parts), len(table)))
        pieces.append(table)
        for piece in terms:
            parts.append((len(harmonics), len(piece)))
            harmonics += piece
    return {m.LAWS: rows, m.PIECES: np.concatenate(pieces), m.PIECE_HARMONICS: parts, m.HARMONICS: harmonics}
