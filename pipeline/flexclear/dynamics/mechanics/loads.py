"""Loads: a table. What each does between two frames F and G, or on G alone, from what it is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from operator import mul
from typing import Any, NamedTuple

from flexclear.dynamics.contact.friction.modified_coulomb import coefficient
from flexclear.dynamics.mechanics.bushings import bushing
from flexclear.dynamics.mechanics.coordinates import Along, along
from flexclear.dynamics.mechanics.lookup import curve, surface
from flexclear.dynamics.mechanics.trees import End, Motion, Numbers, carried, on_both
from flexclear.dynamics.mechanics.vectors import UNIT, ZERO, Matrix, Vector, Wrench, dot
from flexclear.dynamics.routines import symbols
from flexclear.dynamics.routines.calls import Indexed, routine
from flexclear.dynamics.routines.symbols import branch, larger, select, shared, smaller, sqrt
from flexclear.scene.expression import BENT, fold
from flexclear.scene.formulas import operands


class Law(NamedTuple):
    """Present value of a law of time, and its rate."""

    value: Any
    rate: Any


class Given(NamedTuple):
    """What a load may depend on. R_WL: axes of the components of a vector.

    numbers: the load's own; then a span for each table.  coordinates: that along which the load acts, then others that
    it measures.  read: frames and coordinates that an expression names.
    """

    numbers: Numbers
    laws: Sequence[Law]
    states: Numbers
    F: Motion
    G: Motion
    R_WL: Matrix
    coordinates: Sequence[Along]
    read: Sequence[Any]


class Load(NamedTuple):
    """What a load does: wrench on the second body about its frame's origin, power supplied and lost [W].

    states: rates of its states.  bends: values at whose zeros, or at whose levels, it has kinks.  stored: energy [J].
    """

    wrench: Wrench
    power: Any = 0.0
    lost: Any = 0.0
    states: Numbers = ()
    bends: Numbers = ()
    stored: Any = 0.0


# Along a joint coordinate -------------------------------------------------------------------------------------------
def pushing(given: Given, size: Any) -> Load:
    """Return a load of given size along the coordinate; all of its power is work."""
    _, rate, unit = given.coordinates[0]
    return Load(unit * size, size * rate)


def joint_force(given: Given) -> Load:
    """Return a force by a law of time."""
    return pushing(given, given.laws[0].value)


def joint_spring(given: Given) -> Load:
    """Return the force of a spring and a damper."""
    (stiffness, damping, rest), (value, rate, unit) = given.numbers, given.coordinates[0]
    stretch, damped = value - rest, damping * rate
    stored = 0.5 * stiffness * stretch * stretch
    return Load(unit * -(stiffness * stretch + damped), lost=damped * rate, stored=stored)


def joint_friction(given: Given) -> Load:
    """Return viscous and dry friction of given strength."""
    (viscous, *dry), (_, rate, unit) = given.numbers, given.coordinates[0]
    strength = shared(coefficient)(abs(rate), dry)
    size = -viscous * rate - select(rate >= 0.0, strength, -strength)
    return Load(unit * size, lost=-size * rate, bends=[rate])


def pid(given: Given) -> Load:
    """Return the force of a controller within its limits, with the integral part as state, which tracks them.

    Source: Astrom & Hagglund (1995), PID Controllers: Theory, Design, and Tuning, 2nd ed., sec. 3.5.
    """
    proportional, integral, derivative, least, most, tracking = given.numbers
    (_, speed, unit), (value, rate, _), law = *given.coordinates, given.laws[0]
    error = law.value - value
    asked = proportional * error + given.states[0] + derivative * (law.rate - rate)
    size = smaller(larger(asked, least), most)
    return Load(unit * size, size * speed, states=[integral * error + tracking * (size - asked)])


def sampled_pid(given: Given) -> Load:
    """Return the force that a controller holds between samples, the first of its states."""
    return pushing(given, given.states[0])._replace(states=[0.0] * len(given.states))


def joint_expression(given: Given, formula: str) -> Load:
    """Return a force by an expression."""
    (size,), bends = evaluated(given, formula)
    return pushing(given, size)._replace(bends=bends)


# Between two points ---------------------------------------------------------------------------------------------------
def line(given: Given) -> tuple[Any, Any, Vector, Vector]:
    """Return the distance of the origins, its rate, its direction (zero where they coincide), and the whole vector."""
    r = given.G.p_WB - given.F.p_WB
    length = sqrt(dot(r, r))
    direction = branch(length > 0.0, lambda: (1.0 / length) * r, lambda: ZERO)
    return length, dot(direction, given.G.v - given.F.v), direction, r


def spring_damper(given: Given) -> Load:
    """Return the force of a spring and a damper; its part -k r keeps its slope where the points coincide."""
    (stiffness, damping, free), (length, rate, direction, r) = given.numbers, line(given)
    stretch, damped = length - free, damping * rate
    wrench = Wrench(ZERO, (stiffness * free - damped) * direction - stiffness * r)
    return Load(wrench, lost=damped * rate, stored=0.5 * stiffness * stretch * stretch)


def line_expression(given: Given, formula: str) -> Load:
    """Return a tension by an expression."""
    (tension,), bends = evaluated(given, formula)
    _, rate, direction, _ = line(given)
    return Load(Wrench(ZERO, -tension * direction), -tension * rate, bends=bends)


def mount(given: Given) -> Load:
    """Return the wrench of a bushing."""
    wrench, power, lost, states, stored = bushing(given.numbers, given.states, given.F, given.G)
    return Load(wrench, power, lost, states, stored=stored)


# On one point ---------------------------------------------------------------------------------------------------------
def point_force(given: Given) -> Load:
    """Return a force by three laws of time."""
    force = given.R_WL @ Vector([law.value for law in given.laws])
    return Load(Wrench(ZERO, force), dot(force, given.G.v))


def point_torque(given: Given) -> Load:
    """Return a torque by three laws of time."""
    torque = given.R_WL @ Vector([law.value for law in given.laws])
    return Load(Wrench(torque, ZERO), dot(torque, given.G.omega))


def point_expression(given: Given, formula: str) -> Load:
    """Return a force by three expressions, or by one that is a vector."""
    components, bends = evaluated(given, formula)
    force = given.R_WL @ Vector(components[0] if len(components) == 1 else components)
    return Load(Wrench(ZERO, force), dot(force, given.G.v), bends=bends)


# Expressions ----------------------------------------------------------------------------------------------------------
#: operations on numbers, or on vectors where these may be
OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: (1.0 / b) * a if isinstance(a, Vector) else a / b,
    "^": lambda a, b: a**b,
    "minus": lambda a: -a,
    "abs": abs,
    "max": larger,
    "min": smaller,
    "norm": lambda a: sqrt(dot(a, a)) if isinstance(a, Vector) else abs(a),
    **{name: getattr(symbols, name) for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh")},
}
#: how a leaf reads what it names
LEAVES: dict[str, Callable[[Given, int], Any]] = {
    "c": lambda given, k: given.numbers[3 + k],
    "p": lambda given, k: given.read[k].p_WB + Vector(given.numbers[:3]),  # the origin of all positions
    "v": lambda given, k: given.read[k].v,
    "o": lambda given, k: given.read[k].omega,
    "q": lambda given, k: given.read[k].value,
    "r": lambda given, k: given.read[k].rate,
    "t": lambda given, k: given.laws[0].value,
    "l": lambda given, k: line(given)[0],
    "s": lambda given, k: line(given)[1],
}


def evaluated(given: Given, formula: str) -> tuple[list[Any], list[Any]]:
    """Return the values of a formula (`scene.formulas`), and those at whose zeros its slope jumps."""
    bends = list[Any]()

    def leaf(token: str) -> Any:
        name, _, component = token.partition(".")
        value = LEAVES[name[0]](given, int(name[1:] or 0))
        return value["xyz".index(component)] if component else value

    def apply(token: str, values: list[Any]) -> Any:
        if token in BENT:
            bends.append(values[0] - values[1] if len(values) == 2 else values[0])
        if ":" in token:
            table, *levels = map(int, token[1:].split(":"))
            spans = [one for one in given.numbers if isinstance(one, Indexed)]
            return (curve, surface)[len(levels) - 1](spans[table], *levels, *values)
        exponent = int(token[1:]) if token[0] == "^" and token[1:] else 0
        if exponent:
            product = reduce(mul, values * abs(exponent))
            return product if exponent > 0 else 1.0 / product
        return OPERATIONS[token](*values)

    return [fold(part.split(), leaf, apply, operands) for part in formula.split(" ; ")], bends


LOADS: dict[str, Callable[..., Load]] = {
    "joint-force": joint_force,
    "joint-spring": joint_spring,
    "joint-friction": joint_friction,
    "joint-expression": joint_expression,
    "pid": pid,
    "sampled-pid": sampled_pid,
    "spring-damper": spring_damper,
    "line-expression": line_expression,
    "bushing": mount,
    "point-force": point_force,
    "point-torque": point_torque,
    "point-expression": point_expression,
}
#: numbers of states of a load
STATES = {"pid": 1, "sampled-pid": 3, "bushing": 3}


@routine
def act(
    kind: Sequence[str],
    follows: int,
    numbers: Numbers,
    laws: Sequence[Law],
    states: Numbers,
    gauged: Sequence[tuple[Any, Numbers, int, int]],
    read: Sequence[tuple[int, int]],
    shown: tuple[str, int] | tuple[()],
    *ends: End,
) -> Any:
    """Return the rates of a load's states and turns, and its bends; the wrenches on both bodies; its powers.

    kind: its type and, of an expression, the formula.  follows: 1 when its components are in axes of G.  gauged: of
    each coordinate the gauge, its turns, and the numbers of its frames among the ends.  read: (0, frame) or
    (1, coordinate) of each that an expression names.  shown: what the record, a row of `memory.LOAD` after the bends,
    has for its length: a "coordinate", the "distance" of the frames, or "nothing"; () without record.
    """
    frames = [carried(*end) for end in ends]
    coordinates = [along(gauge, turns, frames[i], frames[j]) for gauge, turns, i, j in gauged]
    F, G = frames[:2]
    R_WL = G.R_WB if follows else UNIT
    given = Given(numbers, laws, states, F, G, R_WL, coordinates, [(frames, coordinates)[sort][k] for sort, k in read])
    load = LOADS[kind[0]](given, *kind[1:])
    turning = [one.rate for one, (_, turns, _, _) in zip(coordinates, gauged, strict=True) if turns]
    stored = [load.states, turning, load.bends]
    if shown:
        (M, force), (what, k) = load.wrench.about(G.p_WB), shown
        value, rate = (
            coordinates[k][:2] if what == "coordinate" else line(given)[:2] if what == "distance" else (0.0, 0.0)
        )
        stored.append([force, M, value, rate, load.stored, load.power, load.lost])
    return stored, on_both(ends[:2], G, load.wrench), (load.power, load.lost)
