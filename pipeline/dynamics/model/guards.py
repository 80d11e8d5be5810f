"""The table of the guards, on which steps end (`integrate.guards`): levels and reversals that bend friction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects import FRICTION_LAWS
from flexclear.pipeline.dynamics.joints.bearings import BEARINGS
from flexclear.pipeline.dynamics.model.loads import Loaded
from flexclear.pipeline.dynamics.model.mechanism import Mechanism

#: what presses a bearing, by its field of BENDS, and how many components it has
PRESSES = {"along": 1, "about": 1, "one_end": 2, "other_end": 2}
#: (row of GUARDS, level, scale)
Guard = tuple[tuple[int, ...], float, float]


def fill(mechanism: Mechanism, loaded: Loaded) -> dict[Any, Any]:
    """The tables GUARDS and GUARD_NUMBERS."""
    guards = [*_of_contacts(mechanism), *_of_bearings(mechanism), *_of_loads(loaded)]
    return {
        m.GUARDS: [row for row, _, _ in guards],
        m.GUARD_NUMBERS: [(level, scale) for _, level, scale in guards],
    }


def _speeds(table: Any, offset: int, count: int, levels: tuple[float, ...], contact: int = -1) -> Iterator[Guard]:
    """Guards of a sliding velocity at the speeds at which its law bends, 0 for none."""
    for level in levels:
        if level > 0.0:
            yield (table.place, offset, count, contact, -1), level, level


def _of_contacts(mechanism: Mechanism) -> Iterator[Guard]:
    for c, (name, joint, *_) in enumerate(mechanism.contacts):
        if joint.friction is not None:
            law = lookup(FRICTION_LAWS, joint.friction.law, where=f"[joint.{name}.friction]")
            yield from _speeds(m.TOUCH, c * m.TOUCH.size + m.TOUCH.slip, 1, law.kinks(joint.friction), c)


def _of_bearings(mechanism: Mechanism) -> Iterator[Guard]:
    """Of ideal joints: speeds, sliding that reverses under a law with bristles, and what presses that reverses."""
    bearing = 0
    for name, joint in mechanism.scene.rubbing().items():
        assert joint.friction is not None
        law = lookup(FRICTION_LAWS, joint.friction.law, where=f"[joint.{name}.friction]")
        for _ in BEARINGS[joint.type]:
            row = bearing * m.BENDS.size
            yield from _speeds(m.BENDS, row + m.BENDS.sliding, 3, law.kinks(joint.friction))
            if law.bristle(joint.friction) is not None:
                yield (m.BENDS.place, row + m.BENDS.sliding, 3, -1, -1), 0.0, law.stick_speed(joint.friction)
            for field, count in PRESSES.items():
                yield (m.BENDS.place, row + getattr(m.BENDS, field), count, -1, bearing), 0.0, 0.0
            bearing += 1


def _of_loads(loaded: Loaded) -> Iterator[Guard]:
    for k, levels in enumerate(loaded.bends):
        for level in levels:
            yield (m.LOAD_BENDS.place, k * m.LOAD_BENDS.size, 1, -1, -1), level, level
