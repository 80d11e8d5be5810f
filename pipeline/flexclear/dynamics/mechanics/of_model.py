"""The mechanism of a model: its objects, with the places of their numbers in f, w and the state."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects.wear.contact import LEDGER
from flexclear.dynamics.mechanics.contacts import ContactNumbers, Kinds, stop, touch
from flexclear.dynamics.mechanics.coordinates import Gauge
from flexclear.dynamics.mechanics.loads import STATES, Law, act
from flexclear.dynamics.mechanics.mechanism import Action, Carrier, Closure, Frame, Link, Mechanism
from flexclear.dynamics.mechanics.trees import Body, Coordinates, Site
from flexclear.dynamics.mechanics.vectors import UNIT, ZERO, Matrix, Symmetric, Vector
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.routines.calls import MODES, RATES, SCENE, STATE, WORK, Cell, cells


def mechanism_of(model: Model, h: np.ndarray) -> Mechanism:
    """Return the mechanism of a model; h: its topology with the closure rows to solve for and the offsets in w."""
    ground, numbering = Carrier(), model.numbering
    sites = [_site(h, k) for k in range(len(numbering.sites))]
    carriers, links = [ground], list[Link]()
    for i, link in enumerate(model.links[1:], start=1):
        given = carriers[link.branch.parent], link.kind, sites[i - 1], _body(h, i)
        links.append(Link(*given, *_joint_state(model, h, i)))
        carriers.append(links[-1])
    frames = [(carriers[site.link], own) for site, own in zip(numbering.sites, sites, strict=True)]
    actions = [*_contacts(model, h, frames), *_loads(model, h, ground, frames)]
    gravity, least = _numbers(h, m.GRAVITY, 0), Cell(WORK, int(h[m.PIVOT]) + m.LAST_PIVOT)
    stored = {cell.key for one in actions for cell in one.results}
    books = enumerate(cells(RATES, model.nq + model.nv, model.arrays.size(m.N_LEDGER)))
    ledger = {book: cell for book, cell in books if cell.key not in stored}
    return Mechanism(ground, links, _closures(model, h, frames), actions, gravity, ledger, least)


def _numbers(h: np.ndarray, table: Any, row: int) -> list[Cell]:
    """Return a row of a table of f."""
    return cells(SCENE, int(h[table.at]) + table.size * row, table.size)


def _row(h: np.ndarray, table: Any, row: int, array: str) -> list[Cell]:
    """Return a row of a table of an array."""
    return cells(array, int(h[table.at]) + table.size * row, table.size)


def _site(h: np.ndarray, k: int) -> Site:
    numbers = _numbers(h, m.SITE_NUMBERS, k)
    return Site(Vector(numbers[:3]), Matrix(numbers[3:]))


def _body(h: np.ndarray, i: int) -> Body:
    numbers = _numbers(h, m.LINK_NUMBERS, i)
    return Body(numbers[0], Vector(numbers[1:4]), Symmetric(numbers[4:10]), *numbers[10:])


def _joint_state(model: Model, h: np.ndarray, i: int) -> tuple[Coordinates, list[Cell], int]:
    """Return the coordinates of a link's joint, where their rates are stored, and the book of its drives or -1."""
    q, u = model.numbering.positions[i], model.numbering.coordinates[i]
    if model.links[i].drives:
        laws = [cells(WORK, int(h[m.LAW.at]) + m.LAW.size * (k - model.nv), m.LAW.size) for k in u]
        book = int(model.arrays.table(m.DRIVES)["book"][u.start - model.nv])
        return Coordinates(*map(list, zip(*laws, strict=True))), [], book
    places = (q.start, len(q)), (model.nq + u.start, len(u))
    x, v = (cells(STATE, *place) for place in places)
    return Coordinates(x, v, [0.0] * len(u)), [cell for place in places for cell in cells(RATES, *place)], -1


def _closures(model: Model, h: np.ndarray, frames: list[Frame]) -> list[Closure]:
    table, made = model.arrays.table, list[Closure]()
    rows, origins = table(m.CLOSURE_ROWS, h).tolist(), table(m.CLOSURE_ENVELOPE, h)["origin"]
    for one in table(m.CLOSURES, h):
        row0, count, kept0, kept = (int(one[name]) for name in ("row0", "n_rows", "kept0", "n_kept"))
        scales = cells(WORK, int(h[m.ROW_SCALE]) + kept0, kept)
        diagonal = cells(WORK, scales[0].index + model.arrays.size(m.N_CLOSURE_ROWS), kept) if kept else []
        roots = [Cell(WORK, int(h[m.SCHUR] + origins[r]) + r) for r in range(kept0, kept0 + kept)]
        residuals = [cell for at in (m.RESIDUAL, m.RESIDUAL_RATE) for cell in cells(WORK, int(h[at]) + row0, count)]
        a, b = frames[one["site_a"]], frames[one["site_b"]]
        made.append(Closure(a, b, tuple(rows[row0 : row0 + count]), residuals, diagonal, roots, scales))
    return made


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


def _loads(model: Model, h: np.ndarray, ground: Carrier, frames: list[Frame]) -> list[Action]:
    """Return all loads, with the places of their numbers, laws and states, and of what they store."""
    tables = [model.arrays.table(one) for one in (m.LOADS, m.LOAD_KINDS, m.LOOKS, m.GAUGES)]
    rows, kinds, looks, gauges = tables
    kind_of = [name.split(maxsplit=1) for name, one in zip(model.parts.loads, kinds, strict=True) for _ in range(one["n_loads"])]
    ends = {"law0": model.arrays.size(m.N_LAWS), "number0": len(model.arrays.table(m.LOAD_NUMBERS))}
    ends |= {"look0": len(looks), "bend0": model.arrays.size(m.N_LOAD_BENDS)}
    made, world = list[Action](), (ground, Site(ZERO, UNIT))
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
