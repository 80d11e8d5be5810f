"""A constant offset plus sines."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.scene.laws import Harmonic
from flexclear.scene.units import quantity


def pieces(law: Harmonic, dimension: str) -> Pieces:
    """Return one piece."""
    phases = law.phase or (0.0,) * len(law.amplitude)
    amplitudes = (quantity(a, dimension) for a in law.amplitude)
    terms = tuple(zip(amplitudes, law.frequency, phases, strict=True))
    return Pieces((Piece(0.0, (quantity(law.offset, dimension),), terms),))
