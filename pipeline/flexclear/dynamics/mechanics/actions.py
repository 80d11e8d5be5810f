"""Contacts, loads, gears and friction of a topology: their objects, with the places of their numbers in the arrays."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.expression import sizes as law_sizes
from flexclear.dynamics.contact.form.expression import sizes as form_sizes
from flexclear.dynamics.contact.wear import LEDGER
from flexclear.dynamics.joints.conditions import Gauge
from flexclear.dynamics.loads import LOADS
from flexclear.dynamics.loads.given import Law
from flexclear.dynamics.lookup import length
from flexclear.dynamics.mechanics.contacts import stop, touch
from flexclear.dynamics.mechanics.gears import coupling
from flexclear.dynamics.mechanics.loads import act
from flexclear.dynamics.mechanics.mechanism import Action, Carrier, Frame, Link, Rubbed, Rubbing
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.mechanics.trees import Numbers, Site
from flexclear.dynamics.routines.calls import MODES, RATES, SCENE, STATE, Cell, Span, cells
from flexclear.dynamics.specialise import topology as topologies
from flexclear.dynamics.vectors import UNIT, ZERO

#: of a bearing, what code depends on: fields of its table
Bearing: Any = namedtuple("Bearing", "kind side axis")


def actions_of(tables: Tables, ground: Carrier, frames: list[Frame]) -> list[Action]:
    """Return all contacts, stops and loads; frames: of all sites."""
    return [*_contacts(tables, frames), *_loads(tables, Frame(ground, Site(ZERO, UNIT)), frames)]


def _contacts(tables: Tables, frames: list[Frame]) -> list[Action]:
    """Return contacts and stops, with the places of what steps read of them and of their books."""
    parts, slot, made = tables.parts, tables.nq + tables.nv, list[Action]()
    wearing = tables.table(m.NAMED["worn"])
    worn = wearing["contact"].tolist()
    look = _LawTables(m.CONTACT_TABLES)
    wear0 = slot + tables.size(m.SIZES["wear_slot"])
    for c, row in enumerate(tables.table(m.CONTACTS)):
        numbers, closed, latched = (
            tables.record("contact_numbers", c),
            Cell(MODES, c),
            tables.stretch(m.LATCHED, c, 1)[0],
        )
        books = cells(RATES, slot + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * c, m.CONTACT_LEDGER.size)
        results, form = [*tables.row(m.NAMED["touch"], c), *books], parts.forms[row["normal"]]
        friction = parts.frictions[row["friction"]] if row["friction"] >= 0 else ""
        numbers = numbers._replace(
            values=look.with_spans(numbers.values, form_sizes(form)),
            friction_law=look.with_spans(numbers.friction_law, law_sizes(friction)),
        )
        given: tuple[Any, ...]
        ends = [frames[row["outer"]], frames[row["inner"]]]
        if c < tables.size(m.N_SURFACES):
            profile: tuple[Any, ...] = ()
            if c in worn:
                profile = _profile(tables, wearing[worn.index(c)])
                results += cells(RATES, wear0 + LEDGER.size * worn.index(c), LEDGER.size)
            bristle, rates = (cells(array, int(row["bristle"]), 3 * (row["bristle"] >= 0)) for array in (STATE, RATES))
            laws = form, friction
            given = parts.surfaces[row["surfaces"]], laws, int(c in worn), profile, numbers, closed, latched, bristle
        else:
            which = [int(row[name]) for name in ("surfaces", "subtracted") if row[name] >= 0]
            how, turns, counts = zip(*(_gauge(tables, k) for k in which), strict=True)
            given, rates = (form, how, numbers, closed, latched, turns), [cell for one in counts for cell in one]
            ends = [frames[tables.table(m.GAUGES)[k][end]] for k in which for end in ("a", "b")]
        made.append(Action(touch if c < tables.size(m.N_SURFACES) else stop, given, ends, [*results, *rates]))
    return made


def _profile(tables: Tables, row: Any) -> tuple[Any, ...]:
    """Return halvings and numbers of the profiles of both surfaces of a contact; () for round ones."""
    if row["halvings"] < 0:
        return ()
    halvings = int(row["halvings"]), *([int(row["heights"])] * bool(row["heights"]))
    firsts = (tables.row(m.NAMED["profiles"], row[side])[0].index for side in ("outer0", "inner0"))
    return halvings, *(Span(SCENE, first) for first in firsts)


class _LawTables:
    """Tables that laws look up, one after another in a table of f."""

    def __init__(self, table: Any) -> None:
        self.next = topologies.start(table.at)

    def with_spans(self, numbers: Numbers, sizes: Sequence[int]) -> list[Any]:
        """Return the numbers of a law with a span for each of its tables, of these sizes."""
        begins = [self.next + sum(sizes[:k]) for k in range(len(sizes))]
        self.next += sum(sizes)
        return [*numbers, *(Span(SCENE, at) for at in begins)]


def _gauge(tables: Tables, k: int) -> tuple[Any, list[Cell], list[Cell]]:
    """Return a gauge, with the angle whose full turns it counts, and where the rate of that is stored."""
    row = tables.table(m.GAUGES)[k]
    return Gauge(*(int(row[name]) for name in Gauge._fields)), *_internal(tables, int(row["turns"]), 1)


def _internal(tables: Tables, first: int, count: int) -> tuple[list[Cell], list[Cell]]:
    """Return internal states, none for a negative index, and where their rates are stored."""
    at = tables.ny - tables.size(m.N_INTERNAL) + first
    state, rates = (cells(array, at, count if first >= 0 else 0) for array in (STATE, RATES))
    return state, rates


class _Reading:
    """Frames between which a load acts, then others that it reads; its coordinates; where rates of turns are stored."""

    def __init__(self, tables: Tables, frames: list[Frame], between: list[Frame]) -> None:
        self.tables, self.sites, self.frames = tables, frames, between
        self.gauged, self.rates = list[tuple[Any, list[Cell], int, int]](), list[Cell]()

    def frame(self, site: int) -> int:
        """Return the number of a site's frame."""
        if self.sites[site] not in self.frames:
            self.frames.append(self.sites[site])
        return self.frames.index(self.sites[site])

    def coordinate(self, k: int) -> int:
        """Add a coordinate by its gauge, and return its number."""
        gauge, turns, rates = _gauge(self.tables, k)
        row = self.tables.table(m.GAUGES)[k]
        self.gauged.append((gauge, turns, self.frame(row["a"]), self.frame(row["b"])))
        self.rates += rates
        return len(self.gauged) - 1


def _loads(tables: Tables, world: Frame, frames: list[Frame]) -> list[Action]:
    """Return all loads, with the places of their numbers, laws and states, and of what they store."""
    rows, looks = tables.table(m.LOADS), tables.table(m.LOOKS)
    names = [tables.parts.loads[kind] for kind in rows["kind"]]
    ends = {"law0": tables.size(m.N_LAWS), "number0": tables.size(m.N_LOAD_NUMBERS)}
    ends |= {"look0": len(looks), "bend0": tables.size(m.N_LOAD_BENDS)}
    spans = [list(pairwise([*rows[name].tolist(), end])) for name, end in ends.items()]
    made = list[Action]()
    for row, name, law, number, look, bend in zip(rows, names, *spans, strict=True):
        kind = tuple(name.split(maxsplit=1))
        states, rates = _internal(tables, int(row["internal0"]), getattr(LOADS[kind[0]], "STATES", 0))
        reading = _Reading(tables, frames, [frames[row["a"]] if row["a"] >= 0 else world, frames[row["b"]]])
        own = [reading.coordinate(k) for k in (row["gauge"], row["measured"]) if k >= 0]
        shown = ("coordinate", own[-1]) if own else ("distance" if row["a"] >= 0 else "nothing", 0)
        read = []
        for i, index in enumerate(looks["index"][slice(*look)].tolist()):
            joint = {f"q{i}", f"r{i}"}.intersection(name.split())
            read.append((1, reading.coordinate(index)) if joint else (0, reading.frame(index)))
        given = (
            kind,
            int(row["follows"]),
            _numbers(tables, name, *number),
            [Law(*tables.record("law", k)[:2]) for k in range(*law)],
            states,
            reading.gauged,
            read,
            shown if tables.recorded else (),
        )
        results = [cell for k in range(*bend) for cell in tables.row(m.NAMED["load_bends"], k)]
        results += tables.row(m.LOAD, len(made)) if tables.recorded else []
        made.append(Action(act, given, reading.frames, [*rates, *reading.rates, *results], int(row["book"])))
    return made


def _numbers(tables: Tables, name: str, first: int, end: int) -> list[Cell | Span]:
    """Return the numbers of a load, then a span for each table that its expressions look up (`scene.formulas`)."""
    looked_up = sorted({one for one in name.split() if ":" in one}, key=lambda one: int(one[1:].partition(":")[0]))
    sizes = [length(tuple(map(int, one.split(":")[1:]))) for one in looked_up]
    found = tables.row(m.LOAD_NUMBERS, first, end - first)
    begins = [len(found) - sum(sizes[k:]) for k in range(len(sizes))]
    return [*found[: begins[0] if begins else None], *(Span(SCENE, found[at].index) for at in begins)]


def gear(tables: Tables, frames: list[Frame], k: int) -> tuple[Any, tuple[Any, ...], list[Frame], list[Cell]]:
    """Return the routine of a gear, what it is given, the frames of both joints, and where rates of turns are stored.

    The second joint comes first.
    """
    rows, gauges = tables.table(m.NAMED["couplings"])[k], tables.table(m.GAUGES)
    which = [int(rows[side]) for side in ("second", "first")]
    how, turns, rates = zip(*(_gauge(tables, g) for g in which), strict=True)
    joints = [frames[gauges[g][end]] for g in which for end in ("a", "b")]
    return coupling, (how, turns, tables.record("coupling_numbers", k)), joints, [cell for one in rates for cell in one]


def rubbing_of(tables: Tables, frames: list[Frame], carriers: Sequence[Carrier]) -> list[Rubbing]:
    """Return the friction of ideal joints, whose links are marked; carriers: the ground, then all links."""
    table, laws, made = tables.table, tables.parts.kinds("joint_friction"), list[Rubbing]()
    look = _LawTables(m.NAMED["bearing_tables"])
    slot, count = (tables.size(m.SIZES[name]) for name in ("joint_friction_slot", "n_bearings"))
    for k, row in enumerate(table(m.NAMED["rubbing"])):
        bearings = []
        for e in range(int(row["bearing0"]), int(row["bearing0"] + row["n_bearings"])):
            one = table(m.NAMED["bearings"])[e]
            what, numbers = Bearing(*(int(one[name]) for name in Bearing._fields)), tables.record("bearing_numbers", e)
            numbers = numbers._replace(law=look.with_spans(numbers.law, law_sizes(laws[one["law"]])))
            bristle, rate = (cells(array, int(one["bristle"]), 3 * (one["bristle"] >= 0)) for array in (STATE, RATES))
            bends, (load, *rest) = tables.row(m.NAMED["bends"], e), tables.row(m.NAMED["bearing"], e)
            given, record = (what, laws[one["law"]], numbers, bristle), rest if tables.recorded else []
            bearings.append(Rubbed(given, [*bends[:3], *rate], load, bends[3:], record))
        link = carriers[row["link"]] if row["link"] >= 0 else None
        if isinstance(link, Link):
            link.watched = True
        joint, second = (frames[row["site_a"]], frames[row["site_b"]]), -1 if row["reversed"] else 1
        reactions = [
            tables.row(m.NAMED["reactions"], k * (1 + count) + e) for e in range((1 + count) * tables.recorded)
        ]
        made.append(Rubbing(joint, link, second, int(row["closure"]), bearings, slot + k, reactions))
    return made
