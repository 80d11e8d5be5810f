"""Contacts and loads of a model: their objects, with the places of their numbers in f, w, n and the state."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects.wear.contact import LEDGER
from flexclear.dynamics.mechanics.contacts import ContactNumbers, Kinds, stop, touch
from flexclear.dynamics.mechanics.coordinates import Gauge
from flexclear.dynamics.mechanics.loads import STATES, Law, act
from flexclear.dynamics.mechanics.mechanism import Action, Carrier, Frame
from flexclear.dynamics.mechanics.trees import Site
from flexclear.dynamics.mechanics.vectors import UNIT, ZERO
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.routines.calls import MODES, RATES, SCENE, STATE, WORK, Cell, cells


def actions_of(model: Model, h: np.ndarray, ground: Carrier, frames: list[Frame]) -> list[Action]:
    """Return all contacts, stops and loads; frames: of all sites."""
    return [*_contacts(model, h, frames), *_loads(model, h, Frame(ground, Site(ZERO, UNIT)), frames)]


def _row(h: np.ndarray, table: Any, row: int, array: str) -> list[Cell]:
    """Return a row of a table of an array."""
    return cells(array, int(h[table.at]) + table.size * row, table.size)


def _contacts(model: Model, h: np.ndarray, frames: list[Frame]) -> list[Action]:
    """Return contacts and stops, with the places of what steps read of them and of their books."""
    parts, slot, made = model.parts, model.nq + model.nv, list[Action]()
    worn = model.arrays.table(m.NAMED["worn"])["contact"].tolist()
    for c, row in enumerate(model.arrays.table(m.CONTACTS)):
        numbers = _row(h, m.CONTACT_NUMBERS, c, SCENE)
        law, shape, length = (m.CONTACT_NUMBERS.friction_law, m.CONTACT_NUMBERS.shape, m.CONTACT_NUMBERS.length)
        given = ContactNumbers(*numbers[:law], numbers[law:shape], numbers[shape:length], numbers[length])
        state = Cell(MODES, c), Cell(WORK, int(h[m.LATCHED]) + c)
        results = _row(h, m.TOUCH, c, WORK)
        results += cells(RATES, slot + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * c, m.CONTACT_LEDGER.size)
        form, between = parts.forms[row["normal"]], [frames[row["outer"]], frames[row["inner"]]]
        if c >= model.arrays.size(m.N_SURFACES):
            gauge, turns, rates = _gauge(model, row["surfaces"])
            made.append(Action(stop, (form, gauge, given, *state, turns), between, [*results, *rates]))
            continue
        if c in worn:
            size = LEDGER.size
            results += cells(RATES, slot + model.arrays.size(m.SIZES["wear_slot"]) + size * worn.index(c), size)
        bent = 3 if row["bristle"] >= 0 else 0
        friction = parts.frictions[row["friction"]] if row["friction"] >= 0 else ""
        kinds = Kinds(parts.surfaces[row["surfaces"]], form, friction, int(c in worn))
        bristle, rates = (cells(array, int(row["bristle"]), bent) for array in (STATE, RATES))
        made.append(Action(touch, (kinds, given, *state, bristle), between, [*results, *rates]))
    return made


def _gauge(model: Model, k: int) -> tuple[Gauge, list[Cell], list[Cell]]:
    """Return a gauge, with the angle whose full turns it counts, and where the rate of that is stored."""
    row = model.arrays.table(m.GAUGES)[k]
    turns, rates = _internal(model, int(row["turns"]), 1)
    return Gauge(*(int(row[name]) for name in Gauge._fields)), turns, rates


def _internal(model: Model, first: int, count: int) -> tuple[list[Cell], list[Cell]]:
    """Return internal states, none for a negative index, and where their rates are stored."""
    at = model.ny - model.arrays.size(m.N_INTERNAL) + first
    state, rates = (cells(array, at, count if first >= 0 else 0) for array in (STATE, RATES))
    return state, rates


def _loads(model: Model, h: np.ndarray, world: Frame, frames: list[Frame]) -> list[Action]:
    """Return all loads, with the places of their numbers, laws and states, and of what they store."""
    tables = [model.arrays.table(one) for one in (m.LOADS, m.LOAD_KINDS, m.LOOKS, m.GAUGES)]
    rows, kinds, looks, gauges = tables
    kind_of = [
        name.split(maxsplit=1)
        for name, one in zip(model.parts.loads, kinds, strict=True)
        for _ in range(one["n_loads"])
    ]
    ends = {"law0": model.arrays.size(m.N_LAWS), "number0": len(model.arrays.table(m.LOAD_NUMBERS))}
    ends |= {"look0": len(looks), "bend0": model.arrays.size(m.N_LOAD_BENDS)}
    made = list[Action]()
    for k, (row, kind) in enumerate(zip(rows, kind_of, strict=True)):
        spans = [
            range(int(row[name]), int(rows[k + 1][name] if k + 1 < len(rows) else end)) for name, end in ends.items()
        ]
        numbers = cells(SCENE, int(h[m.LOAD_NUMBERS.at]) + spans[1].start, len(spans[1]))
        laws = [Law(*_row(h, m.LAW, i, WORK)[:2]) for i in spans[0]]
        states, results = _internal(model, int(row["internal0"]), STATES.get(kind[0], 0))
        between = [frames[row["a"]] if row["a"] >= 0 else world, frames[row["b"]]]
        gauged, read = list[Any](), list[tuple[int, int]]()

        def measure(g: int) -> int:
            """Append a coordinate; return its number."""
            gauge, turns, rates = _gauge(model, g)
            gauged.append((gauge, turns, *(place(int(gauges[g][side])) for side in ("a", "b"))))
            results.extend(rates)
            return len(gauged) - 1

        def place(site: int) -> int:
            """Return the number of a site among the ends, after appending it if it is new."""
            if frames[site] not in between:
                between.append(frames[site])
            return between.index(frames[site])

        for name in ("gauge", "measured"):
            if row[name] >= 0:
                measure(int(row[name]))
        for i, look in enumerate(spans[2]):
            index = int(looks[look]["index"])
            coordinate = any(token in (f"q{i}", f"r{i}") for token in kind[-1].split())
            read.append((1, measure(index)) if coordinate else (0, place(index)))
        results += cells(WORK, int(h[m.LOAD_BENDS.at]) + spans[3].start, len(spans[3]))
        given = tuple(kind), int(row["follows"]), numbers, laws, states, gauged, read
        made.append(Action(act, given, between, results, int(row["book"])))
    return made
