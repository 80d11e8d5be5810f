"""Drive laws as plain functions of time, from the same pieces that the kernels use."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from typing import Any

from pipeline.core.scene.drives import JointDrive
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.drives.pieces import Piece, pieces_of

#: the unit of what a drive prescribes
DIMENSION = {"prismatic": "length", "revolute": "angle"}


def joint_laws(scene: Scene) -> dict[str, tuple[Piece, ...]]:
    """Pieces of the law of every driven joint; ValueError for drives that prescribe something else."""
    found = {}
    for name, drive in scene.drive.items():
        if not isinstance(drive, JointDrive):
            raise ValueError(f"[drive.{name}] does not prescribe a joint's coordinate")
        dimension = DIMENSION[scene.joint[drive.joint].type]
        found[drive.joint] = pieces_of(drive.law, dimension).pieces
    return found


def holds_at_zero(pieces: tuple[Piece, ...]) -> bool:
    """Whether the coordinate stays at zero for ever."""
    return all(not piece.terms and not any(piece.coefficients) for piece in pieces)


def derivative(pieces: tuple[Piece, ...], order: int) -> Callable[[float], float]:
    """A derivative of a law of polynomials; at a break the later side.

    Plain floats, no arrays: a peer calls it at every iteration.  ValueError for laws with harmonics.
    """
    if any(piece.terms for piece in pieces):
        raise ValueError("laws with harmonics have no polynomials")
    starts = [piece.start for piece in pieces]
    falling = [_differentiate(list(piece.coefficients), order)[::-1] for piece in pieces]

    def value(t: float) -> float:
        k = max(bisect_right(starts, t) - 1, 0)
        s, result = t - starts[k], 0.0
        for c in falling[k]:
            result = result * s + c
        return result

    return value


def _differentiate(rising: list[Any], order: int) -> list[Any]:
    for _ in range(order):
        rising = [k * c for k, c in enumerate(rising)][1:]
    return rising
