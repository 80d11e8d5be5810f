"""What a load may depend on, and what it does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.joints.conditions import Along
from flexclear.dynamics.specialise.symbols import branch, sqrt
from flexclear.dynamics.vectors import ZERO, Matrix, Motion, Vector, Wrench, dot


class Law(NamedTuple):
    """Present value of a law of time, and its rate."""

    value: Any
    rate: Any


class Given(NamedTuple):
    """What a load may depend on; its numbers may be symbols.

    numbers: the load's own.  F, G: motion of the frames between which it acts, or G alone.  R_WL: axes of a vector's
    components.  coordinates: that along which it acts, then others that it measures.  read: frames and coordinates
    that an expression names.  tables: that it looks up.
    """

    numbers: Sequence[Any]
    laws: Sequence[Law]
    states: Sequence[Any]
    F: Motion
    G: Motion
    R_WL: Matrix
    coordinates: Sequence[Along]
    read: Sequence[Any]
    tables: Sequence[Any]

    @property
    def vector(self) -> Vector:
        """Three laws of time as a vector, axes of the world."""
        return self.R_WL @ Vector([law.value for law in self.laws])


class Load(NamedTuple):
    """What a load does: wrench on the second body about its frame's origin, power supplied and lost [W].

    states: rates of its states.  bends: values at whose zeros, or at whose levels, it has kinks.  stored: energy [J].
    """

    wrench: Wrench
    power: Any = 0.0
    lost: Any = 0.0
    states: Sequence[Any] = ()
    bends: Sequence[Any] = ()
    stored: Any = 0.0


def pushing(given: Given, size: Any) -> Load:
    """Return a load of given size along its coordinate; all of its power is work."""
    _, rate, unit = given.coordinates[0]
    return Load(unit * size, size * rate)


def pulling(given: Given, force: Vector, **more: Any) -> Load:
    """Return a force at the origin of G; all of its power is work."""
    return Load(Wrench(ZERO, force), dot(force, given.G.v), **more)


def line(given: Given) -> tuple[Any, Any, Vector, Vector]:
    """Return the distance of the origins, its rate, its direction (zero where they coincide), and the whole vector."""
    r = given.G.p_WB - given.F.p_WB
    length = sqrt(dot(r, r))
    direction = branch(length > 0.0, lambda: (1.0 / length) * r, lambda: ZERO)
    return length, dot(direction, given.G.v - given.F.v), direction, r
