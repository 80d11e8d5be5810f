"""A mechanism of rigid and flexible bodies as objects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import flexible as f
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.modes import Modes
from flexclear.dynamics.mechanics.trees import (
    Beyond,
    Body,
    Bounds,
    Columns,
    Coordinates,
    Resistance,
    Site,
    Step,
)
from flexclear.dynamics.routines.calls import Cell
from flexclear.dynamics.vectors import AT_REST, Motion, Twist, Wrench

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
        """Site on the body as that is deformed, and its motion per rate of each shape; once the body is placed."""
        if isinstance(self.undeformed, Site):
            return self.undeformed, ()
        modes = self.modes
        return modes.at_port(self.carrier.motion, self.undeformed)

    @property
    def modes(self) -> Modes:
        """Modes of the flexible body that it is on."""
        assert isinstance(self.carrier, Link)
        assert self.carrier.modes is not None
        return self.carrier.modes

    @property
    def placed(self) -> tuple[Motion, Site]:
        """The motion of its body, and its site there: what `trees.site_motion` takes."""
        return self.carrier.motion, self.deformed[0]

    @property
    def acceleration(self) -> Twist:
        """The part of the acceleration of its body with the frame that is from unknown rates of speeds."""
        if not self.deformed[1]:
            return self.carrier.acceleration
        return self.modes.follow(self.carrier.acceleration, self.deformed[1])

    def resist(self, resistance: Resistance) -> None:
        """Let the body resist, through this frame, what is about the origin of the body."""
        self.carrier.beyond.append((resistance, self.deformed[1]))

    def push(self, wrench: Wrench) -> None:
        """Apply a wrench, about the origin of the body, to the body and its modes, before these are eliminated."""
        self.resist(t.push(wrench))


@dataclass(eq=False)
class Link(Carrier):
    """A body with the joint that carries it. Its numbers are in memory.

    frame: of the joint, on the parent.  body: of a rigid body.  modes: of a flexible one.  rates: where those of its
    positions and speeds are stored.  book: of the ledger, for its drives.  watched: True when the wrench through its
    joint is needed.  The others follow as `trees` has them; closing: wrenches of closures and of bearings on it and all
    beyond, by rows, and their sizes; own: of the bearings of its joint, which that transmits; changes: of its speeds,
    by forces alone.
    """

    frame: Frame
    kind: str
    body: Body
    bounds: Bounds
    coordinates: Coordinates
    rates: Cells = ()
    book: int = -1
    modes: Modes | None = None
    watched: bool = False
    step: Step = field(init=False)
    rest: Resistance = field(init=False)
    gains: t.Gains = field(init=False, default=())
    forces: t.Numbers = field(init=False, default=())
    changes: t.Numbers = field(init=False, default=())
    closing: list[tuple[c.Wrenches, t.Numbers]] = field(init=False, default_factory=list)
    own: list[tuple[c.Wrenches, t.Numbers]] = field(init=False, default_factory=list)

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
    """A joint that closes a loop, or a gear. frames: on whose bodies its rows act.

    routine: takes what is given, the number of rows solved for, and the frames' ends, and returns what is stored in
    `results`, then gamma of those rows and their wrenches on each body; see `closures.closure`.  residuals, opening:
    of the rows solved for, those results, and their rates.  diagonal, roots: where the diagonal of J M^-1 J^T and of
    its inverse factor are stored.  scales: reference of each pivot.
    """

    routine: Callable
    given: tuple[Any, ...]
    frames: Sequence[Frame]
    results: Cells
    residuals: Cells
    opening: Cells
    diagonal: Cells
    roots: Cells
    scales: Cells


class Action(NamedTuple):
    """A contact or a load. frames: those on which it acts, and others that it reads.

    routine: takes what is given and the frames' ends, and returns what is stored in `results`, the wrenches on the
    bodies of the first frames, and powers.  book: of the ledger, for the first of these.
    """

    routine: Callable
    given: tuple[Any, ...]
    frames: Sequence[Frame]
    results: Cells
    book: int = -1


class Rubbed(NamedTuple):
    """A bearing with friction. given: what it is, its law and its numbers, and the state of its bristles.

    sliding, load, bends: where its sliding velocity with the bristles' rate, its load, and the parts of that with kinks
    are stored.  record: where that is stored which only the record has (`bearings.bearing_record`).
    """

    given: tuple[Any, ...]
    sliding: Cells
    load: Cell
    bends: Cells
    record: Cells


class Rubbing(NamedTuple):
    """Friction of an ideal joint. frames: of the joint.  link: that it carries, or None.  second: 1 when that is on the
    side of the second frame, else -1.  closure: of a joint that closes a loop, or -1.  book: of the ledger.  reactions:
    where the record stores those of the joint, without friction, then per normal force of each bearing."""

    frames: tuple[Frame, Frame]
    link: Link | None
    second: int
    closure: int
    bearings: Sequence[Rubbed]
    book: int
    reactions: Sequence[Cells]


class Mechanism(NamedTuple):
    """A mechanism. links: parents first, without the ground.  frames: all.  least_pivot: where the closures' smallest
    is stored.

    ledger: where the rates are stored of those books that no action stores itself.
    """

    ground: Carrier
    links: Sequence[Link]
    frames: Sequence[Frame]
    closures: Sequence[Closure]
    actions: Sequence[Action]
    rubbing: Sequence[Rubbing]
    gravity: Cells
    ledger: Mapping[int, Cell]
    least_pivot: Cell
