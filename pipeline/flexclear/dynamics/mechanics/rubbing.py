"""Friction of ideal joints in a mechanism: the loads of all bearings, and what their friction does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics import bearings as b
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.mechanism import (
    Link,
    Loops,
    Mechanism,
    Modes,
    Rubbing,
    Spread,
    accelerated,
    passed_inwards,
)
from flexclear.dynamics.mechanics.vectors import Wrench
from flexclear.dynamics.routines.calls import CallList


class Influence(NamedTuple):
    """What a bearing does per normal force: L^-1 of its forces by what they move; wrenches on links that are watched,
    and the multipliers of closures; its wrench on the second body at the joint's frame."""

    forces: dict[Link | Modes, t.Numbers]
    through: dict[Link, Wrench]
    multipliers: dict[int, t.Numbers]
    unit: Wrench


def rubbed(mechanism: Mechanism, loops: Loops, calls: CallList) -> tuple[list[tuple[int, Any]], Any]:
    """Add friction of joints to the forces of all links, and to those on drives; return lost powers by their books, and
    1 where friction jams the mechanism."""
    influences, bearings, losses = list[Influence](), list[Any](), list[Any]()
    for joint in mechanism.rubbing:
        ends, wrenches, units = [frame.placed for frame in joint.frames], list[Any](), list[Wrench]()
        for one in joint.bearings:
            on_both, unit, loss, R_WB = calls.store(one.sliding, b.friction_of, *one.given, *ends)
            wrenches.append(on_both)
            units.append(unit)
            losses.append(loss)
            bearings.append((one.given[0], one.given[2], R_WB))
        ends_of_rows = list(zip(joint.frames, zip(*wrenches, strict=True), strict=True))
        spread, *_ = passed_inwards(ends_of_rows, [0.0] * len(units))
        influences += [influence(loops, spread, k, unit) for k, unit in enumerate(units)]

    of_bearing = [joint for joint in mechanism.rubbing for _ in joint.bearings]
    places = [one for joint in mechanism.rubbing for one in joint.bearings]
    loads, bends = [one.load for one in places], [cell for one in places for cell in one.bends]
    reactions = reactions_of(mechanism, loops, list(zip(influences, of_bearing, strict=True)))
    jammed = calls.store([*loads, *bends], b.loads_of, bearings, *reactions)

    for moved in moving(mechanism):
        V = [by.forces.get(moved, [0.0] * len(moved.forces)) for by in influences]
        moved.forces = c.with_multipliers(moved.forces, list(zip(*V, strict=True)), loads)
    for number, mine in loops.found.items():
        rows = list(zip(*(by.multipliers[number] for by in influences), strict=True))
        more = c.with_multipliers([0.0] * len(rows), rows, loads)
        for link, on_it in mine.through.items():
            link.closing.append((on_it, more))
    for by, load in zip(influences, loads, strict=True):
        for link, wrench in by.through.items():
            link.closing.append(([wrench], [load]))
    powers = [b.lost(*one) for one in zip(loads, losses, strict=True)]
    return [(joint.book, power) for joint, power in zip(of_bearing, powers, strict=True)], jammed


def moving(mechanism: Mechanism) -> list[Link | Modes]:
    """Return all that forces move."""
    return [moved for link in mechanism.links for moved in (link, link.modes) if moved]


def influence(loops: Loops, spread: Spread, k: int, unit: Wrench) -> Influence:
    """Return what bearing k of a joint does per normal force, while all loops stay closed."""
    forces: dict[Link | Modes, t.Numbers] = {moved: [row[k] for row in V] for moved, V in spread.V.items()}
    right = list[Any]()
    for number, one in loops.found.items():
        rows: c.Rows = [[0.0]] * len(loops.multipliers[number])
        for moved, V in one.V.items():
            if moved in forces:
                rows = c.coupled(rows, V, [[force] for force in forces[moved]])
        right.append(c.opposite([row[0] for row in rows]))
    multipliers = loops.solved(right)
    for number, one in loops.found.items():
        for moved, V in one.V.items():
            forces[moved] = c.with_multipliers(forces.get(moved, [0.0] * len(V)), V, multipliers[number])
    return Influence(forces, {link: on_it[k] for link, on_it in spread.through.items()}, multipliers, unit)


def reactions_of(
    mechanism: Mechanism, loops: Loops, influences: Sequence[tuple[Influence, Rubbing]]
) -> tuple[list[Wrench], list[list[Wrench]]]:
    """Return the reactions of each bearing's joint: without friction, and per normal force of each bearing."""
    joints, without = mechanism.rubbing, {moved: moved.forces for moved in moving(mechanism)}
    accelerated(mechanism)
    smooth, parts = [reaction(loops, joint) for joint in joints], list[list[Wrench]]()
    for by, of_joint in influences:
        for moved, forces in without.items():
            moved.forces = by.forces.get(moved, [0.0] * len(forces))
        accelerated(mechanism)
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
        rows = loops.on_second.get(joint.closure, []), multipliers.get(joint.closure, [])
        return b.reaction_in_loop(*rows, [by.unit] if by and own else [], second)
    passing = [(one.through[link], multipliers[number]) for number, one in loops.found.items() if link in one.through]
    if by and not own and link in by.through:
        passing.append(([by.through[link]], [1.0]))
    known = int(by is None)
    return b.reaction_in_tree(joint.second, link.rest, link.acceleration, known, passing, link.motion, second)
