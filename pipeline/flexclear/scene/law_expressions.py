"""Expressions of contact laws, in the form from which kernels are composed: structure as text, named values separately.

The text is the expression in postfix order, behind "expression", separated by commas: ``x0`` is its first variable,
``c0`` its first named value, ``^1.5`` a power, ``T0:5:4`` its first table (`scene.formulas`); other numbers are written
out. Laws that differ in values only have the same text, and share compiled code.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from flexclear.scene.expression import (
    Local,
    Lookup,
    check_unit,
    constants_of,
    fold,
    postfix,
    refuse_jump,
    require_used,
)
from flexclear.scene.fields import Number, Part
from flexclear.scene.laws import Value
from flexclear.scene.tables import LookupTable

#: variables of the normal force, at the end of an angle too, and of a coefficient of friction
NORMAL = {"depth": Local("x0", "m"), "rate": Local("x1", "m/s"), "impact_rate": Local("x2", "m/s")}
ANGULAR = {"depth": Local("x0", "rad"), "rate": Local("x1", "rad/s"), "impact_rate": Local("x2", "rad/s")}
SLIDING = {"slip": Local("x0", "m/s"), "normal_force": Local("x1", "N")}
#: most named values of an expression for a normal force, and of one for a coefficient of friction
MOST_NORMAL, MOST_SLIDING = 12, 6


#: tables of an expression as keys of a cache: each as a function, and how often its intervals are halved
Functions = tuple[tuple[Lookup, tuple[int, ...]], ...]


class _Law(Part):
    """Keys of all laws by an expression."""

    values: dict[str, Value] = Field(default_factory=dict)
    """named constants of the expression, each a number or text with its unit"""
    tables: dict[str, LookupTable] = Field(default_factory=dict)
    """named tables: ``table(NAME, ...)`` is the value of `tables.NAME` there"""

    @property
    def functions(self) -> Functions:
        """Each table as a function of its variables, with the halvings of its axes."""
        return tuple((one.function(name), one.halvings()) for name, one in self.tables.items())


def encode_law(
    text: str, values: Mapping[str, Any], variables: Mapping[str, Local], tables: Functions = ()
) -> tuple[str, tuple[float, ...]]:
    """Return structure and values of an expression, whose units `check` checks; raise ValueError for no expression."""
    return _encode_law(text, tuple(values.items()), tuple(variables.items()), tables)[:2]


def check(
    key: str,
    text: str,
    values: Mapping[str, Any],
    variables: Mapping[str, Local],
    dimension: str,
    tables: Functions = (),
) -> None:
    """Raise ValueError, in words, for an expression without meaning or of another dimension than its law."""
    try:
        _, numbers, steps = _encode_law(text, tuple(values.items()), tuple(variables.items()), tables)
        check_unit(steps, dimension)
    except ValueError as error:
        raise ValueError(f"{key} = '{text}': {error}") from None
    most = MOST_SLIDING if variables is SLIDING else MOST_NORMAL
    if len(numbers) > most:
        raise ValueError(f"{key} = '{text}': it has {len(numbers)} values, at most {most}: write numbers for others")


@lru_cache(maxsize=256)
def _encode_law(
    text: str, given: tuple[tuple[str, Any], ...], variables: tuple[tuple[str, Local], ...], tables: Functions
) -> tuple[str, tuple[float, ...], tuple[Any, ...]]:
    known = dict(variables)
    constants = constants_of({name: value for name, value in given if name != "restitution"}, (*known, "restitution"))
    require_used(constants, (text,))
    names = [one.name for one, _ in tables]
    require_used(names, (text,), "tables")
    constants |= {name: (float(value), "1") for name, value in given if name == "restitution"}

    def variable(name: str) -> Local:
        if name not in known:
            more = ", ".join([*known, *constants])
            raise ValueError(f"'{name}' is unknown: a contact law depends on its own contact alone, here on {more}")
        return known[name]

    steps = postfix(text, variable, constants, {one.name: one for one, _ in tables})
    for step in steps:
        refuse_jump(step)
    places = {id(one): f"c{k}" for k, one in enumerate(constants.values())}

    def leaf(step: Any) -> str:
        return step.letter if isinstance(step, Local) else places.get(id(step), repr(step[0]))

    def apply(operator: Any, operands: list[str]) -> str:
        if isinstance(operator, Lookup):
            k = names.index(operator.name)
            return ",".join([*operands, ":".join([f"T{k}", *map(str, tables[k][1])])])
        if operator == "^" and operands[1][0] != "c":
            return f"{operands[0]},^{operands[1]}"
        return ",".join([*operands, operator])

    return f"expression,{fold(steps, leaf, apply)}", tuple(value for value, _ in constants.values()), tuple(steps)


class NormalExpression(_Law):
    """A law of one's own: the normal force as an expression, which is never negative where the run uses it.

    Variables are the penetration `depth`, its rate, and `impact_rate`, the rate at which this contact began. What the
    force is at rate 0 is stored, the rest is damping.
    """

    law: Literal["expression"]
    force: str
    """the expression, as ``K*depth^1.5*(1 + a*rate/impact_rate)``"""
    restitution: Annotated[Number, Field(ge=0.0, le=1.0)] | None = None
    """restitution that the damping is meant to cause; the expression may contain it"""

    stiffness: ClassVar[None] = None
    needs_mass: ClassVar[bool] = False
    needs_materials: ClassVar[bool] = False

    @property
    def named(self) -> dict[str, Any]:
        """Named values of the expression, the restitution last."""
        return self.values | ({} if self.restitution is None else {"restitution": self.restitution})

    @property
    def encoded(self) -> tuple[str, tuple[float, ...]]:
        """Structure and values of the expression (`encode_law`)."""
        return encode_law(self.force, self.named, NORMAL, self.functions)

    @property
    def kind(self) -> str:
        """Return the structure of the expression."""
        return self.encoded[0]

    def check(self, *, turning: bool = False) -> None:
        """Raise ValueError, in words, for an expression without meaning. turning: for the end of an angle."""
        variables, dimension = (ANGULAR, "torque") if turning else (NORMAL, "force")
        check("normal.force", self.force, self.named, variables, dimension, self.functions)


class FrictionExpression(_Law):
    """A law of one's own: the coefficient of friction as an expression of the sliding speed and the normal force."""

    law: Literal["expression"]
    coefficient: str
    """the expression of `slip` and `normal_force`, zero at rest, as ``mu*tanh(slip/v)``"""

    @property
    def encoded(self) -> tuple[str, tuple[float, ...]]:
        """Structure and values of the expression (`encode_law`)."""
        return encode_law(self.coefficient, self.values, SLIDING, self.functions)

    @property
    def kind(self) -> str:
        """Return the structure of the expression."""
        return self.encoded[0]

    def check(self) -> None:
        """Raise ValueError, in words, for an expression without meaning."""
        check("friction.coefficient", self.coefficient, self.values, SLIDING, "number", self.functions)
