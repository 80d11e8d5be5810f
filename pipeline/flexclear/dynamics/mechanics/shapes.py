"""Elimination of the shapes of a flexible body, or of a block of them, from what it resists and from rows of closures.

Shapes of a block are eliminated one after the other; of those of later blocks, earlier ones take their part.
The equations are those of `flexible`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics.closures import Rows, Wrenches, backward, forward
from flexclear.dynamics.mechanics.flexible import Places, in_modes, scalar
from flexclear.dynamics.mechanics.trees import MASSLESS, Beyond, Columns, Numbers, Resistance
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import select
from flexclear.dynamics.vectors import WITHOUT, ZERO, Inertia, Twist, Wrench, total


class Gains(NamedTuple):
    """Of the shapes' rows of the factor of the mass matrix: K, and the block of these shapes themselves."""

    L: Rows
    K: Wrenches


class Taken(NamedTuple):
    """What earlier shapes take from the momenta, masses and forces of some shapes, once these are eliminated."""

    P: Wrenches
    m: Rows
    forces: Numbers


@routine
def stiffened(mass: Rows, stiffness: Rows, share: float) -> list[Any]:
    """Return the mass of shapes with a share [s^2] of their stiffness, rows up to the diagonal."""
    return [[a + share * b for a, b in zip(*rows, strict=True)] for rows in zip(mass, stiffness, strict=True)]


@routine
def held(first: int, F: Wrench, forces: Numbers, beyond: Sequence[Beyond]) -> tuple[list[Any], Resistance]:
    """Return the forces on shapes of a body that hold them, and what its joint must resist then: a wrench.

    beyond: its columns are of these shapes; its wrenches are added to F for the `first` ones.
    """
    forces = list(forces)
    for (_, wrench), columns in beyond:
        F = F + wrench if first else F
        for i, column in enumerate(columns):
            forces[i] = forces[i] + wrench.on(column)
    return forces, Resistance(WITHOUT, F)


@routine
def eliminate(
    first: int, rest: Resistance, P: Wrenches, m: Rows, needed: Numbers, taken: Taken, beyond: Sequence[Beyond],
    sound: Any,
) -> tuple[Gains, list[Any], Resistance, Any]:  # fmt: skip
    """Eliminate shapes of a body from what it resists with all that it carries.

    Returns their gains; L^-1 of the forces on them; with what the body resists while they move freely; and `sound`,
    which becomes 0 when a shape moves no mass.  beyond: as of `held`.
    """
    (I, F), P, m, needed = rest, list(P), [list(row) for row in m], list(needed)
    for (inertia, wrench), columns in beyond:
        if first:
            I, F = I + inertia, F + wrench
        for i, column in enumerate(columns):
            momentum = inertia.of(column)
            P[i], needed[i] = P[i] + momentum, needed[i] + wrench.on(column)
            m[i] = [one + momentum.on(other) for one, other in zip(m[i], columns, strict=False)]
    diagonal = [row[i] for i, row in enumerate(m)]
    m = [[one - less for one, less in zip(*rows, strict=True)] for rows in zip(m, taken.m, strict=True)]
    _, L, least = c.cholesky(m, diagonal, diagonal, 1.0)
    forces = forward(L, [-one - less for one, less in zip(needed, taken.forces, strict=True)])
    K = list[Wrench]()
    for row, momentum, less, force in zip(L, P, taken.P, forces, strict=True):
        momentum = momentum - less
        for factor, k in zip(row, K, strict=False):
            momentum = momentum - k * factor
        K.append(momentum * row[len(K)])
        I, F = I.without(K[-1], 1.0), F + K[-1] * force
    return Gains(L, K), forces, Resistance(I, F), select(least > MASSLESS, sound, 0.0)


@routine
def with_beyond(m: Rows, beyond: Sequence[tuple[Inertia, Columns, Columns]]) -> Rows:
    """Return a block of the mass matrix of shapes below the diagonal with that of what the body carries.

    beyond: inertias, and the motion of their frames per rate of the shapes of rows and columns.
    """
    for inertia, columns, others in beyond:
        momenta = [inertia.of(column) for column in columns]
        both = zip(m, momenta, strict=True)
        m = [[one + momentum.on(other) for one, other in zip(row, others, strict=True)] for row, momentum in both]
    return m


def none_taken(count: int) -> Taken:
    """Return what no shapes take from `count` others."""
    return Taken([Wrench(ZERO, ZERO)] * count, [[0.0] * (i + 1) for i in range(count)], [0.0] * count)


@routine
def take(taken: Taken, below: Rows, K: Wrenches, forces: Numbers) -> Taken:
    """Add what other shapes take; below: of the factor, rows of the shapes from which they take."""
    P = [
        sum((k * factor for k, factor in zip(K, row, strict=True)), one)
        for one, row in zip(taken.P, below, strict=True)
    ]
    m = [
        [one + scalar(row, other) for one, other in zip(rows, below, strict=False)]
        for rows, row in zip(taken.m, below, strict=True)
    ]
    return Taken(P, m, [one + scalar(row, forces) for one, row in zip(taken.forces, below, strict=True)])


@routine
def less(on_shapes: Rows, below: Rows, V: Rows) -> list[list[Any]]:
    """Return forces on shapes, per row of a closure, less what others take from them."""
    columns = zip(on_shapes, zip(*V, strict=True), strict=True)
    return [[f - scalar(row, v) for f, row in zip(forces, below, strict=True)] for forces, v in columns]


@routine
def spread(
    gains: Gains,
    forces: Numbers,
    on_shapes: Rows,
    loads: Sequence[tuple[Wrenches, Columns]],
    wrenches: Wrenches,
    *rows: Any,
) -> Any:
    """Eliminate the shapes of a body from the rows of a closure, as `closures.spread` does for the coordinates of its
    joint.

    on_shapes: forces on the shapes, per row.  loads: wrenches at ports, and the motion of these per rate of each shape;
    wrenches: all together.
    """
    for given, columns in loads:
        on_shapes = [
            [f + wrench.on(column) for f, column in zip(row, columns, strict=True)]
            for row, wrench in zip(on_shapes, given, strict=True)
        ]
    V = list(zip(*(forward(gains.L, row) for row in on_shapes), strict=True))
    for k, row in zip(gains.K, V, strict=True):
        wrenches = [wrench - k * v for wrench, v in zip(wrenches, row, strict=True)]
    return V, *c.less(V, forces, *rows), wrenches


@routine
def accelerate(basis: Places, T: Numbers, u: Numbers, gains: Gains, forces: Numbers, a: Twist) -> Any:
    """Return the rates of the modes' coordinates and of their rates, and the accelerations of the shapes, by L^-T.

    a: acceleration of the body as if rigid, without the known part.
    """
    shapes = accelerations(gains, forces, a)
    return [*u, *in_modes(basis, T, shapes)], shapes


@routine
def accelerations(gains: Gains, forces: Numbers, a: Twist) -> list[Any]:
    """Return the accelerations of shapes; the arguments are those of `accelerate`."""
    return backward(gains.L, [force - k.on(a) for force, k in zip(forces, gains.K, strict=True)])


@routine
def follow(a: Twist, columns: Columns, accelerations: Numbers) -> Twist:
    """Return the acceleration at a port, from that of the body as if rigid, with the part of its shapes."""
    return a + total(columns, accelerations)
