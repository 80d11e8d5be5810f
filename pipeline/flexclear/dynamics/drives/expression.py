"""A law written as an expression of the time, expanded into pieces of polynomials and sines.

Products of sines become sums, so that value and rates have the form of any other law. `max`, `min`, `abs`, `sign` and
`step` split the time where their argument passes zero.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import numpy as np

from flexclear.dynamics.drives.pieces import Piece, Pieces, Terms
from flexclear.scene.expression import BENT, JUMPING, check_unit, fold
from flexclear.scene.formulas import WHOLE, constants_of, require_used
from flexclear.scene.laws import COEFFICIENTS, Expression
from flexclear.scene.quantity import read_expression

#: samples in which sign changes are searched for: at least, per period of the fastest sine, and at most
FEWEST_SAMPLES, PER_PERIOD, MOST_SAMPLES = 256, 32, 2_000_000
ZERO = Piece(0.0, (0.0,))
#: functions of a constant argument
PLAIN = {name: getattr(math, name) for name in ("exp", "log", "sqrt", "tan", "tanh")}


@dataclass(frozen=True)
class Course:
    """A part of an expression as a function of time: pieces in powers of t, each from its start [s] to the next."""

    starts: tuple[float, ...]
    pieces: tuple[Piece, ...]

    def at(self, t: float) -> Piece:
        """Return the piece that holds at a time."""
        return self.pieces[max(bisect_right(self.starts, t) - 1, 0)]


def pieces(law: Expression, dimension: str) -> Pieces:
    """Return the pieces of the expression; raise ValueError, in words, unless it is made of polynomials and sines."""
    known = constants_of(law.values)
    require_used(known, (law.value,))
    try:
        steps = read_expression(law.value, {"": {"t": False}}, known)
        check_unit(steps, dimension)
        bent = any(step in (*BENT, *JUMPING) for step in steps if isinstance(step, str))
        if bent and law.end is None:
            raise ValueError("max, min, abs, sign and step need an `end`, up to which their kinks are located")
        span = (law.start, law.end) if bent and law.end is not None else (-math.inf, math.inf)
        course = fold(
            steps,
            lambda leaf: Course((span[0],), (Piece(0.0, (leaf[0],) if isinstance(leaf, tuple) else (0.0, 1.0)),)),
            lambda operator, operands: _apply(operator, operands, span),
        )
    except ValueError as error:
        raise ValueError(f"'{law.value}': {error}") from None
    if len(course.pieces) == 1:
        return Pieces(course.pieces, span)
    moved = (piece.moved(start) for start, piece in zip(course.starts, course.pieces, strict=True))
    return Pieces(tuple(moved), span)


def _apply(operator: str, operands: list[Course], span: tuple[float, float]) -> Course:
    """Return the result of an operation, piece by piece."""
    if operator in ("max", "min"):
        a, b = operands
        return _switch(_each(_OPERATIONS["-"], a, b), *((a, b) if operator == "max" else (b, a)), span)
    if operator in ("abs", "sign", "step"):
        one = operands[0]
        low = {"abs": _each(_OPERATIONS["minus"], one), "sign": _constant(-1.0, span), "step": _constant(0.0, span)}[
            operator
        ]
        high = one if operator == "abs" else _constant(1.0, span)
        return _switch(one, high, low, span)
    if operator in _OPERATIONS:
        return _each(_OPERATIONS[operator], *operands)
    return _each(lambda a: _function(operator, a), *operands)


def _each(operation: Callable[..., Piece], *courses: Course) -> Course:
    starts = tuple(sorted({start for course in courses for start in course.starts}))
    return Course(starts, tuple(operation(*(course.at(start) for course in courses)) for start in starts))


def _constant(value: float, span: tuple[float, float]) -> Course:
    return Course((span[0],), (Piece(0.0, (value,)),))


def _switch(switch: Course, above: Course, below: Course, span: tuple[float, float]) -> Course:
    """Return `above` where the switch is positive, else `below`."""
    starts: list[float] = []
    for start, end in pairwise((*switch.starts, span[1])):
        starts += [start, *_roots(switch.at(start), start, end)]
    signs = [switch.at(a).value(0.5 * (a + b)) > 0.0 for a, b in pairwise((*starts, span[1]))]
    parts = Course(tuple(starts), tuple(Piece(float(sign), (0.0,)) for sign in signs))
    every = tuple(sorted({*starts, *above.starts, *below.starts}))
    return Course(every, tuple((above if parts.at(t).start else below).at(t) for t in every))


def _roots(piece: Piece, start: float, end: float) -> list[float]:
    """Return the times strictly between start and end at which a piece changes its sign."""
    from scipy.optimize import brentq  # here, since few laws need it

    fastest = max((abs(w) for _, w, _ in piece.terms), default=0.0)
    count = FEWEST_SAMPLES + PER_PERIOD * fastest * (end - start) / (2.0 * math.pi)
    if count > MOST_SAMPLES:
        raise ValueError(f"it has {count / PER_PERIOD:.3g} periods up to its end, too many to locate kinks")
    grid = np.linspace(start, end, int(count))
    values = np.array([piece.value(float(t)) for t in grid])
    crossed = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
    exact = [float(t) for t in grid[1:-1][(values[1:-1] == 0.0) & (values[:-2] * values[2:] < 0.0)]]
    located = [float(brentq(piece.value, grid[k], grid[k + 1], xtol=1e-15, rtol=1e-15)) for k in crossed]
    return sorted([*exact, *located])


# Algebra of pieces that are written from time 0 on -------------------------------------------------------------------


def _number(a: Piece, what: str) -> float:
    """Return the value of a constant; raise ValueError for a piece that varies."""
    if a.terms or any(a.coefficients[1:]):
        raise ValueError(f"{what} cannot be written in polynomials and sines: use a law of type 'spline' or 'table'")
    return a.coefficients[0]


def _product(a: Piece, b: Piece) -> Piece:
    if b.terms and not a.terms:
        a, b = b, a
    if a.terms and not b.terms:
        return a.times(_number(b, "a sine times the time"))
    degree = np.convolve(a.coefficients, b.coefficients)
    if not a.terms:
        if len(degree) > COEFFICIENTS and any(degree[COEFFICIENTS:]):
            raise ValueError(f"a polynomial has at most the degree {COEFFICIENTS - 1}")
        return Piece(0.0, tuple(float(c) for c in degree[:COEFFICIENTS]))
    offsets = [_number(Piece(0.0, piece.coefficients), "a sine times the time") for piece in (a, b)]
    crossed = Piece(0.0, (offsets[0],), a.terms).times(offsets[1])
    mixed = [_sines(one, other) for one in a.terms for other in b.terms]
    return reduce(Piece.plus, mixed, crossed.plus(Piece(0.0, (0.0,), b.terms).times(offsets[0])))


def _sines(one: tuple[float, float, float], other: tuple[float, float, float]) -> Piece:
    """Return the product of two sines: half the cosine of the difference less that of the sum."""
    (a, w, p), (b, v, q) = one, other
    parts = ((0.5 * a * b, w - v, p - q), (-0.5 * a * b, w + v, p + q))
    return reduce(Piece.plus, (_sine(size, rate, phase + 0.5 * math.pi) for size, rate, phase in parts), ZERO)


def _sine(size: float, rate: float, phase: float) -> Piece:
    terms: Terms = ((size, rate, phase),) if rate else ()
    return Piece(0.0, (0.0 if rate else size * math.sin(phase),), terms)


def _quotient(a: Piece, b: Piece) -> Piece:
    below = _number(b, "a divisor that changes")
    if below == 0.0:
        raise ValueError("it is divided by zero")
    return a.times(1.0 / below)


def _power(a: Piece, b: Piece) -> Piece:
    exponent = b.coefficients[0]
    if exponent == int(exponent) and 1 <= exponent <= WHOLE:
        return reduce(_product, [a] * int(exponent))
    return Piece(0.0, (_number(a, "this power") ** exponent,))


def _function(name: str, a: Piece) -> Piece:
    """Return a function of one number; `norm` and others that are no function of the time raise ValueError."""
    if name not in ("sin", "cos"):
        return Piece(0.0, (float(PLAIN.get(name, abs)(_number(a, f"{name}(...) of the time"))),))
    if a.terms or any(a.coefficients[2:]):
        raise ValueError(f"{name}(...) takes an angle linear in t, as {name}(w * t)")
    phase, rate = (*a.coefficients, 0.0)[:2]
    return _sine(1.0, rate, phase + (0.5 * math.pi if name == "cos" else 0.0))


_OPERATIONS: dict[str, Callable[..., Piece]] = {
    "+": Piece.plus,
    "-": lambda a, b: a.plus(b.times(-1.0)),
    "*": _product,
    "/": _quotient,
    "^": _power,
    "minus": lambda a: a.times(-1.0),
}
