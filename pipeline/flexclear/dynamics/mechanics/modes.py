"""Modes of a flexible body in a mechanism: calls of the routines of `flexible`, block after block of shapes.

A body with few modes is one block, and most of what it needs is one call. With more, code for all products of modes
would have no end. So sums over modes are passed on from block to block, products with matrices are calls for some
numbers of a row, and the mass matrix is factorised by blocks, without those that are zero: codes repeat, and only the
list grows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any

import numpy as np

from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics import flexible as f
from flexclear.dynamics.mechanics import sections as s
from flexclear.dynamics.mechanics import shapes as e
from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.routines.calls import CallList, Cell, products
from flexclear.dynamics.specialise.symbols import leaves
from flexclear.dynamics.vectors import AT_REST, ZERO, Twist, Vector

#: modes of a body up to which they are one block, since code without tables serves short rows best; most of a block of
#: those with more
FEW, SIZE = 32, 16


@dataclass(eq=False)
class Block:
    """Shapes that are eliminated together.

    at: which.  below: rows of the factor, by the earlier blocks to which they belong, where they are not zero.
    """

    at: slice
    gains: e.Gains = field(init=False)
    forces: t.Numbers = field(init=False)
    accelerations: t.Numbers = field(init=False)
    below: dict[Block, c.Rows] = field(init=False, default_factory=dict)


@dataclass(eq=False)
class Modes:
    """Modes of a flexible body. Its numbers are in memory.

    inboard: frame of the body's joint on the body.  q, u: coordinates and their rates.  rates: where the rates of these
    are stored.  places, basis: see `flexible.need`; held: shapes that move no frame.  stations: of a rod that loads
    stiffen.  stiffness: in shapes, rows up to the diagonal.  book: of the ledger, for the loss.  The others follow as
    `flexible` has them; sections: of the stations, turned and bent.
    """

    inboard: t.Site | f.Port
    body: f.Modal
    q: Sequence[Cell]
    u: Sequence[Cell]
    rates: Sequence[Cell]
    places: f.Places
    basis: f.Places
    held: int
    stations: Sequence[s.Station]
    stiffness: c.Rows
    book: int
    blocks: list[Block] = field(init=False)
    twists: t.Columns = field(init=False)
    sums: f.Sums = field(init=False)
    sections: list[tuple[Vector, Vector]] = field(init=False)

    def __post_init__(self) -> None:
        self.blocks = [Block(at) for at in split(len(self.q))]

    @property
    def one(self) -> Block | None:
        """The only block, if there is one."""
        return self.blocks[0] if len(self.blocks) == 1 else None

    @property
    def accelerations(self) -> list[Any]:
        """Return the accelerations of all shapes."""
        return [one for block in self.blocks for one in block.accelerations]

    # Bases and frames -------------------------------------------------------------------------------------------------
    @cached_property
    def _basis(self) -> list[np.ndarray]:
        """Shape, mode, and number of each entry of T."""
        modes, shapes = np.array(self.basis, dtype=int).reshape(-1, 2).T
        return [shapes, modes, np.arange(len(shapes))]

    def _by_basis(self, entries: Sequence[np.ndarray], vectors: Sequence[Sequence[Any]]) -> list[list[Any]]:
        return products(self.body.T[0], 1, entries, vectors, len(self.q))

    def in_shapes(self, values: Sequence[Any]) -> list[Any]:
        """Return forces on shapes from those on modes."""
        if self.one:
            return f.in_shapes(self.basis, self.body.T, values)
        return self._by_basis(self._basis, [values])[0]

    def in_modes(self, values: Sequence[Any]) -> list[Any]:
        """Return rates of modes from those of shapes."""
        if self.one:
            return f.in_modes(self.basis, self.body.T, values)
        shapes, modes, numbers = self._basis
        order = np.argsort(modes, kind="stable")
        return self._by_basis([modes[order], shapes[order], numbers[order]], [values])[0]

    @cached_property
    def moving(self) -> tuple[t.Numbers, t.Numbers]:
        """Coordinates and rates of the moving shapes."""
        if self.one:
            q, u = (f.moving(self.basis, self.body.T, self.held, values) for values in (self.q, self.u))
            return q, u
        moved = self._basis[0] >= self.held
        p, rates = self._by_basis([one[moved] for one in self._basis], [self.q, self.u])
        return p[self.held :], rates[self.held :]

    def place(self, joint: t.Motion, step: t.Step) -> tuple[t.Motion, t.Step]:
        """Return the motion of the body from that of its joint's frame, and the step to it; find its twists."""
        still, port = [AT_REST] * len(self.q), self.inboard
        if isinstance(port, t.Site):  # no shape moves it
            self.twists = still
            return f.placed(joint, step, port)
        if self.one:
            body, step, self.twists = f.body_of(joint, step, port, *self.moving, still)
            return body, step
        site, *moves = self._deformed(port)
        body, step = f.placed(joint, step, site)
        self.twists = [one for at in self._columns(body, still, site, *moves) for one in f.opposite(at)]
        return body, step

    def at_port(self, motion: t.Motion, port: f.Port) -> tuple[t.Site, t.Columns]:
        """Return the site of a port on the body, and its motion per rate of each shape (`flexible.at_port`)."""
        if self.one:
            site, columns = f.at_port(motion, self.twists, port, *self.moving)
            return site, columns
        site, *moves = self._deformed(port)
        return site, [one for at in self._columns(motion, self.twists, site, *moves) for one in at]

    def _deformed(self, port: f.Port) -> tuple[t.Site, Any, list[Any], list[Any]]:
        """Return the site of a port, T, and its displacement and rotation vector per moving shape."""
        (p, rates), sums, slopes = self.moving, list[Any](), list[list[Any]]()
        for shapes in (port.moves, port.turns):
            bent, bending = curves(shapes.second, p, rates)
            displacement, made = f.Displacement(), list[Any]()
            for at in split(len(p)):
                given = columns(shapes.linear, at), bent[at], bending[at], p[at], rates[at]
                displacement, more = f.displaced(displacement, *given)
                made += more
            sums.append(displacement)
            slopes.append(made)
        return (*f.deformed(port, *sums), *slopes)

    def _columns(
        self, motion: t.Motion, twists: t.Columns, site: t.Site, T: Any, moves: list[Any], turns: list[Any]
    ) -> Iterator[t.Columns]:
        for block in self.blocks:
            moving = slice(max(block.at.start - self.held, 0), max(block.at.stop - self.held, 0))
            yield f.columns_at(motion, twists[block.at], site, T, moves[moving], turns[moving])

    def follow(self, acceleration: Twist, columns: t.Columns) -> Twist:
        """Return the acceleration of a frame by its columns, from that of the body as if rigid."""
        for block in self.blocks:
            if not nothing(columns[block.at]):
                acceleration = e.follow(acceleration, columns[block.at], block.accelerations)
        return acceleration

    # Elimination ------------------------------------------------------------------------------------------------------
    def need(self, motion: t.Motion, *, masses: bool = True) -> f.Need:
        """Return what the body needs alone; P, forces of all shapes, m by two blocks, and that only with `masses`."""
        body = self.body if masses else self.body._replace(mass_of_shapes=())
        more, self.sections = self._bent()
        if self.one:
            need = f.need(self.places, self.basis, motion, self.twists, body, self.q, self.u, more)
            need = need._replace(m={(0, 0): need.m})
        else:
            need = self._need(motion, body, more)
        self.sums = need.sums
        return need

    def _bent(self) -> tuple[list[Any], list[Any]]:
        """Return the forces of all stations on the modes, and the turned and bent sections."""
        more, sections = [0.0] * len(self.q), list[Any]()
        for station in self.stations:
            if self.one:
                more, section = s.bend(more, station, self.q)
            else:
                section, parts = (ZERO, ZERO), list[s.Station]()
                for at in (block.at for block in self.blocks):
                    turning, bending = (columns(one, at) for one in (station.rotation, station.curvature))
                    parts.append(s.Station(turning, bending, station.stiffness))
                    section = s.curvature(*section, parts[-1], self.q[at])
                resisted = s.resisting(station.stiffness, *section)
                both = zip(self.blocks, parts, strict=True)
                more = [one for block, part in both for one in s.bent_forces(more[block.at], part, *resisted)]
            sections.append(section)
        return more, sections

    def _need(self, motion: t.Motion, body: f.Modal, more: list[Any]) -> f.Need:
        """Return what a body of several blocks needs."""
        (q, u), n, places = (self.q, self.u), len(self.q), np.array(self.places, dtype=int).reshape(-1, 3)
        entries = [places[:, 0] * n + places[:, 2], places[:, 1], np.arange(len(places))]
        bent, bending, V = [[0.0] * 9 * n] * 3
        if len(places):
            (position, rate), *_ = body.moments
            (bent, bending), (V,) = (
                products(at, 2, entries, by, 9 * n) for at, by in ((position, (q, u)), (rate, (u,)))
            )
        nine = [body.E, *([one[n * k : n * (k + 1)] for k in range(9)] for one in (bent, bending, V))]
        shares = [f.Share(*(columns(rows, block.at) for rows in nine)) for block in self.blocks]

        curved, sums, slopes = curves(body.moves.second, q, u), f.nothing(body.second), list[Any]()
        for block, share in zip(self.blocks, shares, strict=True):
            at = block.at
            given = columns(body.moves.linear, at), *(one[at] for one in (*curved, q, u))
            sums, made = f.summed(sums, share, *given)
            slopes.append(made)
        known, I, F = f.whole(motion, body.mass, body.first, body.untilted, sums)
        forces, spins = list[Any](), list[Any]()
        for block, share, made in zip(self.blocks, shares, slopes, strict=True):
            given = body.stiffness, body.damping, q, u, more
            on_block, spinning = f.on_modes(known, share, made, *(one[block.at] for one in given))
            forces += on_block
            spins += spinning
        forces, *axes = self._by_basis(self._basis, [forces, *zip(*spins, strict=True)])
        spins, parts = f.by_mode(axes), list[Any]()
        for at in (block.at for block in self.blocks):
            given = spins[at], columns(body.moved, at), *(one[at] for one in (curved[0], self.twists, forces))
            parts.append(f.momenta(motion.R_WB, I, F, *given))
        m = dict[tuple[int, int], Any]()
        for i, (block, (alone, *_)) in enumerate(zip(self.blocks, parts, strict=True)):
            twists = self.twists[block.at]
            for k, (other, (_, momenta, _)) in enumerate(zip(self.blocks[: i + 1], parts, strict=False)):
                mass, others = columns(body.mass_of_shapes[block.at], other.at), self.twists[other.at]
                if mass and not nothing((mass, twists, others)):
                    m[i, k] = f.coupled(mass, alone, momenta, twists, others)
        P, forces = ([one for part in parts for one in part[k]] for k in (1, 2))
        return f.Need(I, F, P, m, forces, sums)

    def hold(self, need: f.Need, beyond: Sequence[t.Beyond]) -> tuple[list[Any], t.Resistance]:
        """Return the forces on the shapes that hold them, and what the body's joint must resist then."""
        forces, rest = list[Any](), t.Resistance(need.I, need.F)
        for i, block in enumerate(self.blocks):
            made, rest = e.held(int(i == 0), rest.F, need.forces[block.at], _of(block, beyond))
            forces += made
        return forces, rest

    def eliminate(
        self, need: f.Need, beyond: Sequence[t.Beyond], sound: Any, slowness: float
    ) -> tuple[t.Resistance, Any]:
        """Eliminate all shapes; return what the body resists while they move freely, and `sound` as `flexible` does.

        slowness: share [s^2] of their stiffness that shapes have in their mass.
        """
        rest = t.Resistance(need.I, need.F)
        for i, block in enumerate(self.blocks):
            taken = e.none_taken(len(need.forces[block.at]))
            for k, before in enumerate(self.blocks[:i]):
                rows = self._factor(need.m, i, k, beyond, slowness)
                if rows:
                    block.below[before] = rows
                    taken = e.take(taken, rows, before.gains.K, before.forces)
            given = need.P[block.at], self._mass(need.m, i, i, slowness), need.forces[block.at], taken
            made = e.eliminate(int(i == 0), rest, *given, _of(block, beyond), sound)
            block.gains, block.forces, rest, sound = made
        return rest, sound

    def _mass(self, m: dict[tuple[int, int], Any], i: int, k: int, slowness: float) -> Any:
        """Return the mass of the shapes of two blocks, none where it is zero."""
        rows, one, other = m.get((i, k), ()), self.blocks[i].at, self.blocks[k].at
        if not slowness:
            return rows
        stiffness = columns(self.stiffness[one], other)
        if nothing(stiffness):
            return rows
        return e.stiffened(rows or [[0.0] * len(row) for row in stiffness], stiffness, slowness)

    def _factor(
        self, m: dict[tuple[int, int], Any], i: int, k: int, beyond: Sequence[t.Beyond], slowness: float
    ) -> c.Rows:
        """Return the rows of the factor of block i that belong to the earlier block k, none where they are zero."""
        block, before = self.blocks[i], self.blocks[k]
        rows = self._mass(m, i, k, slowness)
        both = [(rest.I, given[block.at], given[before.at]) for rest, given in beyond]
        both = [one for one in both if not any(map(nothing, one))]
        less = [one for one in self.blocks[:k] if one in block.below and one in before.below]
        if not rows and not both and not less:
            return ()
        rows = rows or [[0.0] * len(before.forces)] * (block.at.stop - block.at.start)
        rows = e.with_beyond(rows, both) if both else rows
        for one in less:
            rows = c.eliminated(rows, block.below[one], before.below[one])
        return () if nothing(rows) else c.below(rows, before.gains.L)

    def spread(
        self, on_shapes: c.Rows, loads: Sequence[tuple[c.Wrenches, t.Columns]], wrenches: c.Wrenches, *rows: Any
    ) -> tuple[dict[Block, c.Rows], Any, Any, c.Wrenches]:
        """Eliminate all shapes from the rows of a closure (`flexible.spread`); return V by blocks."""
        V, (gamma, S) = dict[Block, c.Rows](), rows
        for block in self.blocks:
            forces = columns(on_shapes, block.at)
            for before, below in block.below.items():
                forces = e.less(forces, below, V[before])
            mine = [(given, motions[block.at]) for given, motions in loads]
            made = e.spread(block.gains, block.forces, forces, mine, wrenches, gamma, S)
            V[block], gamma, S, wrenches = made
        return V, gamma, S, wrenches

    def jacobian(self, loads: Sequence[tuple[c.Wrenches, t.Columns]]) -> list[Any]:
        """Return the forces on all shapes by the rows of a closure."""
        ats = [block.at for block in self.blocks]
        made = (c.along([motions[at] for _, motions in loads], [given for given, _ in loads]) for at in ats)
        return [row for rows in made for row in rows]

    def accelerate(self, a: Twist, calls: CallList | None) -> None:
        """Find the accelerations of all shapes; store the rates of the modes, if there are calls."""
        if (one := self.one) and calls:
            given = self.basis, self.body.T, self.u, one.gains, one.forces, a
            one.accelerations = calls.store(self.rates, e.accelerate, *given)
            return
        for i, block in reversed(list(enumerate(self.blocks))):
            forces = block.forces
            for later in self.blocks[i + 1 :]:
                if block in later.below:
                    forces = c.minus_transposed(forces, later.below[block], later.accelerations)
            block.accelerations = e.accelerations(block.gains, forces, a)
        if calls:
            calls.write(self.rates, [*self.u, *self.in_modes(self.accelerations)])

    # Energies ---------------------------------------------------------------------------------------------------------
    def energies(self, motion: t.Motion, gravity: Vector, kinetic: Any, potential: Any, elastic: Any) -> list[Any]:
        """Return sums with kinetic, potential and elastic energy of the body, whose need is known."""
        p, body = self.in_shapes(self.u), self.body
        kinetic, potential = f.energies(motion, body.mass, body.first, self.sums, gravity, kinetic, potential)
        for i, block in enumerate(self.blocks):
            for k, other in enumerate(self.blocks[: i + 1]):
                mass = columns(body.mass_of_shapes[block.at], other.at)
                if not nothing(mass):
                    kinetic = f.energy_of_shapes(int(i == k), mass, p[block.at], p[other.at], kinetic)
            elastic = f.elastic_energy(body.stiffness[block.at], self.q[block.at], elastic)
        for station, section in zip(self.stations, self.sections, strict=True):
            elastic = s.bending_energy(station.stiffness, section, elastic)
        return [kinetic, potential, elastic]


def split(count: int) -> list[slice]:
    """Return blocks of modes or shapes."""
    parts = 1 if count <= FEW else -(-count // SIZE)
    return list(starmap(slice, pairwise(count * k // parts for k in range(parts + 1))))


def columns(rows: Sequence[Any], at: slice) -> list[Any]:
    """Return some columns of rows."""
    return [row[at] for row in rows]


def curves(second: Sequence[c.Rows], *vectors: t.Numbers) -> list[list[Vector]]:
    """Return G times vectors, a vector per mode."""
    n = len(vectors[0])
    if len(split(n)) == 1 or not second:
        return [f.curved(second, values) for values in vectors]
    rows, places = np.divmod(np.arange(n * n), n)
    axes = [products(form[0][0], 1, [rows, places, np.arange(n * n)], vectors, n) for form in second]
    return [f.by_mode(one) for one in zip(*axes, strict=True)]


def nothing(tree: Any) -> bool:
    """Return True where all numbers are known to be zero."""
    return all(isinstance(one, float) and one == 0.0 for one in leaves(tree))


def _of(block: Block, beyond: Sequence[t.Beyond]) -> list[t.Beyond]:
    """Return what a body carries, with the columns of a block's shapes."""
    return [(rest, given[block.at]) for rest, given in beyond]
