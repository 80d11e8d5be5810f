"""Laws of one piece: constant values, polynomials of time, and sines about a constant offset."""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.scene.laws import Constant, Harmonic, Polynomial
from flexclear.scene.units import coefficient, quantity


def pieces_of_polynomial(law: Polynomial, dimension: str) -> Pieces:
    """Return one piece."""
    coefficients = (coefficient(c, dimension, order) for order, c in enumerate(law.coefficients))
    return Pieces((Piece(law.origin, tuple(coefficients)),))


def pieces_of_constant(law: Constant, dimension: str) -> Pieces:
    """Return one piece."""
    return Pieces((Piece(0.0, (quantity(law.value, dimension),)),))


def pieces_of_harmonic(law: Harmonic, dimension: str) -> Pieces:
    """Return one piece."""
    phases = law.phase or (0.0,) * len(law.amplitude)
    amplitudes = (quantity(a, dimension) for a in law.amplitude)
    terms = tuple(zip(amplitudes, law.frequency, phases, strict=True))
    return Pieces((Piece(0.0, (quantity(law.offset, dimension),), terms),))
