"""A mechanism of rigid bodies as objects, and the calls that compute the rates of its state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.trees import Body, Coordinates, Motion, Resistance, Site, Step
from flexclear.dynamics.mechanics.vectors import AT_REST, Twist, Wrench
from flexclear.dynamics.routines.calls import RESULTS, CallList, Cell, routine
from flexclear.dynamics.routines.symbols import select

Cells = Sequence[Cell]


@dataclass(eq=False)
class Carrier:
    """The ground, or a link.

    acceleration: its part from unknown rates of speeds.  beyond: of what it carries.  applied: by contacts and loads.
    depth: links to the ground.
    """

    motion: Motion = field(init=False)
    acceleration: Twist = field(init=False, default=AT_REST)
    beyond: list[Resistance] = field(init=False, default_factory=list)
    applied: Wrench | None = field(init=False, default=None)
    depth: int = field(init=False, default=0)


@dataclass(eq=False)
class Link(Carrier):
    """A body with the joint that carries it. Its numbers are in memory.

    site: of the joint, on the parent.  rates: where those of its positions and speeds are stored.  book: of the ledger,
    for its drives.  The others follow as `trees` has them; closing: wrenches of the closures on it and all beyond, by
    rows, and the multipliers.
    """

    parent: Carrier
    kind: str
    site: Site
    body: Body
    coordinates: Coordinates
    rates: Cells = ()
    book: int = -1
    step: Step = field(init=False)
    rest: Resistance = field(init=False)
    gains: t.Gains = field(init=False, default=())
    forces: t.Numbers = field(init=False, default=())
    closing: list[tuple[c.Wrenches, t.Numbers]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.depth = self.parent.depth + 1

    @property
    def driven(self) -> bool:
        """True when its coordinates are prescribed."""
        return self.book >= 0

    @property
    def on_link(self) -> bool:
        """True when another link carries it."""
        return isinstance(self.parent, Link)


#: a frame of a mechanism: what it is on, and its site there
Frame = tuple[Carrier, Site]


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


class Action(NamedTuple):
    """A contact or a load. frames: those between which it acts, and others that it reads.

    routine: takes what is given and the frames' ends, and returns what is stored in `results`, the wrenches on the
    bodies of the first two frames, and powers.  book: of the ledger, for the first of these.
    """

    routine: Callable
    given: tuple[Any, ...]
    frames: Sequence[Frame]
    results: Cells
    book: int = -1


class Mechanism(NamedTuple):
    """A mechanism. links: parents first, without the ground.  least_pivot: where the closures' smallest is stored.

    ledger: where the rates are stored of those books that no action stores itself.
    """

    ground: Carrier
    links: Sequence[Link]
    closures: Sequence[Closure]
    actions: Sequence[Action]
    gravity: Cells
    ledger: Mapping[int, Cell]
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
        supplied = acted(mechanism, calls)
        sound = eliminated(mechanism)
        least = closed(mechanism, calls) if mechanism.closures else 1.0
        for link in mechanism.links:
            if link.driven:
                link.acceleration = t.follow(link.parent.acceleration, link.step)
            else:
                given = link.parent.acceleration, link.step, link.gains, link.forces
                link.acceleration = calls.store(link.rates, t.accelerate, link.kind, link.coordinates, *given)
        calls.write(list(mechanism.ledger.values()), booked(mechanism, [*supplied, *powers_of_drives(mechanism)]))
        calls.store([Cell(RESULTS, 0)], status, sound, least)
    return calls


def placed(mechanism: Mechanism) -> None:
    """Compute the motion of all links, with the known part of their accelerations."""
    mechanism.ground.motion = t.ground(mechanism.gravity)
    for link in mechanism.links:
        link.motion, link.step = t.place(link.kind, link.parent.motion, link.site, link.coordinates)


def acted(mechanism: Mechanism, calls: CallList) -> list[tuple[int, Any]]:
    """Apply contacts and loads to all bodies; return powers by their books."""
    powers = list[tuple[int, Any]]()
    for one in mechanism.actions:
        ends = [(carrier.motion, site) for carrier, site in one.frames]
        wrenches, supplied = calls.store(one.results, one.routine, *one.given, *ends)
        for (carrier, _), wrench in zip(one.frames, wrenches, strict=False):
            if isinstance(carrier, Link):
                carrier.applied = t.added(carrier.applied, wrench) if carrier.applied else wrench
        powers += [(one.book + k, power) for k, power in enumerate(supplied) if power != 0.0]
    for link in mechanism.links:
        if link.applied:
            link.beyond.append(t.applied(link.applied))
    return powers


def eliminated(mechanism: Mechanism) -> Any:
    """Eliminate all unknown coordinates, from the leaves to the ground; return whether all move mass."""
    sound: Any = 1.0
    for link in reversed(mechanism.links):
        if link.driven:
            link.rest = t.resist(link.motion, link.body, link.beyond)
            rest = t.carry(link.step, link.rest) if link.on_link else None
        else:
            given = int(link.on_link), link.motion, link.body, link.step, link.beyond, sound
            rest, link.gains, link.forces, sound = t.eliminate(*given)
        if rest:
            link.parent.beyond.append(rest)
    return sound


def closed(mechanism: Mechanism, calls: CallList) -> Any:
    """Add the closures' forces to those of all links; return the smallest pivot of their matrix."""
    found, right, S, moved_by = list[Spread](), list[Any](), c.Blocks(), dict[Link, list[int]]()
    for one in mechanism.closures:
        kept, frames = len(one.scales), [(link.motion, site) for link, site in (one.a, one.b)]
        gamma, *wrenches = calls.store(one.residuals, c.closure, one.rows, kept, *frames)
        if not kept:
            continue
        i, ends = len(found), zip((one.a[0], one.b[0]), wrenches, strict=True)
        mine, gamma, S[i, i] = passed_inwards(ends, gamma)
        for link, V in mine.V.items():
            for k in moved_by.setdefault(link, []):
                before = S.get((i, k)) or [[0.0] * len(right[k])] * kept
                S[i, k] = c.coupled(before, V, found[k].V[link])
            moved_by[link].append(i)
        found.append(mine)
        right.append(gamma)
    L, least = factorised(S, [one for one in mechanism.closures if one.scales], calls)
    for mine, multipliers in zip(found, c.solved(L, right), strict=True):
        for link, V in mine.V.items():
            link.forces = c.with_multipliers(link.forces, V, multipliers)
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
    """Rows of a closure passed from its ends to the ground: V by link, and wrenches on links with drives."""

    V: dict[Link, c.Rows]
    driven: dict[Link, c.Wrenches]


def passed_inwards(ends: Iterable[tuple[Carrier, c.Wrenches]], gamma: t.Numbers) -> tuple[Spread, t.Numbers, c.Rows]:
    """Return V = L^-1 J^T of the rows of a closure, gamma - V^T L^-1 f, and V^T V; ends: links and wrenches on them."""
    found, waiting = Spread({}, {}), dict[Link, c.Wrenches]()
    S: c.Rows = [[0.0] * (i + 1) for i in range(len(gamma))]

    def receive(link: Carrier, wrenches: c.Wrenches) -> None:
        if isinstance(link, Link):
            waiting[link] = c.together(waiting[link], wrenches) if link in waiting else wrenches

    for link, wrenches in ends:
        receive(link, wrenches)
    while waiting:
        link = max(waiting, key=lambda link: link.depth)
        wrenches, carried_on = waiting.pop(link), int(link.on_link)
        if link.driven:
            found.driven[link] = wrenches
        if link.gains:
            given = carried_on, link.step, link.gains, link.forces, wrenches, gamma, S
            found.V[link], gamma, S, passed = c.spread(*given)
        else:
            passed = c.inwards(link.step, wrenches) if carried_on else []
        receive(link.parent, passed)
    return found, gamma, S


def powers_of_drives(mechanism: Mechanism) -> list[tuple[int, Any]]:
    """Return the powers of the drives by their books."""
    powers = list[tuple[int, Any]]()
    for link in mechanism.links:
        if link.driven:
            given = link.step, link.rest, link.acceleration, link.closing, link.coordinates.u
            powers.append((link.book, t.driving_power(*given)))
    return powers


def booked(mechanism: Mechanism, powers: Iterable[tuple[int, Any]]) -> list[Any]:
    """Return the rates of the ledger's books: sums of powers."""
    sums: dict[int, Any] = dict.fromkeys(mechanism.ledger, 0.0)
    for book, power in powers:
        sums[book] = t.added(sums[book], power) if sums[book] else power
    return list(sums.values())
