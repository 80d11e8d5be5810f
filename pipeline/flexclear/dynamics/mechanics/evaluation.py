"""The calls that compute the rates of the state of a mechanism, from its objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import bearings as b
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import flexible as f
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.loops import Loops, Spread, close_loops, pass_inwards
from flexclear.dynamics.mechanics.mechanism import Link, Mechanism, Rubbing
from flexclear.dynamics.mechanics.modes import Block
from flexclear.dynamics.mechanics.trees import Coordinates
from flexclear.dynamics.routines.calls import RESULTS, CallList, Cell, routine
from flexclear.dynamics.specialise.symbols import select
from flexclear.dynamics.vectors import Wrench


@routine
def status(reports: t.Numbers, sound: Any, least: Any, jammed: Any) -> tuple[Any]:
    """Return the report of an evaluation, from those of `trees.eliminate`, `closures.cholesky` and `loads_of`.

    reports: of a sound evaluation, of a jammed mechanism, of a singular pose, of massless coordinates.
    """
    sound_one, jam, singular, massless = reports
    regular = select(least > c.SINGULAR, select(jammed > 0.5, jam, sound_one), singular)
    return (select(sound > 0.5, regular, massless),)


#: reports in the order of `status`
REPORTS = (m.OK, m.JAMMED, m.SINGULAR, m.NOT_POSITIVE)


def evaluate(mechanism: Mechanism, calls: CallList) -> Loops:
    """Append the calls that store the rates of the state, and what steps read besides: contacts, bearings and kinks of
    loads, residuals of the loops, and the independence of their rows. Return the loops.

    Source: Wang & Wang (2019), eqs. (32), (34).
    """
    with calls.building():
        place_links(mechanism)
        supplied = apply_actions(mechanism, calls)
        sound = eliminate_coordinates(mechanism)
        loops, jammed = close_loops(mechanism, calls), 0.0
        if mechanism.rubbing:
            lost, jammed = apply_friction(mechanism, loops, calls)
            supplied += lost
        accelerate_links(mechanism, calls)
        calls.write(
            list(mechanism.ledger.values()), rates_of_books(mechanism, [*supplied, *powers_of_links(mechanism)])
        )
        calls.store([Cell(RESULTS, 0)], status, [calls.number(one) for one in REPORTS], sound, loops.least, jammed)
    return loops


def place_links(mechanism: Mechanism) -> None:
    """Compute the motion of all links, with the known part of their accelerations."""
    mechanism.ground.motion = t.ground(mechanism.gravity)
    for link in mechanism.links:
        link.motion, link.step = t.place(link.kind, *link.frame.placed, link.coordinates)
        if link.modes:
            link.motion, link.step = link.modes.place(link.motion, link.step)


def apply_actions(mechanism: Mechanism, calls: CallList) -> list[tuple[int, Any]]:
    """Apply contacts and loads to all bodies; return powers by their books."""
    powers, rigidly = list[tuple[int, Any]](), dict[Link, Wrench]()
    for one in mechanism.actions:
        ends = [frame.placed for frame in one.frames]
        wrenches, supplied = calls.store(one.results, one.routine, *one.given, *ends)
        for frame, wrench in zip(one.frames, wrenches, strict=False):
            link = frame.carrier
            if frame.deformed[1]:
                frame.push(wrench)
            elif isinstance(link, Link):
                rigidly[link] = t.add(rigidly[link], wrench) if link in rigidly else wrench
        powers += [(one.book + k, power) for k, power in enumerate(supplied) if not _zero(power)]
    for link, wrench in rigidly.items():
        link.beyond.append((t.push(wrench), ()))
    return powers


def eliminate_coordinates(mechanism: Mechanism, slowness: float = 0.0) -> Any:
    """Eliminate all unknown coordinates, from the leaves to the ground; return whether all move mass.

    slowness: share [s^2] of their stiffness that modes have in their mass.
    """
    sound: Any = 1.0
    for link in reversed(mechanism.links):
        carried_on = int(link.on_link)
        if modes := link.modes:
            link.rest, sound = modes.eliminate(modes.need(link.motion), link.beyond, sound, slowness)
        elif link.driven or link.watched:
            link.rest = t.resist(link.motion, link.body, link.beyond)
        if link.driven:
            rest = t.carry(link.step, link.rest) if link.on_link else None
        elif link.modes or link.watched:
            rest, link.gains, link.forces, sound = t.free_joint(carried_on, link.rest, link.bounds, link.step, sound)
        else:
            given = carried_on, link.motion, link.body, link.bounds, link.step, link.beyond, sound
            rest, link.gains, link.forces, sound = t.eliminate(*given)
        if rest:
            link.frame.resist(rest)
    return sound


def accelerate_links(mechanism: Mechanism, calls: CallList | None = None) -> None:
    """Compute the accelerations of all links from their forces; store the rates of the state, if there are calls."""
    for link in mechanism.links:
        if link.driven:
            link.acceleration = t.follow(link.frame.acceleration, link.step)
        else:
            given = link.frame.acceleration, link.step, link.gains, link.forces
            if calls:
                link.acceleration = calls.store(link.rates, t.accelerate, link.kind, link.coordinates, *given)
            else:
                link.changes, link.acceleration = t.accelerate("fixed", Coordinates((), (), ()), *given)
        if link.modes:
            link.modes.accelerate(link.acceleration, calls)


# Friction of ideal joints ---------------------------------------------------------------------------------------------
class Influence(NamedTuple):
    """What a bearing does per normal force: L^-1 of its forces by what they move; wrenches on links that are watched,
    and the multipliers of closures; its wrench on the second body at the joint's frame."""

    forces: dict[Link | Block, t.Numbers]
    through: dict[Link, Wrench]
    multipliers: dict[int, t.Numbers]
    unit: Wrench


def apply_friction(mechanism: Mechanism, loops: Loops, calls: CallList) -> tuple[list[tuple[int, Any]], Any]:
    """Add friction of joints to the forces of all links, and to those on drives; return lost powers by their books, and
    1 where friction jams the mechanism."""
    influences, bearings, losses = list[Influence](), list[Any](), list[Any]()
    for joint in mechanism.rubbing:
        ends, wrenches, units = [frame.placed for frame in joint.frames], list[Any](), list[Wrench]()
        for one in joint.bearings:
            on_both, unit, loss, R_WB = calls.store(one.sliding, b.friction_of, *one.given, *ends)
            if one.record:
                calls.store(one.record, b.bearing_record, one.sliding[:3], loss, unit, ends[1])
            wrenches.append(on_both)
            units.append(unit)
            losses.append(loss)
            bearings.append((one.given[0], one.given[2], R_WB))
        ends_of_rows = list(zip(joint.frames, zip(*wrenches, strict=True), strict=True))
        spread, *_ = pass_inwards(ends_of_rows, [0.0] * len(units))
        influences += [influence(loops, spread, k, unit) for k, unit in enumerate(units)]

    of_bearing = [joint for joint in mechanism.rubbing for _ in joint.bearings]
    places = [one for joint in mechanism.rubbing for one in joint.bearings]
    loads, bends = [one.load for one in places], [cell for one in places for cell in one.bends]
    reactions = reactions_of(mechanism, loops, list(zip(influences, of_bearing, strict=True)))
    for joint, smooth, parts in zip(of_bearing, *reactions, strict=True):
        for row, wrench in zip(joint.reactions, (smooth, *parts), strict=False):
            calls.write(row, wrench)
    found, kinks, jammed = loads_of(bearings, *reactions, calls)
    calls.write([*loads, *bends], [*found, *kinks])

    for moved in moving(mechanism):
        V = [by.forces.get(moved, [0.0] * len(moved.forces)) for by in influences]
        moved.forces = c.with_multipliers(moved.forces, list(zip(*V, strict=True)), loads)
    for number, mine in loops.found.items():
        rows = list(zip(*(by.multipliers[number] for by in influences), strict=True))
        more = loops.by_friction[number] = c.with_multipliers([0.0] * len(rows), rows, loads)
        for link, on_it in mine.through.items():
            link.closing.append((on_it, more))
    for by, joint, load in zip(influences, of_bearing, loads, strict=True):
        for link, wrench in by.through.items():
            (link.own if link is joint.link else link.closing).append(([wrench], [load]))
    powers = [b.lost_power(*one) for one in zip(loads, losses, strict=True)]
    return [(joint.book, power) for joint, power in zip(of_bearing, powers, strict=True)], jammed


def loads_of(
    bearings: Sequence[tuple[Any, Any, Any]],
    smooth: Sequence[Wrench],
    influence: Sequence[Sequence[Wrench]],
    calls: CallList,
) -> tuple[list[Any], list[Any], Any]:
    """Return the normal forces of all bearings, their parts with kinks, and 1 where friction jams them, else 0.

    smooth: reaction of each bearing's joint without friction.  influence: per normal force of each bearing.
    """

    def pressed(loads: t.Numbers, share: Any) -> list[Any]:
        return [
            b.normal_force(*one, R, parts, loads, share)
            for one, R, parts in zip(bearings, smooth, influence, strict=True)
        ]

    def pursue(state: Any) -> tuple[Any, Any]:
        """Correct the loads once by Newton's method."""
        rows, (loads, share, *_) = list[t.Numbers](), state
        for e, (load, (size, _, slopes)) in enumerate(zip(loads, pressed(loads, share), strict=True)):
            rows.append([*slopes[:e], t.add(1.0, slopes[e]), *slopes[e + 1 :], b.excess(load, size)])
        return b.newton_step(*b.solution(rows), without, *state)

    without = [b.normal_force(*one, R, [], [], 0.0)[0] for one, R in zip(bearings, smooth, strict=True)]
    loads, *_, jammed = calls.repeat(pursue, (without, 1.0, 0.0, inf, 0.0, 0.0))
    return loads, [bend for _, bends, _ in pressed(loads, 1.0) for bend in bends], jammed


def moving(mechanism: Mechanism) -> list[Link | Block]:
    """Return all that forces move."""
    return [moved for link in mechanism.links for moved in (link, *(link.modes.blocks if link.modes else ()))]


def influence(loops: Loops, spread: Spread, k: int, unit: Wrench) -> Influence:
    """Return what bearing k of a joint does per normal force, while all loops stay closed."""
    forces: dict[Link | Block, t.Numbers] = {moved: [row[k] for row in V] for moved, V in spread.V.items()}
    right = list[Any]()
    for number, one in loops.found.items():
        rows: c.Rows = [[0.0]] * len(loops.ends[number][0][1])
        for moved, V in one.V.items():
            if moved in forces:
                rows = c.add_product(rows, V, [[force] for force in forces[moved]])
        right.append(c.opposite([row[0] for row in rows]))
    multipliers = answered(loops, forces, right)
    return Influence(forces, {link: on_it[k] for link, on_it in spread.through.items()}, multipliers, unit)


def answered(loops: Loops, forces: dict[Link | Block, t.Numbers], right: Sequence[t.Numbers]) -> dict[int, t.Numbers]:
    """Return the multipliers for right-hand sides, and add their part to forces."""
    multipliers = loops.solved(right)
    for number, one in loops.found.items():
        for moved, V in one.V.items():
            forces[moved] = c.with_multipliers(forces.get(moved, [0.0] * len(V)), V, multipliers[number])
    return multipliers


def respond(mechanism: Mechanism, forces: Mapping[Link | Block, t.Numbers]) -> None:
    """Compute the accelerations by forces, given as L^-1 of them, alone."""
    for moved in moving(mechanism):
        moved.forces = forces.get(moved, [0.0] * len(moved.forces))
    accelerate_links(mechanism)


def reactions_of(
    mechanism: Mechanism, loops: Loops, influences: Sequence[tuple[Influence, Rubbing]]
) -> tuple[list[Wrench], list[list[Wrench]]]:
    """Return the reactions of each bearing's joint: without friction, and per normal force of each bearing."""
    joints, without = mechanism.rubbing, {moved: moved.forces for moved in moving(mechanism)}
    accelerate_links(mechanism)
    smooth, parts = [reaction(loops, joint) for joint in joints], list[list[Wrench]]()
    for by, of_joint in influences:
        respond(mechanism, by.forces)
        parts.append([reaction(loops, joint, by, own=joint is of_joint) for joint in joints])
    for moved, forces in without.items():
        moved.forces = forces
    of_bearing = [k for k, joint in enumerate(joints) for _ in joint.bearings]
    return [smooth[k] for k in of_bearing], [[part[k] for part in parts] for k in of_bearing]


def reaction(loops: Loops, joint: Rubbing, by: Influence | None = None, *, own: bool = False) -> Wrench:
    """Return the wrench of a joint on its second body at present accelerations: without friction, or `by` that of a
    bearing alone; own: True for a bearing of the joint itself."""
    second, link, multipliers = joint.frames[1].placed, joint.link, (by or loops).multipliers
    if link is None:
        on_second = loops.ends[joint.closure][1][1] if joint.closure in loops.found else []
        rows = on_second, multipliers.get(joint.closure, [])
        return b.reaction_in_loop(*rows, [by.unit] if by and own else [], second)
    passing = [(one.through[link], multipliers[number]) for number, one in loops.found.items() if link in one.through]
    if by and not own and link in by.through:
        passing.append(([by.through[link]], [1.0]))
    known = int(by is None)
    return b.reaction_in_tree(joint.second, link.rest, link.acceleration, known, passing, link.motion, second)


def powers_of_links(mechanism: Mechanism) -> list[tuple[int, Any]]:
    """Return the powers of drives, and those lost to damping of modes, by their books."""
    powers = list[tuple[int, Any]]()
    for link in mechanism.links:
        if link.driven:
            given = link.step, link.rest, link.acceleration, [*link.closing, *link.own], link.coordinates.u
            powers.append((link.book, t.driving_power(*given)))
        if modes := link.modes:
            powers.append((modes.book, f.damping_power(modes.body.damping, modes.u)))
    return powers


def rates_of_books(mechanism: Mechanism, powers: Iterable[tuple[int, Any]]) -> list[Any]:
    """Return the rates of the ledger's books: sums of powers."""
    sums: dict[int, Any] = dict.fromkeys(mechanism.ledger, 0.0)
    for book, power in powers:
        sums[book] = power if _zero(sums[book]) else t.add(sums[book], power)
    return list(sums.values())


def _zero(number: Any) -> bool:
    """Return True for a number that is known to be zero."""
    return isinstance(number, float) and number == 0.0
