"""Derivative of each operation: rules (tape, value, arguments, changes of the arguments) -> change of the value.

For symbols a rule writes on a tape (`derivative`), for numbers it calculates (`dual`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.specialise.tape import FLOAT, Symbol


def _product(tape: Any, z: Any, x: Any, dx: Any) -> Any:
    (a, b), (da, db) = x, dx
    return tape.add(_times(tape, da, b), _times(tape, db, a))


def _times(tape: Any, change: Any, factor: Any) -> Any:
    """Return a product; a zero change gives zero for any factor."""
    return 0.0 if _nothing(change) else tape.multiply(change, factor)


def _nothing(change: Any) -> bool:
    return isinstance(change, float) and change == 0.0


def _root(tape: Any, z: Any, x: Any, dx: Any) -> Any:
    return tape.select(z > 0.0, tape.divide(tape.multiply(0.5, dx[0]), z), 0.0)


def _power(tape: Any, z: Any, x: Any, dx: Any) -> Any:
    (a, b), (da, db) = x, dx
    lower = tape.write(FLOAT, "pow", a, tape.subtract(b, 1.0) if isinstance(b, Symbol) else b - 1.0)
    change = _times(tape, da, tape.multiply(b, lower))
    if not _nothing(db):
        change = tape.add(change, tape.multiply(db, tape.multiply(z, tape.write(FLOAT, "log", a))))
    # whole exponents have a slope on both sides of zero, others have no value below zero
    return tape.select(a > 0.0, change, tape.select(a < 0.0, change, 0.0) if _nothing(db) else 0.0)


def _arctan2(tape: Any, z: Any, x: Any, dx: Any) -> Any:
    (a, b), (da, db) = x, dx
    square = tape.add(tape.multiply(a, a), tape.multiply(b, b))
    return tape.divide(tape.subtract(_times(tape, da, b), _times(tape, db, a)), square)


def _sign(tape: Any, a: Any) -> Any:
    return tape.write(FLOAT, "copysign", 1.0, a)


def _copysign(tape: Any, z: Any, x: Any, dx: Any) -> Any:
    return 0.0 if _nothing(dx[0]) else tape.multiply(dx[0], tape.multiply(_sign(tape, x[0]), _sign(tape, x[1])))


RULES: dict[str, Callable[[Any, Any, Any, Any], Any]] = {
    "add": lambda tape, z, x, dx: tape.add(*dx),
    "sub": lambda tape, z, x, dx: tape.subtract(*dx),
    "neg": lambda tape, z, x, dx: tape.negate(dx[0]),
    "mul": _product,
    "reciprocal": lambda tape, z, x, dx: tape.negate(tape.multiply(dx[0], tape.multiply(z, z))),
    "pow": _power,
    "sqrt": _root,
    "fabs": lambda tape, z, x, dx: tape.multiply(_sign(tape, x[0]), dx[0]),
    "sin": lambda tape, z, x, dx: tape.multiply(tape.write(FLOAT, "cos", x[0]), dx[0]),
    "cos": lambda tape, z, x, dx: tape.negate(tape.multiply(tape.write(FLOAT, "sin", x[0]), dx[0])),
    "tan": lambda tape, z, x, dx: tape.multiply(tape.add(1.0, tape.multiply(z, z)), dx[0]),
    "log": lambda tape, z, x, dx: tape.multiply(tape.write(FLOAT, "reciprocal", x[0]), dx[0]),
    "exp": lambda tape, z, x, dx: tape.multiply(z, dx[0]),
    "tanh": lambda tape, z, x, dx: tape.multiply(tape.subtract(1.0, tape.multiply(z, z)), dx[0]),
    "arctan2": _arctan2,
    "copysign": _copysign,
    "round": lambda tape, z, x, dx: 0.0,
    "select": lambda tape, z, x, dx: tape.select(x[0], dx[1], dx[2]),
}
