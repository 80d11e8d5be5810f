"""Laws of time of drives and loads: validation and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces, covers, jump, pieces_of
from flexclear.dynamics.model.driving import Prescribed, prescribed_coordinates
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, together

#: largest angle of a law [rad]; it is resolved to a radian or so
LARGEST_ANGLE = 1e15
#: no laws that replace the scene's
NO_LAWS: Mapping[str, Pieces] = MappingProxyType({})


def drive_laws(scene: Scene, given: Mapping[str, Pieces]) -> list[Pieces]:
    """Return the law of each prescribed coordinate; laws in `given` replace the scene's unchecked.

    Raises InputError where a value has the wrong dimension, a law does not cover the run, or value or rate jump: no
    finite force could follow.
    """
    return together(partial(_drive_law, scene, one, given.get(one.name)) for one in prescribed_coordinates(scene))


def _drive_law(scene: Scene, one: Prescribed, given: Pieces | None) -> Pieces:
    if given is not None:
        return given
    law = checked_law(scene, one.law, one.dimension, one.place)
    broken = jump(law, scene.time.start, scene.time.end)
    if broken is not None:
        raise InputError(
            one.place,
            f"the {broken[1]} of the prescribed motion jumps at {broken[0]:.6g} s",
            "let value and rate continue without a jump; the second derivative may have one",
        )
    return law


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
    _refuse_unresolved(made, (start, end), dimension, path)
    return made


def _refuse_unresolved(law: Pieces, run: tuple[float, float], dimension: str, path: str) -> None:
    """Raise InputError for sines and angles of so many turns that no digit is left of the position within a turn."""
    sines = [(abs(size), abs(rate)) for piece in law.pieces for size, rate, _ in piece.terms]
    angles = [rate * (run[1] - run[0]) for _, rate in sines]
    if dimension == "angle":
        angles += [*(size for size, _ in sines), *(abs(law.value(t)) for t in run)]
    if max(angles, default=0.0) > LARGEST_ANGLE:
        raise InputError(
            path,
            f"reaches an angle of {max(angles):.3g} rad in the run; numbers of 16 digits resolve {LARGEST_ANGLE:g} rad",
            "give a smaller amplitude or a lower frequency",
        )


def fill(laws: Sequence[Pieces]) -> dict[Any, Any]:
    """Return the tables LAWS, PIECES, PIECE_HARMONICS and HARMONICS."""
    rows: list[tuple[int, int]] = []
    parts: list[tuple[int, int, int]] = []
    pieces = [np.zeros((0, m.PIECES.size))]
    harmonics: list[tuple[float, float, float]] = []
    for law in laws:
        rows.append((len(parts), len(law.pieces)))
        pieces.append(law.rows)
        for piece, last in zip(law.pieces, rows[-1][0] + law.last, strict=True):
            parts.append((len(harmonics), len(piece.terms), last))
            harmonics += piece.terms
    return {m.LAWS: rows, m.PIECES: np.concatenate(pieces), m.PIECE_HARMONICS: parts, m.HARMONICS: harmonics}
