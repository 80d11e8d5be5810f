"""A mechanism of rigid and flexible bodies as objects, and the calls that compute the rates of its state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import flexible as f
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.trees import (
    Beyond,
    Body,
    Bounds,
    Columns,
    Coordinates,
    Motion,
    Resistance,
    Site,
    Step,
)
from flexclear.dynamics.mechanics.vectors import AT_REST, Twist, Wrench
from flexclear.dynamics.routines.calls import RESULTS, CallList, Cell, routine
from flexclear.dynamics.routines.symbols import select

Cells = Sequence[Cell]


@dataclass(eq=False)
class Carrier:
    """The ground, or a link.

    acceleration: its part from unknown rates of speeds, for a flexible body as if that were rigid.  beyond: of what it
    carries, and of forces on it.  depth: links to the ground.
    """

    motion: Motion = field(init=False)
    acceleration: Twist = field(init=False, default=AT_REST)
    beyond: list[Beyond] = field(init=False, default_factory=list)
    depth: int = field(init=False, default=0)


@dataclass(eq=False)
class Frame:
    """A frame of a mechanism: what it is on, and its undeformed site there."""

    carrier: Carrier
    undeformed: Site | f.Port

    @cached_property
    def deformed(self) -> tuple[Site, Columns]:
        """Its site on the body as that is deformed, and its motion per rate of each shape; once the body is placed."""
        if isinstance(self.undeformed, Site):
            return self.undeformed, ()
        link, modes = self.carrier, self.carrier.modes
        return f.at_port(modes.held, link.motion, modes.twists, self.undeformed, *modes.moving)

    @property
    def placed(self) -> tuple[Motion, Site]:
        """The motion of its body, and its site there: what `trees.carried` takes."""
        return self.carrier.motion, self.deformed[0]

    @property
    def acceleration(self) -> Twist:
        """The part of the acceleration of its body with the frame that is from unknown rates of speeds."""
        if not self.deformed[1]:
            return self.carrier.acceleration
        return f.follow(self.carrier.acceleration, self.deformed[1], self.carrier.modes.accelerations)

    def resist(self, resistance: Resistance) -> None:
        """Let the body resist, through this frame, what is about the origin of the body."""
        self.carrier.beyond.append((resistance, self.deformed[1]))

    def push(self, wrench: Wrench) -> None:
        """Apply a wrench, about the origin of the body, to the body and its modes, before these are eliminated."""
        self.resist(t.pushed(wrench))


@dataclass(eq=False)
class Modes:
    """Modes of a flexible body. Its numbers are in memory.

    inboard: frame of the body's joint on the body.  q, u: coordinates and their rates.  rates: where the rates of these
    are stored.  places, basis: see `flexible.need`; held: shapes that move no frame.  stations: of a rod that loads
    stiffen.  book: of the ledger, for the loss.  The others follow as `flexible` has them.
    """

    inboard: Site | f.Port
    body: f.Modal
    q: Cells
    u: Cells
    rates: Cells
    places: f.Places
    basis: f.Places
    held: int
    stations: Sequence[f.Station]
    book: int
    twists: Columns = field(init=False)
    gains: f.Gains = field(init=False)
    forces: t.Numbers = field(init=False)
    accelerations: t.Numbers = field(init=False)

    @cached_property
    def moving(self) -> tuple[t.Numbers, t.Numbers]:
        """Coordinates and rates of the moving shapes."""
        q, u = (f.moving(self.basis, self.body.T, self.held, values) for values in (self.q, self.u))
        return q, u


@dataclass(eq=False)
class Link(Carrier):
    """A body with the joint that carries it. Its numbers are in memory.

    frame: of the joint, on the parent.  body: of a rigid body.  modes: of a flexible one.  rates: where those of its
    positions and speeds are stored.  book: of the ledger, for its drives.  The others follow as `trees` has them;
    closing: wrenches of the closures on it and all beyond, by rows, and the multipliers.
    """

    frame: Frame
    kind: str
    body: Body
    bounds: Bounds
    coordinates: Coordinates
    rates: Cells = ()
    book: int = -1
    modes: Modes | None = None
    step: Step = field(init=False)
    rest: Resistance = field(init=False)
    gains: t.Gains = field(init=False, default=())
    forces: t.Numbers = field(init=False, default=())
    closing: list[tuple[c.Wrenches, t.Numbers]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.depth = self.frame.carrier.depth + 1

    @property
    def driven(self) -> bool:
        """True when its coordinates are prescribed."""
        return self.book >= 0

    @property
    def on_link(self) -> bool:
        """True when another link carries it."""
        return isinstance(self.frame.carrier, Link)


class Closure(NamedTuple):
    """A joint that closes a loop, between frames a and b.

    rows: see `closures.row`; those solved for come first.  residuals: where those of all rows and their rates are
    stored.  diagonal, roots: of the rows solved for, where the diagonal of J M^-1 J^T and of its inverse factor are
    stored.  scales: reference of each pivot.
    """

    a: Frame
    b: Frame
    rows: tuple[tuple[int, int, int], ...]
    residuals: Cells
    diagonal: Cells
    roots: Cells
    scales: Cells


class Mechanism(NamedTuple):
    """A mechanism. links: parents first, without the ground.  ledger: where its rates are stored.

    least_pivot: where the smallest pivot of the closures is stored.
    """

    ground: Carrier
    links: Sequence[Link]
    closures: Sequence[Closure]
    gravity: Cells
    ledger: Cells
    least_pivot: Cell


@routine
def status(sound: Any, least: Any) -> tuple[Any]:
    """Return the report of an evaluation (`memory`), from those of `trees.eliminate` and `closures.independence`."""
    regular = select(least > c.SINGULAR, float(m.OK), float(m.SINGULAR))
    return (select(sound > 0.5, regular, float(m.NOT_POSITIVE)),)


def evaluation(mechanism: Mechanism) -> CallList:
    """Return the calls that store the rates of the state, and what steps read besides (`specialise.program.KEPT`)."""
    with CallList().building() as calls:
        placed(mechanism)
        sound = eliminated(mechanism)
        least = closed(mechanism, calls) if mechanism.closures else 1.0
        for link in mechanism.links:
            if link.driven:
                link.acceleration = t.follow(link.frame.acceleration, link.step)
            else:
                given = link.frame.acceleration, link.step, link.gains, link.forces
                link.acceleration = calls.store(link.rates, t.accelerate, link.kind, link.coordinates, *given)
            if modes := link.modes:
                given = modes.basis, modes.body.T, modes.u, modes.gains, modes.forces, link.acceleration
                modes.accelerations = calls.store(modes.rates, f.accelerate, *given)
        calls.write(mechanism.ledger, powers(mechanism))
        calls.store([Cell(RESULTS, 0)], status, sound, least)
    return calls


def placed(mechanism: Mechanism) -> None:
    """Compute the motion of all links, with the known part of their accelerations."""
    mechanism.ground.motion = t.ground(mechanism.gravity)
    for link in mechanism.links:
        link.motion, link.step = t.place(link.kind, *link.frame.placed, link.coordinates)
        if modes := link.modes:
            given = modes.held, link.motion, link.step, modes.inboard, *modes.moving
            link.motion, link.step, modes.twists = f.body_of(*given)


def eliminated(mechanism: Mechanism) -> Any:
    """Eliminate all unknown coordinates, from the leaves to the ground; return whether all move mass."""
    sound: Any = 1.0
    for link in reversed(mechanism.links):
        carried_on = int(link.on_link)
        if modes := link.modes:
            more: Any = [0.0] * len(modes.q)
            for station in modes.stations:
                more = f.bend(more, station, modes.q)
            need = f.need(modes.places, modes.basis, link.motion, modes.twists, modes.body, modes.q, modes.u, more)
            modes.gains, modes.forces, link.rest, sound = f.eliminate(need, link.beyond, sound)
        elif link.driven:
            link.rest = t.resist(link.motion, link.body, link.beyond)
        if link.driven:
            rest = t.carry(link.step, link.rest) if link.on_link else None
        elif link.modes:
            rest, link.gains, link.forces, sound = t.free_joint(carried_on, link.rest, link.bounds, link.step, sound)
        else:
            given = carried_on, link.motion, link.body, link.bounds, link.step, link.beyond, sound
            rest, link.gains, link.forces, sound = t.eliminate(*given)
        if rest:
            link.frame.resist(rest)
    return sound


def closed(mechanism: Mechanism, calls: CallList) -> Any:
    """Add the closures' forces to those of all links; return the smallest pivot of their matrix."""
    found, right, S, moved_by = list[Spread](), list[Any](), c.Blocks(), dict[Link | Modes, list[int]]()
    for one in mechanism.closures:
        kept, frames = len(one.scales), (one.a, one.b)
        gamma, *wrenches = calls.store(one.residuals, c.closure, one.rows, kept, *(frame.placed for frame in frames))
        if not kept:
            continue
        i = len(found)
        mine, gamma, S[i, i] = passed_inwards(list(zip(frames, wrenches, strict=True)), gamma)
        for moved, V in mine.V.items():
            for k in moved_by.setdefault(moved, []):
                before = S.get((i, k)) or [[0.0] * len(right[k])] * kept
                S[i, k] = c.coupled(before, V, found[k].V[moved])
            moved_by[moved].append(i)
        found.append(mine)
        right.append(gamma)
    L, least = factorised(S, [one for one in mechanism.closures if one.scales], calls)
    for mine, multipliers in zip(found, c.solved(L, right), strict=True):
        for moved, V in mine.V.items():
            moved.forces = c.with_multipliers(moved.forces, V, multipliers)
        for link, on_it in mine.driven.items():
            link.closing.append((on_it, multipliers))
    calls.write([mechanism.least_pivot], [least])
    return least


def factorised(S: c.Blocks, closures: Sequence[Closure], calls: CallList) -> tuple[c.Blocks, Any]:
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
                rest[i, k] = c.eliminated(before, L[i, j], L[k, j])
    return L, least


class Spread(NamedTuple):
    """Rows of a closure passed from its ends to the ground: V by what it moves, and wrenches on links with drives."""

    V: dict[Link | Modes, c.Rows]
    driven: dict[Link, c.Wrenches]


def passed_inwards(ends: Sequence[tuple[Frame, c.Wrenches]], gamma: t.Numbers) -> tuple[Spread, t.Numbers, c.Rows]:
    """Return V = L^-1 J^T of a closure's rows, gamma - V^T L^-1 f, and V^T V; ends: frames and wrenches on them."""
    found, waiting, loads = Spread({}, {}), dict[Link, c.Wrenches](), dict[Link, list[tuple[c.Wrenches, Columns]]]()
    S: c.Rows = [[0.0] * (i + 1) for i in range(len(gamma))]

    def receive(frame: Frame, wrenches: c.Wrenches) -> None:
        link = frame.carrier
        if isinstance(link, Link):
            waiting[link] = c.together(waiting[link], wrenches) if link in waiting else wrenches
            loads.setdefault(link, []).append((wrenches, frame.deformed[1]))

    for frame, wrenches in ends:
        receive(frame, wrenches)
    while waiting:
        link = max(waiting, key=lambda link: link.depth)
        wrenches, carried_on = waiting.pop(link), int(link.on_link)
        if modes := link.modes:
            given = modes.gains, modes.forces, loads[link], wrenches, gamma, S
            found.V[modes], gamma, S, wrenches = f.spread(*given)
        if link.driven:
            found.driven[link] = wrenches
        if link.gains:
            given = carried_on, link.step, link.gains, link.forces, wrenches, gamma, S
            found.V[link], gamma, S, passed = c.spread(*given)
        else:
            passed = c.inwards(link.step, wrenches) if carried_on else []
        receive(link.frame, passed)
    return found, gamma, S


def powers(mechanism: Mechanism) -> list[Any]:
    """Return the rates of the ledger: powers of drives, and lost to damping of modes, in their books, else zeros."""
    sums: list[Any] = [0.0] * len(mechanism.ledger)
    for link in mechanism.links:
        entries = []
        if link.driven:
            given = link.step, link.rest, link.acceleration, link.closing, link.coordinates.u
            entries.append((link.book, t.driving_power(*given)))
        if modes := link.modes:
            entries.append((modes.book, f.damping_power(modes.body.damping, modes.u)))
        for book, power in entries:
            (sums[book],) = c.together([sums[book]], [power])
    return sums
