"""The calls that store what a record has of an evaluation: true accelerations, wrenches, energies, Jacobian."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.loops import Loops, jacobian
from flexclear.dynamics.mechanics.mechanism import Carrier, Link, Mechanism
from flexclear.dynamics.mechanics.modes import Modes
from flexclear.dynamics.mechanics.tables import Tables
from flexclear.dynamics.mechanics.trees import Site
from flexclear.dynamics.routines.calls import CallList, Cell
from flexclear.dynamics.vectors import UNIT, ZERO, Twist, Vector


def describe(tables: Tables, mechanism: Mechanism, loops: Loops, calls: CallList) -> None:
    """Append the calls that store what a record has of an evaluated mechanism; wrenches about the world's origin."""
    with calls.building():
        for store in (_coordinates, _frames, store_energies):
            store(tables, mechanism, calls)
        for of_loops in (_wrenches, _jacobian):
            of_loops(tables, mechanism, loops, calls)


def moving_parts(tables: Tables, mechanism: Mechanism) -> Iterator[tuple[Link | Modes, Any]]:
    """Yield all links and modes with their rows of LINKS and FLEXES: the first position and the first speed."""
    bodies = {int(row["link"]): row for row in tables.table(m.FLEXES)}
    for i, (link, row) in enumerate(zip(mechanism.links, tables.table(m.LINKS)[1:], strict=True), start=1):
        yield link, row
        if link.modes:
            yield link.modes, bodies[i]


def _coordinates(tables: Tables, mechanism: Mechanism, calls: CallList) -> None:
    """Store all positions and speeds, and the accelerations of prescribed coordinates."""
    for moved, row in moving_parts(tables, mechanism):
        x, u, du = (moved.q, moved.u, ()) if isinstance(moved, Modes) else moved.coordinates
        known = du if isinstance(moved, Link) and moved.driven else ()
        for stretch, first, values in ((m.X, "q0", x), (m.U, "c0", u), (m.DU, "c0", known)):
            calls.write(tables.stretch(stretch, row[first], len(values)), values)


def _frames(tables: Tables, mechanism: Mechanism, calls: CallList) -> None:
    """Store the motion of links and sites, with whole accelerations, less gravity."""
    bodies = [((one.motion, Site(ZERO, UNIT)), _whole(one)) for one in (mechanism.ground, *mechanism.links)]
    sites = [(one.placed, one.acceleration) for one in mechanism.frames]
    for table, ends in ((m.LINK_FRAMES, bodies), (m.SITE_FRAMES, sites)):
        for k, (end, acceleration) in enumerate(ends):
            calls.store(tables.row(table, k), t.whole_motion, *end, acceleration)


def _whole(carrier: Carrier) -> Twist:
    """Return the part of a body's acceleration that is from unknown rates of speeds, with those of its modes."""
    modes = carrier.modes if isinstance(carrier, Link) else None
    return modes.follow(carrier.acceleration, modes.twists) if modes else carrier.acceleration


def _wrenches(tables: Tables, mechanism: Mechanism, loops: Loops, calls: CallList) -> None:
    """Store the wrenches on links through their joints and on the second bodies of closures, and forces of drives."""
    calls.write(tables.row(m.WRENCH, 0), [0.0] * m.WRENCH.size)
    for i, (link, row) in enumerate(zip(mechanism.links, tables.table(m.LINKS)[1:], strict=True), start=1):
        moves = link.rest, link.acceleration
        calls.store(tables.row(m.WRENCH, i), t.joint_wrench, *moves, link.closing, link.motion.p_WB)
        if link.driven:
            places = tables.stretch(m.DRIVE_FORCE, row["c0"] - tables.nv, row["n_speeds"])
            calls.store(places, t.driving_forces, link.step, *moves, [*link.closing, *link.own])
    rubbing = {joint.closure: joint.bearings for joint in mechanism.rubbing}
    for number, one in enumerate(mechanism.closures):
        wrenches = loops.ends[number][1][1] if number in loops.ends else ()
        multipliers = [part[number] for part in (loops.multipliers, loops.by_friction) if number in part]
        friction = [(bearing.load, bearing.record) for bearing in rubbing.get(number, ())]
        place = tables.row(m.CLOSURE_WRENCH, number)
        calls.store(place, c.closure_wrench, wrenches, multipliers, one.frames[1].carrier.motion.p_WB, friction)


def _jacobian(tables: Tables, mechanism: Mechanism, loops: Loops, calls: CallList) -> None:
    """Store the Jacobian of the rows that are solved for."""
    first = {moved: int(row["c0"]) for moved, row in moving_parts(tables, mechanism)}
    closures, support = tables.table(m.CLOSURES), tables.table(m.SUPPORT)["coordinate"].tolist()
    for number, ends in loops.ends.items():
        one = closures[number]
        begin, size = int(one["jacobian0"]), int(one["n_support"])
        slots = {k: slot for slot, k in enumerate(support[one["support0"] : one["support0"] + size])}
        for moved, rows in jacobian(ends).items():
            places, values = list[Cell](), list[Any]()
            for k, row in enumerate(rows, start=first[moved]):
                for r, value in enumerate(row if k in slots else ()):
                    places += tables.stretch(m.JACOBIAN, begin + size * r + slots[k], 1)
                    values.append(value)
            calls.write(places, values)


def store_energies(tables: Tables, mechanism: Mechanism, calls: CallList) -> None:
    """Store the energies of each independent mechanism: kinetic, of gravity, and stored in bodies and loads."""
    component, sites = tables.table(m.LINKS)["component"].tolist(), tables.table(m.SITES)["link"].tolist()
    sums, gravity = defaultdict[int, list[Any]](lambda: [0.0] * 3), Vector(mechanism.gravity)
    for link, of in zip(mechanism.links, component[1:], strict=True):
        if modes := link.modes:
            sums[of] = modes.energies(link.motion, gravity, *sums[of])
        else:
            sums[of][:2] = t.energies(link.motion, link.body, gravity, *sums[of][:2])
    stores = [(m.CONTACTS, "outer", "inner", "touch", ("stored", "bent")), (m.LOADS, "a", "b", "load", ("stored",))]
    for table, first, second, name, fields in stores:
        for k, row in enumerate(tables.table(table)):
            of = max(component[sites[site]] for site in (row[first], row[second]) if site >= 0)
            for field in fields:
                sums[of][2] = t.add(sums[of][2], getattr(tables.record(name, k), field))
    for of, values in sums.items():
        calls.write(tables.row(m.ENERGY, of), values)
