"""Explanation of a run that ends where the expression of a load leaves its table."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.loads.lookup import ROUNDING
from flexclear.scene.expression import Lookup
from flexclear.scene.formulas import expressions_of_load, formula


def explanation(engine: Any) -> str | None:
    """Return table, quantity and value for the first load that leaves a table in the state evaluated last."""
    scene = engine.model.scene
    for k, (name, _) in enumerate(engine.model.loads):
        load: Any = scene.load.get(name)
        known = formula(scene, name) if getattr(load, "tables", None) else None
        if known is None:
            continue
        units = {
            step.name: step.of
            for _, steps in expressions_of_load(scene, load)
            for step in steps
            if isinstance(step, Lookup)
        }
        for number, values in _looked_up(engine, k):
            called, table = list(load.tables.items())[number]
            for column, unit, axis, value in zip(table.of, units[called], table.axes(), values, strict=True):
                near = ROUNDING * (axis[-1] - axis[0])  # of the last state that can be evaluated
                if not axis[0] + near < value < axis[-1] - near:
                    what = column.column if isinstance(column.column, str) else f"column {column.column}"
                    return (
                        f"load {name}: {what} = {value:.6g} {unit} leaves table {called} ({table.file}), whose "
                        f"points are at {axis[0]:.6g} to {axis[-1]:.6g} {unit}; add points, or limit it by max and min"
                    )
    return None


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
