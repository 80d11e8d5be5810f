"""Expressions of loads in the form from which code is generated: structure as text, numbers separately.

The text is the expression in postfix order: ``c0`` is its first number, ``p0.x`` a component of a position that it
reads, ``q1`` a joint coordinate, ``t`` the time, ``T0:5:4`` the first table, over two quantities, whose intervals are
halved 5 and 4 times to find one. Expressions that differ only in numbers and names have the same text,
and share compiled code.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from flexclear.scene.expression import (
    BENT,
    OPERANDS,
    Local,
    Lookup,
    check_unit,
    constants_of,
    fold,
    measure,
    refuse_jump,
    require_used,
)
from flexclear.scene.loads import EXPRESSIONS, JointExpression, LineExpression, PointExpression
from flexclear.scene.owners import is_angle
from flexclear.scene.parts import FlexibleBody
from flexclear.scene.quantity import KINDS, Quantity, read_expression
from flexclear.scene.tables import LookupTable

#: quantities that follow from positions and velocities: letter of their leaves
READ = {
    "position": "p",
    "velocity": "v",
    "angular_velocity": "o",
    "frame_position": "p",
    "joint_position": "q",
    "joint_velocity": "r",
    "t": "t",
}
#: letters of vectors
VECTORS = "pvo"
#: largest exponent computed by multiplication
WHOLE = 8


#: names that an expression along a line may use
OF_LINES = {"length": Local("l", "m"), "rate": Local("s", "m/s")}


@dataclass(frozen=True)
class Formula:
    """Expressions of one load.

    code: their structure, separated by ``;``. numbers: SI values. reads: kind (``body``, ``frame`` or ``coordinate``)
    and name of every component that is read. tables: those that are looked up.
    """

    code: str
    numbers: tuple[float, ...]
    reads: tuple[tuple[str, str], ...]
    tables: tuple[LookupTable, ...] = ()

    @property
    def bends(self) -> int:
        """Number of functions whose slope jumps where their argument is zero."""
        return sum(token in BENT for token in self.code.split())


def operands(token: str) -> int:
    """Return the number of operands of a token of a code; 0 for a leaf."""
    return token.count(":") or (1 if token[0] == "^" and len(token) > 1 else OPERANDS.get(token, 0))


def formula(scene: Any, name: str) -> Formula | None:
    """Return the formula of a load of a scene; None for a load without an expression.

    Raises ValueError, in words, for an expression that cannot be computed or has another unit than the load.
    """
    load = scene.load.get(name)
    if not isinstance(load, EXPRESSIONS):
        return None
    dimension = "torque" if isinstance(load, JointExpression) and is_angle(scene, load) else "force"
    vector = isinstance(load, PointExpression) and isinstance(load.force, str)
    numbers, reads, codes = list[float](), list[tuple[str, str]](), list[str]()
    for text, steps in expressions_of_load(scene, load):
        try:
            measure(steps)
            for step in steps:
                _check(scene, step)
            check_unit(steps, dimension, vector=vector)
        except ValueError as error:
            raise ValueError(f"force = '{text}': {error}") from None
        codes.append(_encode(steps, numbers, reads, load.tables))
    return Formula(" ; ".join(codes), tuple(numbers), tuple(reads), tuple(load.tables.values()))


def expressions_of_load(scene: Any, load: Any) -> Iterator[tuple[str, list[Any]]]:
    """Yield each expression of a load, and its postfix order; raise ValueError, in words, for one without meaning."""
    known, local = constants_of(load.values, OF_LINES), OF_LINES if isinstance(load, LineExpression) else None
    require_used(known, load.texts)
    require_used(load.tables, load.texts, "tables")
    tables = {name: one.function(name) for name, one in load.tables.items()}
    for text in load.texts:
        try:
            yield text, read_expression(text, scene.owners(), known, local, tables)
        except ValueError as error:
            raise ValueError(f"force = '{text}': {error}") from None


def check_formulas(scene: Any) -> None:
    """Raise ValueError, with the load's name, for an expression of a scene that cannot be computed."""
    for name in scene.forces():
        try:
            formula(scene, name)
        except ValueError as error:
            raise ValueError(f"load.{name}: {error}") from None
    for path, law, turning in laws_by_expression(scene):
        try:
            law.check(**turning)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def laws_by_expression(scene: Any) -> Iterator[tuple[str, Any, dict[str, bool]]]:
    """Yield each contact law by an expression: where it is, the law, and for a stop whether it ends an angle."""
    for name, joint in scene.joint.items():
        for law in (getattr(joint, "normal", None), joint.friction):
            if law is not None and law.law == "expression":
                yield f"joint.{name}", law, {}
    for name, stop in scene.stops().items():
        if stop.end_law.law == "expression":
            yield f"{stop.family}.{name}", stop.end_law, {"turning": is_angle(scene, stop)}


def _check(scene: Any, step: Any) -> None:
    """Raise ValueError for a step that no load can compute."""
    refuse_jump(step)
    if not isinstance(step, Quantity):
        return
    if step.kind not in READ:
        raise ValueError(
            f"'{step.name}' depends on more than positions and velocities, so no load can depend on it: use "
            f"{', '.join(READ)}"
        )
    if KINDS[step.kind].owner == "body" and isinstance(scene.body[step.owner], FlexibleBody):
        raise ValueError(f"'{step.name}' belongs to a flexible body: use the frame_position of one of its frames")


def _encode(
    steps: list[Any], numbers: list[float], reads: list[tuple[str, str]], tables: Mapping[str, LookupTable]
) -> str:
    def leaf(step: Any) -> str:
        if isinstance(step, tuple):
            numbers.append(step[0])
            return f"c{len(numbers) - 1}"
        if isinstance(step, Local):
            return step.letter
        owner, letter = KINDS[step.kind].owner, READ[step.kind]
        if not owner:
            return letter
        if (owner, step.owner) not in reads:
            reads.append((owner, step.owner))
        return f"{letter}{reads.index((owner, step.owner))}" + (f".{step.component}" if step.component else "")

    def apply(operator: Any, operands: list[str]) -> str:
        if isinstance(operator, Lookup):
            levels = "".join(f":{one}" for one in tables[operator.name].halvings())
            return " ".join([*operands, f"T{list(tables).index(operator.name)}{levels}"])
        exponent = numbers[-1] if operator == "^" else 0.5
        if exponent == int(exponent) and 0 < abs(exponent) <= WHOLE:
            numbers.pop()
            return f"{operands[0]} ^{int(exponent)}"
        return " ".join([*operands, operator])

    return fold(steps, leaf, apply)
