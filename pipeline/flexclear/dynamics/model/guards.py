"""Table of the guards, at which steps end (`integrate.guards`): levels and reversals at which forces have kinks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.contacts import friction_law
from flexclear.dynamics.model.loads import Loaded
from flexclear.dynamics.model.mechanism import Mechanism

#: (row of GUARDS, level, scale)
Guard = tuple[tuple[int, ...], float, float]


def fill(mechanism: Mechanism, of_effects: list[Guard], loaded: Loaded) -> dict[Any, Any]:
    """Return the tables GUARDS and GUARD_NUMBERS."""
    guards = [*_guards_of_contacts(mechanism), *of_effects, *_guards_of_loads(loaded)]
    return {
        m.GUARDS: [row for row, _, _ in guards],
        m.GUARD_NUMBERS: [(level, scale) for _, level, scale in guards],
    }


def speeds(table: Any, offset: int, count: int, levels: tuple[float, ...], contact: int = -1) -> Iterator[Guard]:
    """Yield guards of a sliding velocity at the speeds at which its law has kinks; a level of 0 means none."""
    for level in levels:
        if level > 0.0:
            yield (table.at, offset, count, contact, -1), level, level


def _guards_of_contacts(mechanism: Mechanism) -> Iterator[Guard]:
    for c, (_, joint, *_) in enumerate(mechanism.contacts):
        if joint.friction is not None:
            law = friction_law(joint)
            yield from speeds(m.TOUCH, c * m.TOUCH.size + m.TOUCH.slip, 1, law.kinks(joint.friction), c)


def _guards_of_loads(loaded: Loaded) -> Iterator[Guard]:
    for k, levels in enumerate(loaded.bends):
        for level in levels:
            yield (m.LOAD_BENDS.at, k * m.LOAD_BENDS.size, 1, -1, -1), level, level
