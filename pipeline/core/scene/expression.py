"""Expressions: one grammar of what is watched and of loads, and the check of their units.

Numbers with units, named constants and quantities, ``+ - * / ^``, parentheses and `FUNCTIONS`. An expression is read
into postfix order: leaves (numbers with their SI units as pairs, and quantities) and the names of operators. `fold`
evaluates that order in any algebra: of units, of numbers, of arrays, of lines of code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from flexclear.pipeline.core.scene import units

T = TypeVar("T")
#: functions of one argument, and those of two or more
FUNCTIONS = ("abs", "sqrt", "sin", "cos", "tan", "exp", "log", "tanh", "sign", "step", "norm")
SEVERAL = ("max", "min")
#: functions whose slope jumps where their argument, or the difference of the two, is zero; and whose value does
BENT, JUMPING = ("max", "min", "abs"), ("sign", "step")
#: operands of each operator
OPERANDS = {**dict.fromkeys((*"+-*/^", *SEVERAL), 2), **dict.fromkeys(("minus", *FUNCTIONS), 1)}
NUMBER, ANGLE = units.measured("1"), units.measured("rad")
#: exponents of a unit, those of a bare zero being any; dimension of the components; the value of a number
Measure = tuple[units.Exponents | None, str, float | None]

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])(?:\s*(?P<unit>"
    + "|".join(re.escape(u) for u in sorted(units.UNITS, key=len, reverse=True))
    + r")(?![\w.^]))?|(?P<name>[^\W\d][\w-]*(?:\.[\w-]+)*)|(?P<operator>[-+*/^(),]))\s*"
)


def fold(
    steps: Iterable[Any],
    leaf: Callable[[Any], T],
    apply: Callable[[str, list[T]], T],
    operands: Callable[[Any], int] = lambda step: OPERANDS[step] if isinstance(step, str) else 0,
) -> T:
    """Value of an expression in postfix order: `leaf` of each leaf, `apply` of each operator and its operands.

    operands: how many each step has, 0 of a leaf.
    """
    stack: list[T] = []
    for step in steps:
        if count := operands(step):
            stack[-count:] = [apply(step, stack[-count:])]
        else:
            stack.append(leaf(step))
    return stack[0]


def measure(steps: Sequence[Any]) -> tuple[units.Exponents, str]:
    """Exponents of the unit, and the dimension of the components; ValueError where the parts do not go together."""
    exponents, dim, _ = fold(steps, _measured, _combined)
    return exponents or NUMBER, dim


def with_name(text: str, name: str, other: str) -> str:
    """The expression with another text wherever it has a name."""
    return _TOKEN.sub(lambda token: f" {other} " if token["name"] == name else token[0], text)


def check_unit(steps: Sequence[Any], dimension: str, *, vector: bool = False) -> None:
    """ValueError unless an expression is a number, or a vector, of this dimension; a bare zero is of any."""
    exponents, dim, _ = fold(steps, _measured, _combined)
    if bool(dim) != vector:
        raise ValueError(
            "it is a number, but a vector belongs here: give three components"
            if vector
            else "it is a vector, but a number belongs here: take a component, or norm(...)"
        )
    needed = units.exponents(dimension)
    if exponents is not None and not _same(exponents, needed):
        turned = "; rad is a unit: divide by 1 rad" if _same((*exponents[:3], 0.0), needed) else ""
        raise ValueError(
            f"its value is in {units.si(exponents)}, but {units.a(dimension)} [{units.si(needed)}] belongs here{turned}"
        )


def _measured(leaf: Any) -> Measure:
    if not isinstance(leaf, tuple):
        return units.measured(leaf.unit), leaf.dim, None
    value, unit = leaf
    return None if value == 0.0 and unit == "1" else units.measured(unit), "", value


def _combined(operator: str, operands: list[Measure]) -> Measure:
    (a, first, _), (b, second, number) = operands[0], operands[-1]
    if operator == "minus":
        return a, first, None
    if operator == "norm":
        return a, "", None
    if operator in "*/":
        if second and (first or operator == "/"):
            raise ValueError("one of two vectors that are multiplied, or a divisor, must be a component, or norm(...)")
        sign = 1.0 if operator == "*" else -1.0
        return _sum(a or NUMBER, b or NUMBER, sign), first or second, None
    if operator in "+-" or operator in SEVERAL:
        if a is not None and b is not None and not _same(a, b):
            verb = "added or subtracted" if operator in "+-" else "compared"
            raise ValueError(f"{units.si(a)} and {units.si(b)} are not {verb}; numbers need their unit")
        if first != second:
            raise ValueError("a vector and a number are not added or subtracted; take a component, or norm(...)")
        if not first or operator in "+-":
            return a or b, first, None
    if first:
        raise ValueError(
            f"{operator if operator != '^' else 'a power'} takes no vector: take a component, or norm(...)"
        )
    if operator == "^":
        return _sum(NUMBER, a or NUMBER, number or 0.0), "", None
    if operator == "sqrt":
        return _sum(NUMBER, a or NUMBER, 0.5), "", None
    if operator in ("abs", *SEVERAL):
        return a, "", None
    takes = {"exp": (NUMBER,), "log": (NUMBER,)}.get(operator, (NUMBER, ANGLE))
    if operator not in ("sign", "step") and a is not None and not any(_same(a, one) for one in takes):
        raise ValueError(
            f"{operator}(...) takes a number{' or an angle' if ANGLE in takes else ''}, not a value in {units.si(a)}"
        )
    return NUMBER, "", None


def _sum(a: units.Exponents, b: units.Exponents, factor: float) -> units.Exponents:
    kg, m, s, rad = (round(x + factor * y, 9) for x, y in zip(a, b, strict=True))
    return kg, m, s, rad


def _same(a: units.Exponents | None, b: units.Exponents | None) -> bool:
    return a is not None and b is not None and all(abs(x - y) < 1e-6 for x, y in zip(a, b, strict=True))


class Reader:
    """Reads an expression into postfix order.

    term: the quantity of a name; ValueError where there is none.  constants: value and SI unit of each, by name.
    """

    def __init__(
        self, text: str, term: Callable[[str], Any], constants: Mapping[str, tuple[float, str]] | None = None
    ) -> None:
        self.text, self.term, self.constants, self.place = text, term, constants or {}, 0
        self.token = self._next()

    def whole(self) -> list[Any]:
        """The steps; ValueError for what is no expression."""
        steps = self._sum()
        if self.token is not None:
            raise self._misread()
        return steps

    def _misread(self) -> ValueError:
        return ValueError(
            f"'{self.text}' is no quantity: write <owner>.<quantity>, as in 'platform.velocity.x', or an expression of "
            "them with + - * / ^, parentheses, functions such as norm(...) and numbers with units, spaces around + and "
            "-"
        )

    def _next(self) -> re.Match[str] | None:
        if self.place == len(self.text):
            return None
        match = _TOKEN.match(self.text, self.place)
        if match is None:
            raise self._misread()
        self.place = match.end()
        return match

    def _take(self, *operators: str) -> str:
        """The operator that is next, where it is one of these; or nothing."""
        if self.token is None or self.token["operator"] not in operators:
            return ""
        taken: str = self.token["operator"]
        self.token = self._next()
        return taken

    def _close(self) -> None:
        if not self._take(")"):
            raise self._misread()

    def _sum(self) -> list[Any]:
        steps = self._product()
        while operator := self._take("+", "-"):
            steps += [*self._product(), operator]
        return steps

    def _product(self) -> list[Any]:
        steps = self._signed()
        while operator := self._take("*", "/"):
            steps += [*self._signed(), operator]
        return steps

    def _signed(self) -> list[Any]:
        if self._take("-"):
            return [*self._signed(), "minus"]
        steps = self._one()
        return [*steps, self._exponent(), "^"] if self._take("^") else steps

    def _exponent(self) -> tuple[float, str]:
        sign = -1.0 if self._take("-") else 1.0
        steps = self._one()
        if not all(isinstance(step, (tuple, str)) for step in steps) or measure(steps) != (NUMBER, ""):
            raise ValueError(f"'{self.text}': an exponent is a number without unit, as in x^1.5")
        return sign * fold(steps, lambda leaf: float(leaf[0]), _number), "1"

    def _one(self) -> list[Any]:
        if self._take("("):
            steps = self._sum()
            self._close()
            return steps
        token = self.token
        if token is None or token["operator"]:
            raise self._misread()
        self.token = self._next()
        if token["number"]:
            written = token["unit"]
            factor, unit = (units.UNITS[written][0], units.si(units.measured(written))) if written else (1.0, "1")
            return [(factor * float(token["number"]), unit)]
        name = token["name"]
        if name in (*FUNCTIONS, *SEVERAL) and self._take("("):
            return self._function(name)
        if name in self.constants:
            return [self.constants[name]]
        if name == "pi":
            return [(math.pi, "1")]
        term = self.term(name)
        if not term.over_time or term.dim == "quat":
            raise ValueError(f"'{name}' cannot be part of an expression: it is no number or vector over time")
        return [term]

    def _function(self, name: str) -> list[Any]:
        steps, count = self._sum(), 1
        while self._take(","):
            steps += [*self._sum(), name]
            count += 1
        self._close()
        if (count == 1) == (name in SEVERAL):
            raise ValueError(f"'{self.text}': {name}(...) takes {'two values or more' if count == 1 else 'one value'}")
        return steps if name in SEVERAL else [*steps, name]


def _number(operator: str, operands: list[float]) -> float:
    """Arithmetic in an exponent."""
    a, b = operands[0], operands[-1]
    try:
        return {"+": lambda: a + b, "-": lambda: a - b, "*": lambda: a * b, "/": lambda: a / b, "minus": lambda: -a}[
            operator
        ]()
    except (KeyError, ZeroDivisionError):
        raise ValueError("an exponent is a number, or a fraction such as (3/2)") from None
