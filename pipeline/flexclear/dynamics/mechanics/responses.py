"""Lists of calls besides the evaluation: changes that close loops, positions after a displacement, and responses to the
springs of modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.evaluation import (
    REPORTS,
    Influence,
    answered,
    eliminate_coordinates,
    influence,
    place_links,
    respond,
    status,
)
from flexclear.dynamics.mechanics.loops import Loops, factorise_loops, pass_inwards
from flexclear.dynamics.mechanics.mechanism import Link, Mechanism
from flexclear.dynamics.mechanics.modes import Block
from flexclear.dynamics.routines.calls import RESULTS, CallList, Cell
from flexclear.dynamics.vectors import ZERO, Wrench

#: time over which a gap is closed [s]: modes with shorter periods respond by their stiffness, not by their mass
CLOSING = 0.1


def factor_matrices(mechanism: Mechanism, calls: CallList, slowness: float = 0.0) -> Loops:
    """Place all links, and factorise the mass matrix and that of the loops; slowness: as in `eliminate_coordinates`."""
    place_links(mechanism)
    sound, loops = eliminate_coordinates(mechanism, slowness), factorise_loops(mechanism, calls)
    calls.store([Cell(RESULTS, 0)], status, [calls.number(one) for one in REPORTS], sound, loops.least, 0.0)
    return loops


def correct_state(mechanism: Mechanism, calls: CallList) -> None:
    """Store, in place of the rates of the state, the least changes of positions and speeds which close the loops, and
    stop their opening (docs/theory.md, Projection)."""
    loops = factor_matrices(mechanism, calls, CLOSING**2)
    closures = [one for one in mechanism.closures if one.scales]
    for of_speeds in (True, False):
        forces: dict[Link | Block, t.Numbers] = {}
        answered(loops, forces, [c.opposite(one.opening if of_speeds else one.residuals) for one in closures])
        respond(mechanism, forces)
        write_changes(mechanism, calls, of_speeds=of_speeds)


def write_changes(mechanism: Mechanism, calls: CallList, *, of_speeds: bool) -> None:
    """Store the changes of speeds by the forces alone, or those of positions at these, taken for speeds."""
    for link in mechanism.links:
        x = link.coordinates.x
        if of_speeds:
            calls.write(link.rates[len(x) :], link.changes)
        elif link.rates:
            calls.write(link.rates[: len(x)], t.position_rates(link.kind, x, link.changes))
        if modes := link.modes:
            half = modes.rates[len(modes.q) :] if of_speeds else modes.rates[: len(modes.q)]
            calls.write(half, modes.in_modes(modes.accelerations))


def displace_state(mechanism: Mechanism, calls: CallList) -> None:
    """Move the positions of the state by a displacement, given as rates of its speeds."""
    for link in mechanism.links:
        x = link.coordinates.x
        if link.rates:
            calls.write(x, t.move_positions(link.kind, x, link.rates[len(x) :]))
        if modes := link.modes:
            calls.write(modes.q, c.together(modes.q, modes.rates[len(modes.q) :]))


def release_springs(mechanism: Mechanism, calls: CallList, loops: Loops) -> None:
    """Replace forces on modes, given as rates of their speeds, by the rates that they alone cause; with the power of
    the drives, and its growth as these speed up, in place of the first two books."""
    forces = {link: [modes.in_shapes(modes.rates[len(modes.q) :])] for link in mechanism.links if (modes := link.modes)}
    spread, *_ = pass_inwards([], [0.0], forces)
    by = influence(loops, spread, 0, Wrench(ZERO, ZERO))
    respond(mechanism, by.forces)
    for of_speeds in (False, True):
        write_changes(mechanism, calls, of_speeds=of_speeds)
    calls.write([mechanism.ledger[k] for k in (m.DRIVE_WORK, m.MODAL_LOSS)], powers_of_drives(mechanism, loops, by))


def powers_of_drives(mechanism: Mechanism, loops: Loops, by: Influence) -> list[Any]:
    """Return the power of all drives that an influence causes at present accelerations, and its growth by theirs."""
    powers: list[Any] = [0.0, 0.0]
    for link in mechanism.links:
        if link.driven:
            closing = [(one.through[link], by.multipliers[k]) for k, one in loops.found.items() if link in one.through]
            closing += [([by.through[link]], [1.0])] if link in by.through else []
            alone = t.Resistance(link.rest.I, Wrench(ZERO, ZERO))
            for k, motion in enumerate((link.coordinates.u, link.coordinates.du)):
                given = link.step, alone, link.acceleration, closing, motion
                powers[k] = t.add(powers[k], t.driving_power(*given))
    return powers


#: parts of each list, by the index of its address in h; each takes what the one before returns
LISTS: dict[int, tuple[Callable, ...]] = {
    m.CLOSE: (correct_state,),
    m.MOVE: (displace_state,),
    m.SPRINGS: (factor_matrices, release_springs),
}


def append_list(mechanism: Mechanism, calls: CallList, where: int) -> CallList:
    """Append the calls of the list whose address is at a place of h."""
    before: tuple[Any, ...] = ()
    for part in LISTS[where]:
        with calls.building():
            found = part(mechanism, calls, *before)
        before = (found,)
        calls.divide()
    return calls
