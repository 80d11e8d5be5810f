"""Expressions of watched quantities and of loads: one grammar, and the check of units.

An expression consists of numbers with units, named constants and quantities, ``+ - * / ^``, parentheses and
`FUNCTIONS`. It is read into postfix order: leaves (numbers with their SI units as pairs, and quantities) and names of
operators. `fold` evaluates that order in any algebra: of units, of numbers, of arrays, of lines of code.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from flexclear.scene import units

T = TypeVar("T")
#: functions of one argument, and functions of two or more
FUNCTIONS = ("abs", "sqrt", "sin", "cos", "tan", "exp", "log", "tanh", "sign", "step", "norm")
SEVERAL = ("max", "min")
#: functions whose slope, and functions whose value jumps where their argument, or the difference of the two, is zero
BENT, JUMPING = ("max", "min", "abs"), ("sign", "step")
#: operands of each operator
OPERANDS = {**dict.fromkeys((*"+-*/^", *SEVERAL), 2), **dict.fromkeys(("minus", *FUNCTIONS), 1)}
NUMBER, ANGLE = units.unit_exponents("1"), units.unit_exponents("rad")
#: exponents of a unit (None for a bare zero, which fits any); dimension of the components; the value of a number
Measure = tuple[units.Exponents | None, str, float | None]

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])(?:\s*(?P<unit>"
    + "|".join(re.escape(u) for u in sorted(units.UNITS, key=len, reverse=True))
    + r")(?![\w.^]))?|(?P<name>[^\W\d][\w-]*(?:\.[\w-]+)*)|(?P<operator>[-+*/^(),]))\s*"
)


@dataclass(frozen=True)
class Lookup:
    """A table as a function in an expression. name: of the table; of, value: SI units of its columns."""

    name: str
    of: tuple[str, ...]
    value: str


@dataclass(frozen=True)
class Local:
    """A name that exists only in loads of one kind: its letter and SI unit."""

    letter: str
    unit: str
    dim: str = ""
    over_time: bool = True


def operands_of(step: Any) -> int:
    """Return the number of operands of a step that is no name of an operator: 0 for a leaf."""
    return len(step.of) if isinstance(step, Lookup) else 0


def fold(
    steps: Iterable[Any],
    leaf: Callable[[Any], T],
    apply: Callable[[str, list[T]], T],
    operands: Callable[[Any], int] = lambda step: OPERANDS[step] if isinstance(step, str) else operands_of(step),
) -> T:
    """Evaluate an expression in postfix order: `leaf` for each leaf, `apply` for each operator and its operands.

    operands: number of operands of each step, 0 for a leaf.
    """
    stack: list[T] = []
    for step in steps:
        if count := operands(step):
            stack[-count:] = [apply(step, stack[-count:])]
        else:
            stack.append(leaf(step))
    return stack[0]


def measure(steps: Sequence[Any]) -> tuple[units.Exponents, str]:
    """Return the exponents of the unit, and the dimension of the components; raise ValueError where units conflict."""
    exponents, dim, _ = fold(steps, _measure_of_leaf, _measure_of_operation)
    return exponents or NUMBER, dim


def with_name(text: str, name: str, other: str) -> str:
    """Return the expression with another text wherever it contains a name."""
    return _TOKEN.sub(lambda token: f" {other} " if token["name"] == name else token[0], text)


def constants_of(values: Mapping[str, Any], taken: Iterable[str] = ("length", "rate")) -> dict[str, tuple[float, str]]:
    """Return value and SI unit of named constants; raise ValueError for an invalid name. taken: names of quantities."""
    known = {}
    for name, value in values.items():
        if not re.fullmatch(r"[^\W\d]\w*", name) or name in (*FUNCTIONS, *SEVERAL, "t", "time", "pi", *taken):
            raise ValueError(
                f"values.{name}: '{name}' cannot name a constant: choose letters, digits and _, but no function, "
                + re.sub(", (\\w+)$", r" or \1", ", ".join(("t", "pi", *taken)))
            )
        number, _, unit = value.partition(" ") if isinstance(value, str) else (value, "", "1")
        known[name] = float(number), unit
    return known


def require_used(known: Iterable[str], texts: Sequence[str], family: str = "values") -> None:
    """Raise ValueError for a constant, or a table, that no text uses."""
    for name in known:
        if not any(re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", text) for text in texts):
            raise ValueError(f"{family}.{name} is not used: remove it, or name it in the expression")


def refuse_jump(step: Any) -> None:
    """Raise ValueError for a function that jumps."""
    if step in JUMPING:
        raise ValueError(
            f"{step}(...) jumps, and integration steps cannot cross a jump: write a steep tanh(...), or a ramp of "
            "min(...) and max(...)"
        )


def check_unit(steps: Sequence[Any], dimension: str, *, vector: bool = False) -> None:
    """Raise ValueError unless an expression is a number, or a vector, of this dimension; a bare zero fits any."""
    exponents, dim, _ = fold(steps, _measure_of_leaf, _measure_of_operation)
    if bool(dim) != vector:
        raise ValueError(
            "it is a number, but a vector is expected: give three components"
            if vector
            else "it is a vector, but a number is expected: take a component, or norm(...)"
        )
    needed = units.exponents(dimension)
    if exponents is not None and not _same_units(exponents, needed):
        turned = "; rad is a unit: divide by 1 rad" if _same_units((*exponents[:3], 0.0), needed) else ""
        raise ValueError(
            f"its value is in {units.si_unit(exponents)}, but {units.with_article(dimension)} "
            f"[{units.si_unit(needed)}] is expected{turned}"
        )


def _measure_of_leaf(leaf: Any) -> Measure:
    if not isinstance(leaf, tuple):
        return units.unit_exponents(leaf.unit), leaf.dim, None
    value, unit = leaf
    return None if value == 0.0 and unit == "1" else units.unit_exponents(unit), "", value


def _measure_of_operation(operator: Any, operands: list[Measure]) -> Measure:
    if isinstance(operator, Lookup):
        for unit, (exponents, dim, _) in zip(operator.of, operands, strict=True):
            if dim or (exponents is not None and not _same_units(exponents, units.unit_exponents(unit))):
                given = "a vector" if dim or exponents is None else f"a value in {units.si_unit(exponents)}"
                raise ValueError(f"table({operator.name}, ...) is over a value in {unit}, not {given}")
        return units.unit_exponents(operator.value), "", None
    (a, first, _), (b, second, number) = operands[0], operands[-1]
    if operator == "minus":
        return a, first, None
    if operator == "norm":
        return a, "", None
    if operator in "*/":
        if second and (first or operator == "/"):
            raise ValueError("no products of two vectors, no vector divisors: take a component, or norm(...)")
        sign = 1.0 if operator == "*" else -1.0
        return _sum(a or NUMBER, b or NUMBER, sign), first or second, None
    if operator in "+-" or operator in SEVERAL:
        if a is not None and b is not None and not _same_units(a, b):
            verb = "added or subtracted" if operator in "+-" else "compared"
            raise ValueError(f"{units.si_unit(a)} and {units.si_unit(b)} cannot be {verb}; give numbers their unit")
        if first != second:
            raise ValueError("a vector and a number cannot be added or subtracted; take a component, or norm(...)")
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
    if operator not in ("sign", "step") and a is not None and not any(_same_units(a, one) for one in takes):
        raise ValueError(
            f"{operator}(...) takes a number{' or an angle' if ANGLE in takes else ''}, "
            f"not a value in {units.si_unit(a)}"
        )
    return NUMBER, "", None


def _sum(a: units.Exponents, b: units.Exponents, factor: float) -> units.Exponents:
    kg, m, s, rad = (round(x + factor * y, 9) for x, y in zip(a, b, strict=True))
    return kg, m, s, rad


def _same_units(a: units.Exponents | None, b: units.Exponents | None) -> bool:
    return a is not None and b is not None and all(abs(x - y) < 1e-6 for x, y in zip(a, b, strict=True))


def postfix(
    text: str,
    term: Callable[[str], Any],
    constants: Mapping[str, tuple[float, str]] | None = None,
    tables: Mapping[str, Lookup] | None = None,
) -> list[Any]:
    """Return an expression in postfix order; raise ValueError for other text.

    term: returns the quantity of a name, or raises ValueError. constants: value and SI unit of each, by name. tables:
    those of loads, by name.
    """
    words, leaves = _as_python(text)

    def steps(node: ast.AST) -> list[Any]:
        rights = []
        while isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:  # no recursion: long sums nest to the left
            rights.append((node.right, _OPERATORS[type(node.op)]))
            node = node.left
        match node:
            case ast.Name(id=name) if name.startswith("_"):
                own = [_leaf(leaves[int(name[1:])], term, constants or {})]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                own = [*steps(operand), "minus"]
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                own = [*steps(left), _exponent(text, steps(right)), "^"]
            case ast.Call(func=ast.Name(id="table"), args=[ast.Name(id=name), *more], keywords=[]) if name[:1] == "_":
                own = _lookup(leaves[int(name[1:])][0].strip(), [steps(one) for one in more], tables)
            case ast.Call(func=ast.Name(id=name), args=[first, *more], keywords=[]) if not name.startswith("_"):
                if bool(more) != (name in SEVERAL):
                    count = "one value" if more else "two values or more"
                    raise ValueError(f"'{text}': {name}(...) takes {count}")
                own = steps(first) + [step for one in more for step in (*steps(one), name)]
                own += [] if more else [name]
            case _:
                raise _misread_error(text)
        return own + [step for right, operator in reversed(rights) for step in (*steps(right), operator)]

    try:
        return steps(ast.parse(" ".join(words), mode="eval").body)
    except (RecursionError, MemoryError):
        raise ValueError(f"'{_shorten(text)}' is too long or too deeply nested") from None
    except SyntaxError:
        raise _misread_error(text) from None


#: characters of an expression that a message shows
LONGEST_SHOWN = 200
_OPERATORS: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


def _as_python(text: str) -> tuple[list[str], list[re.Match[str]]]:
    """Return the words of an expression with its leaves replaced by names, ``_0`` the first, and the leaves."""
    text = units.DEGREES.sub(" deg", text)
    words, leaves, place = list[str](), list[re.Match[str]](), 0
    while place < len(text):
        token = _TOKEN.match(text, place)
        if token is None or (token["operator"] == ")" and words[-1:] == [","]):
            raise _misread_error(text)
        place = token.end()
        if token["operator"]:
            words.append(token["operator"].replace("^", "**"))
        elif token["name"] in (*FUNCTIONS, *SEVERAL, "table") and text.startswith("(", place):
            words.append(token["name"])
        else:
            words.append(f"_{len(leaves)}")
            leaves.append(token)
    return words, leaves


def _leaf(token: re.Match[str], term: Callable[[str], Any], constants: Mapping[str, tuple[float, str]]) -> Any:
    if token["number"]:
        written = token["unit"]
        factor, unit = (
            (units.UNITS[written][0], units.si_unit(units.unit_exponents(written))) if written else (1.0, "1")
        )
        value = factor * float(token["number"])
        if not math.isfinite(value):
            raise ValueError(f"{token[0].strip()} is too large: the largest number is 1.8e308")
        return value, unit
    name = token["name"]
    if name in constants:
        return constants[name]
    if name == "pi":
        return math.pi, "1"
    quantity = term(name)
    if not quantity.over_time or quantity.dim == "quat":
        raise ValueError(f"'{name}' cannot be part of an expression: it is neither a number nor a vector over time")
    return quantity


def _lookup(name: str, values: list[list[Any]], tables: Mapping[str, Lookup] | None) -> list[Any]:
    if tables is None:
        raise ValueError("table(...) is for loads by an expression; a law of time reads a file by type = 'table'")
    if name not in tables:
        known = ", ".join(tables) or "none"
        raise ValueError(f"there is no table '{name}' (known: {known}): give tables.{name} its file and columns")
    if len(values) != len(tables[name].of):
        raise ValueError(f"table({name}, ...) is over {len(tables[name].of)} quantities, not {len(values)}")
    return [step for one in values for step in one] + [tables[name]]


def _exponent(text: str, steps: list[Any]) -> Any:
    if not all(isinstance(step, (tuple, str)) for step in steps) or measure(steps) != (NUMBER, ""):
        raise ValueError(f"'{text}': an exponent is a number without unit, as in x^1.5")
    if len(steps) == 1:
        return steps[0]  # a named constant stays one
    return fold(steps, lambda leaf: float(leaf[0]), _number), "1"


def _shorten(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."


def _misread_error(text: str) -> ValueError:
    return ValueError(
        f"'{_shorten(text)}' is not a quantity: write <owner>.<quantity>, as in 'platform.velocity.x', or combine "
        "them with + - * / ^, parentheses, functions such as norm(...) and numbers with units, spaces around + and -"
    )


def _number(operator: str, operands: list[float]) -> float:
    """Evaluate an operator in an exponent."""
    a, b = operands[0], operands[-1]
    try:
        return {"+": lambda: a + b, "-": lambda: a - b, "*": lambda: a * b, "/": lambda: a / b, "minus": lambda: -a}[
            operator
        ]()
    except (KeyError, ZeroDivisionError):
        raise ValueError("an exponent is a number, or a fraction such as (3/2)") from None
