r"""Loop closures: their rows, and the multipliers, by a block for each pair of closures.

A row is a wrench; its Jacobian against a coordinate is the force of that wrench along it. With M = L L^T the
multipliers solve

.. math:: (J M^{-1} J^T)\lambda = \gamma - J M^{-1} f, \qquad M\dot v = f + J^T\lambda

by V = L^-1 J^T, which is found by passing the rows' wrenches from both sites of a closure to the ground. V is stored by
joint: per coordinate one number for each row. The matrix is factorised in blocks, lower ones by (closure, closure).
Residuals and rates of all rows are computed, also of those that follow from others and are not solved for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from flexclear.dynamics.joints.conditions import condition, growth_between, twist_between
from flexclear.dynamics.mechanics.trees import Gains, Numbers, Site, Step, site_motion
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import larger, select, smaller, sqrt
from flexclear.dynamics.vectors import ZERO, Motion, Twist, Vector, Wrench, cross, dot

#: pivots of J M^-1 J^T below this fraction of their diagonal entry indicate a singular pose
SINGULAR = 1e-13
#: divisor of the pivot of a row that moves no free coordinate, which is zero
TINIEST = 1e-300
Rows = Sequence[Numbers]
Wrenches = Sequence[Wrench]
Blocks = dict[tuple[int, int], Rows]


@routine
def closure(rows: Sequence[tuple[int, int, int]], kept: int, a: tuple[Motion, Site], b: tuple[Motion, Site]) -> Any:
    """Return residuals [m or -] of all rows, followed by their rates; then gamma of the first `kept` rows, and their
    wrenches on the bodies of a and b about the origins of these.

    a, b: body and site of the frames of the joint that closes the loop.  rows: see `row`.
    Source: Wang & Wang (2019), eqs. (30), (31), of prismatic joints and balls.
    """
    A, B = site_motion(*a), site_motion(*b)
    made = [row(A, B, *one) for one in rows]
    # a joint that an event has opened has no row
    columns = zip(*made, strict=True) if made else ([], [], [], [])
    residuals, residual_rates, gamma, wrenches = (list(column) for column in columns)
    on_a = [(wrench * -1.0).about(B.p_WB - a[0].p_WB) for wrench in wrenches[:kept]]
    on_b = [wrench.about(b[0].R_WB @ b[1].p_BS) for wrench in wrenches[:kept]]
    return [*residuals, *residual_rates], gamma[:kept], on_a, on_b


def row(a: Motion, b: Motion, kind: int, i: int, j: int) -> tuple[Any, Any, Any, Wrench]:
    """Return residual of a condition, its rate, the rate of that which the accelerations must cancel, and its wrench.

    kind, i, j: see `joints.conditions.condition`.
    """
    residual, wrench = condition(a, b, kind, i, j)
    passing, growing = twist_between(a, b), growth_between(a, b)
    gamma = -wrench.on(growing)
    if kind == 1:
        along, against = a.R_WB.column(i), b.R_WB.column(j)
        swing = cross(cross(b.omega, against), along) + cross(against, cross(a.omega, along))
        gamma = gamma - dot(passing.angular, swing)
    return residual, wrench.on(passing), gamma, wrench


@routine
def spread(
    carried_on: int, step: Step, gains: Gains, forces: Numbers, wrenches: Wrenches, gamma: Numbers, S: Rows
) -> Any:
    """Eliminate a joint's coordinates from the rows of a closure, which are wrenches on the joint's body.

    Returns V = L^-1 J^T of the coordinates, gamma - V^T forces, S + V^T V, and, if `carried_on` is 1, the wrenches that
    remain for the body that carries the joint, about the origin of that.  forces: L^-1 of those along the coordinates.
    """
    V = []
    for s, gain in zip(step.S, gains, strict=True):
        V.append([gain.root * wrench.on(s) for wrench in wrenches])
        wrenches = [wrench - gain.K * v for wrench, v in zip(wrenches, V[-1], strict=True)]
    return V, *less(V, forces, gamma, S), inwards(step, wrenches) if carried_on else []


def less(V: Rows, forces: Numbers, gamma: Numbers, S: Rows) -> tuple[Numbers, Rows]:
    """Return gamma - V^T forces, and S + V^T V, up to the diagonal."""
    columns = list(zip(*V, strict=True))
    gamma = [one - _dot(column, forces) for one, column in zip(gamma, columns, strict=True)]
    return gamma, [
        [s + _dot(a, b) for s, b in zip(row, columns, strict=False)] for row, a in zip(S, columns, strict=True)
    ]


@routine
def inwards(step: Step, wrenches: Wrenches) -> Wrenches:
    """Return wrenches on a body about the origin of the one that carries it."""
    return [wrench.about(step.p_PB) for wrench in wrenches]


@routine
def along(columns: Sequence[Sequence[Twist]], wrenches: Sequence[Wrenches]) -> Rows:
    """Return the forces along coordinates by their motions, summed over frames: per coordinate one for each row."""
    both = list(zip(columns, wrenches, strict=True))
    parts = [[[wrench.on(s) for wrench in on_it] for s in motions] for motions, on_it in both]
    return [[sum(one, 0.0) for one in zip(*rows, strict=True)] for rows in zip(*parts, strict=True)]


@routine
def closure_wrench(wrenches: Wrenches, multipliers: Rows, p_WB: Vector, friction: Sequence[Any]) -> tuple[Wrench]:
    """Return the wrench of a closure on its second body, about the origin of the world.

    wrenches: of its rows there.  multipliers: without friction, by friction.  friction: loads of its bearings, and what
    these do (`bearings.bearing_record`).
    """
    F = Wrench(ZERO, ZERO)
    for wrench, *sizes in zip(wrenches, *multipliers, strict=True):
        F = F + wrench * sum(sizes, 0.0)
    F = F.about(p_WB)
    for load, (_, _, *unit) in friction:
        F = F + Wrench(Vector(unit[:3]), Vector(unit[3:])) * load
    return (F,)


@routine
def together(one: Sequence[Any], other: Sequence[Any]) -> list[Any]:
    """Return sums of wrenches, or of numbers."""
    return [a + b for a, b in zip(one, other, strict=True)]


# Matrices: rows of numbers, V as above -------------------------------------------------------------------------------
@routine
def add_product(S: Rows, V: Rows, W: Rows) -> Rows:
    """Return S + V^T W."""
    made = zip(S, zip(*V, strict=True), strict=True)
    return [[s + _dot(v, w) for s, w in zip(row, zip(*W, strict=True), strict=True)] for row, v in made]


@routine
def with_multipliers(forces: Numbers, V: Rows, multipliers: Numbers) -> list[Any]:
    """Return forces + V multipliers."""
    return [f + _dot(v, multipliers) for f, v in zip(forces, V, strict=True)]


@routine
def opposite(right: Numbers) -> list[Any]:
    """Return -right."""
    return [-one for one in right]


@routine
def cholesky(S: Rows, diagonal: Numbers, scales: Numbers, least: Any) -> tuple[list[Any], Rows, Any]:
    """Return diagonal and reciprocal diagonal of the factor of a diagonal block; the factor; and its least pivot.

    S: lower part of the block after elimination of those before it, `diagonal` before that.  The factor L, too, is the
    lower part, with the reciprocal diagonal.  A pivot counts as share of the larger of its diagonal entry and its
    scale; the least of these and `least` is returned, 0 when a pivot is not positive.
    """
    L = [list(row) for row in S]
    for j in range(len(S)):
        pivot = S[j][j] - _dot(L[j][:j], L[j][:j])
        L[j][j] = 1.0 / sqrt(pivot)
        for i in range(j + 1, len(S)):
            L[i][j] = (S[i][j] - _dot(L[i][:j], L[j][:j])) * L[j][j]
        share = pivot / larger(larger(diagonal[j], scales[j]), TINIEST)
        least = select(share > 0.0, smaller(least, share), 0.0)  # also if it is not a number
    return [*diagonal, *(L[j][j] for j in range(len(L)))], L, least


@routine
def subtract_product(S: Rows, A: Rows, B: Rows) -> Rows:
    """Return S - A B^T, of a block of which S has the lower part (B = A) only that."""
    return [[s - _dot(a, b) for s, b in zip(row, B, strict=False)] for row, a in zip(S, A, strict=True)]


@routine
def below(S: Rows, L: Rows) -> Rows:
    """Return S L^-T of a block below the diagonal."""
    return [forward(L, row) for row in S]


@routine
def forward(L: Rows, right: Numbers) -> list[Any]:
    """Return L^-1 right."""
    x: list[Any] = []
    for row, one in zip(L, right, strict=True):
        x.append((one - _dot(row[: len(x)], x)) * row[len(x)])
    return x


@routine
def backward(L: Rows, right: Numbers) -> list[Any]:
    """Return L^-T right."""
    x = list(right)
    for i in reversed(range(len(L))):
        x[i] = (x[i] - _dot([row[i] for row in L[i + 1 :]], x[i + 1 :])) * L[i][i]
    return x


@routine
def minus(right: Numbers, A: Rows, x: Numbers) -> list[Any]:
    """Return right - A x."""
    return [one - _dot(row, x) for one, row in zip(right, A, strict=True)]


@routine
def minus_transposed(right: Numbers, A: Rows, x: Numbers) -> list[Any]:
    """Return right - A^T x."""
    return [one - _dot(column, x) for one, column in zip(right, zip(*A, strict=True), strict=True)]


def _dot(a: Iterable[Any], b: Iterable[Any]) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def solve(L: Blocks, right: Sequence[Numbers]) -> list[Numbers]:
    """Return x of L L^T x = right."""
    x, before = list(right), {i: [k for k in range(i) if (i, k) in L] for i in range(len(right))}
    for i in range(len(x)):
        for k in before[i]:
            x[i] = minus(x[i], L[i, k], x[k])
        x[i] = forward(L[i, i], x[i])
    for i in reversed(range(len(x))):
        x[i] = backward(L[i, i], x[i])
        for k in before[i]:
            x[k] = minus_transposed(x[k], L[i, k], x[i])
    return x
