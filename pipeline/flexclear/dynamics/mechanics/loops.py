"""Closures: their rows passed to the ground, the factor of their matrix, and their forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.mechanism import Closure, Frame, Link, Mechanism
from flexclear.dynamics.mechanics.modes import Block, Modes
from flexclear.dynamics.mechanics.trees import Columns
from flexclear.dynamics.routines.calls import CallList
from flexclear.dynamics.vectors import ZERO, Wrench

#: frames and wrenches on them, one for each row
Ends = Sequence[tuple[Frame, c.Wrenches]]


class Spread(NamedTuple):
    """Rows passed from their ends to the ground: V by what they move, and wrenches through joints that are watched."""

    V: dict[Link | Block, c.Rows]
    through: dict[Link, c.Wrenches]


class Loops(NamedTuple):
    """Closures that are solved for: their rows passed to the ground, with the frames and wrenches of their ends, and
    their multipliers, and the part of these by friction in joints; the factor of their matrix, and its smallest
    pivot."""

    found: dict[int, Spread]
    ends: dict[int, Ends]
    multipliers: dict[int, t.Numbers]
    by_friction: dict[int, t.Numbers]
    L: c.Blocks
    least: Any

    def solved(self, right: Sequence[t.Numbers]) -> dict[int, t.Numbers]:
        """Return the multipliers for right-hand sides."""
        return dict(zip(self.found, c.solve(self.L, right), strict=True))


def factorise_loops(mechanism: Mechanism, calls: CallList) -> Loops:
    """Pass the rows of all closures to the ground, and factorise their matrix."""
    found, right, S, moved_by = list[Spread](), list[Any](), c.Blocks(), dict[Link | Block, list[int]]()
    numbers, ends = list[int](), dict[int, Ends]()
    for number, one in enumerate(mechanism.closures):
        kept, places = len(one.scales), (frame.placed for frame in one.frames)
        gamma, *wrenches = calls.store(one.results, one.routine, *one.given, kept, *places)
        if not kept:
            continue
        i, ends[number] = len(found), list(zip(one.frames, wrenches, strict=True))
        mine, gamma, S[i, i] = pass_inwards(ends[number], gamma)
        for moved, V in mine.V.items():
            for k in moved_by.setdefault(moved, []):
                before = S.get((i, k)) or [[0.0] * len(right[k])] * kept
                S[i, k] = c.add_product(before, V, found[k].V[moved])
            moved_by[moved].append(i)
        found.append(mine)
        right.append(gamma)
        numbers.append(number)
    if not mechanism.closures:
        return Loops({}, {}, {}, {}, {}, 1.0)
    L, least = factorise(S, [one for one in mechanism.closures if one.scales], calls)
    calls.write([mechanism.least_pivot], [least])
    ways, supplied = (dict(zip(numbers, one, strict=True)) for one in (found, right))
    return Loops(ways, ends, supplied, {}, L, least)


def close_loops(mechanism: Mechanism, calls: CallList) -> Loops:
    """Add the closures' forces to those of all links."""
    loops = factorise_loops(mechanism, calls)
    multipliers = loops.solved(list(loops.multipliers.values()))
    loops = loops._replace(multipliers=multipliers)
    for number, mine in loops.found.items():
        for moved, V in mine.V.items():
            moved.forces = c.with_multipliers(moved.forces, V, multipliers[number])
        for link, on_it in mine.through.items():
            link.closing.append((on_it, multipliers[number]))
    return loops


def factorise(S: c.Blocks, closures: Sequence[Closure], calls: CallList) -> tuple[c.Blocks, Any]:
    """Return the factor of J M^-1 J^T, lower blocks by two closures, and its smallest pivot; store its diagonals."""
    rest, L, least = dict(S), c.Blocks(), 1.0
    for j, one in enumerate(closures):
        given = rest[j, j], [row[i] for i, row in enumerate(S[j, j])], one.scales, least
        L[j, j], least = calls.store([*one.diagonal, *one.roots], c.cholesky, *given)
        column = [i for i in range(j + 1, len(closures)) if (i, j) in rest]
        for at, i in enumerate(column):
            L[i, j] = c.below(rest[i, j], L[j, j])
            for k in column[: at + 1]:
                before = rest.get((i, k)) or [[0.0] * len(L[k, j])] * len(L[i, j])
                rest[i, k] = c.subtract_product(before, L[i, j], L[k, j])
    return L, least


def pass_inwards(
    ends: Ends, gamma: t.Numbers, on_shapes: Mapping[Link, c.Rows] = MappingProxyType({})
) -> tuple[Spread, t.Numbers, c.Rows]:
    """Return V = L^-1 J^T of rows, gamma - V^T L^-1 f, and V^T V; on_shapes: forces on the shapes of links, per row."""
    found, S = Spread({}, {}), [[0.0] * (i + 1) for i in range(len(gamma))]

    def passed(link: Link, wrenches: c.Wrenches, loads: list[tuple[c.Wrenches, Columns]]) -> c.Wrenches:
        nonlocal gamma, S
        carried_on = int(link.on_link)
        if modes := link.modes:
            forces = on_shapes.get(link, [[0.0] * len(modes.q)] * len(gamma))
            V, gamma, S, wrenches = modes.spread(forces, loads, wrenches, gamma, S)
            for block, rows in V.items():
                found.V[block] = rows
        if link.driven or link.watched:
            found.through[link] = wrenches
        if not link.gains:
            return c.inwards(link.step, wrenches) if carried_on else []
        given = carried_on, link.step, link.gains, link.forces, wrenches, gamma, S
        found.V[link], gamma, S, on_parent = c.spread(*given)
        return on_parent

    to_the_ground(ends, passed, dict.fromkeys(on_shapes, [Wrench(ZERO, ZERO)] * len(gamma)))
    return found, gamma, S


def jacobian(ends: Ends, *, driven: bool = False) -> dict[Link | Modes, c.Rows]:
    """Return J^T of rows by what they move, per coordinate or shape a number for each row; driven: with driven ones."""
    found = dict[Link | Modes, c.Rows]()

    def passed(link: Link, wrenches: c.Wrenches, loads: list[tuple[c.Wrenches, Columns]]) -> c.Wrenches:
        if modes := link.modes:
            found[modes] = modes.jacobian(loads)
        if driven or not link.driven:
            found[link] = c.along([link.step.S], [wrenches])
        return c.inwards(link.step, wrenches) if link.on_link else []

    to_the_ground(ends, passed)
    return found


def to_the_ground(
    ends: Ends,
    passed: Callable[[Link, c.Wrenches, list[tuple[c.Wrenches, Columns]]], c.Wrenches],
    on_links: Mapping[Link, c.Wrenches] = MappingProxyType({}),
) -> None:
    """Pass wrenches on frames to the ground, from leaves on.

    passed: returns what a link passes to its parent of all wrenches on it; it has those that act at its frames, too,
    each with the motion of its frame per rate of each shape.  on_links: wrenches on links besides.
    """
    waiting = dict(on_links)
    loads = {link: list[tuple[c.Wrenches, Columns]]() for link in on_links}

    def receive(frame: Frame, wrenches: c.Wrenches) -> None:
        link = frame.carrier
        if isinstance(link, Link):
            waiting[link] = c.together(waiting[link], wrenches) if link in waiting else wrenches
            loads.setdefault(link, []).append((wrenches, frame.deformed[1]))

    for frame, wrenches in ends:
        receive(frame, wrenches)
    while waiting:
        link = max(waiting, key=lambda link: link.depth)
        receive(link.frame, passed(link, waiting.pop(link), loads[link]))
