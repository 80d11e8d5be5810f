"""Explanation of a run that ends where the expression of a load or a contact law leaves its table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.expression import left, numbers_of
from flexclear.dynamics.effects.declared import BEARINGS
from flexclear.dynamics.lookup import left as left_by
from flexclear.scene.formulas import formula


def explanation(engine: Any) -> str | None:
    """Return table, quantity and value for the first part that leaves a table in the state evaluated last."""
    return next(_explanations(engine), None)


def _explanations(engine: Any) -> Iterator[str]:
    scene = engine.model.scene
    for k, (name, _) in enumerate(engine.model.loads):
        load: Any = scene.load.get(name)
        if getattr(load, "tables", None) and formula(scene, name) is not None:
            for number, values in _looked_up(engine, k):
                called, table = list(load.tables.items())[number]
                if why := left_by(called, table, values):
                    yield f"load {name}: {why}"
    read = engine.model.contacts, engine.table(m.TOUCH), engine.modes, engine.latched
    for (name, joint, *_), touch, closed, latched in zip(*read, strict=False):
        pressed = max(0.0, -touch["gap"]), touch["rate"], max(latched, 1e-300)
        laws = (joint.normal, pressed), (joint.friction, (touch["slip"], touch["normal_force"], 0.0))
        yield from _tables_left(f"contact {name}", laws if closed else ())
    bearings = engine.table(m.NAMED["bends"])["sliding"] if scene.joints_with_friction() else ()
    rubbing = [(name, joint) for name, joint in scene.joints_with_friction().items() for _ in BEARINGS[joint.type]]
    for (name, joint), sliding in zip(rubbing, bearings, strict=True):
        yield from _tables_left(f"joint {name}", [(joint.friction, (np.linalg.norm(sliding), 1.0, 0.0))])


def _tables_left(where: str, laws: Any) -> Iterator[str]:
    """Yield which table each law by an expression leaves at its variables."""
    for law, variables in laws:
        tables = numbers_of(law)
        why = left(law, *map(float, variables), (*law.encoded[1], *tables)) if tables else None
        if why:
            yield f"{where}: {why}"


def _looked_up(engine: Any, k: int) -> list[tuple[int, list[float]]]:
    """Return the number of each table that load k looks up in the state evaluated last, and where."""
    from flexclear.dynamics.mechanics.evaluation import place_links  # here: they import the compiler
    from flexclear.dynamics.mechanics.loads import looked_up
    from flexclear.dynamics.mechanics.of_topology import mechanism_of
    from flexclear.dynamics.run.evaluation.matrices import on_numbers

    tables, calls = on_numbers(engine, engine.h)
    mechanism = mechanism_of(tables)
    action = mechanism.actions[engine.model.arrays.size(m.N_CONTACTS) + k]
    with calls.building():
        place_links(mechanism)
        found: list[tuple[int, list[float]]] = looked_up(*action.given, *(frame.placed for frame in action.frames))
    return found
