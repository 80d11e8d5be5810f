r"""Friction of ideal joints: what a bearing does per normal force, and the normal forces of all bearings.

The load N of a bearing causes friction, which changes the loads. At a given state the reaction of each joint is affine
in the loads of all bearings,

.. math:: R_j = R_{j0} + \sum_k N_k R_{jk}, \qquad N_e = g_e(R_{j(e)}) .

Where the determinant of their slopes is positive, the solution is that which grows out of the one without friction;
where it has become zero on the way, friction jams the mechanism. With the axis n, the force F and the moment M about
the second frame's origin that the joint transmits, and its length L,

.. math:: N = |F_\perp/2 - n\times M/L| + |F_\perp/2 + n\times M/L| + a|n\cdot F| + b|n\cdot M| + N_0

for a pin or slider with two ends, a collar (a), pads that hold moments about the axis (b), and a preload; for a ball
N = |F| + N_0.  Source: Haug, Wu & Yang (1986), Mechanism and Machine Theory 21, 401-425; Leine, Brogliato & Nijmeijer
(2002), European Journal of Mechanics A/Solids 21, 869-896.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

from flexclear.dynamics.contact.surfaces.separation import across
from flexclear.dynamics.effects.declared import BALL, PIN, SLIDER
from flexclear.dynamics.joints.conditions import twist_between
from flexclear.dynamics.mechanics.contacts import rub
from flexclear.dynamics.mechanics.trees import End, Numbers, Resistance, on_both, site_motion
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import larger, select, sqrt
from flexclear.dynamics.vectors import ZERO, Matrix, Motion, Twist, Vector, Wrench, cross, dot

#: most Newton iterations; change of the loads, as a fraction of the largest, at which they end, and below which they
#: end when it stops shrinking; strides in which friction is increased where they fail; pivots that count as zero
ITERATIONS, CONVERGED, ROUNDED, STRIDES, SINGULAR = 30.0, 1e-13, 1e-9, 32.0, 1e-12
#: outcome of an iteration
GOES_ON, FOUND, FAILED = 0.0, 1.0, 2.0


class Pressure(NamedTuple):
    """Normal force of a bearing, its slopes by the moment and the force of its joint, and its parts with kinks."""

    size: Any
    by_M: Vector
    by_F: Vector
    bends: Numbers


@routine
def friction_of(bearing: Any, law: str, numbers: Any, bristle: Numbers, a: End, b: End) -> Any:
    """Return sliding velocity and bristles' rate of a bearing; wrenches on both bodies, and on the second one at its
    frame, per normal force; lost power per normal force [m/s]; axes of the frame that carries the bearing.

    bearing: see `effects.joint_friction`.
    """
    F, G = site_motion(*a), site_motion(*b)
    R, (turning, sliding) = (G if bearing.side else F).R_WB, twist_between(F, G)
    n = R.column(bearing.axis)
    if bearing.kind == BALL:
        slip = F.R_WB.T @ (numbers.radius * turning)
    else:
        forth = dot(n, sliding) if bearing.kind != PIN else 0.0
        round_ = numbers.radius * dot(n, turning) if bearing.kind != SLIDER else 0.0
        slip = Vector([forth, round_, 0.0])
    force, _, _, rate = rub(law, numbers.law, bristle, slip, 1.0)
    if bearing.kind == BALL:
        unit = Wrench(numbers.radius * (F.R_WB @ force), ZERO)
    else:
        unit = Wrench((numbers.radius * force[1]) * n, force[0] * n)
    return (slip, rate if bristle else ()), on_both((a, b), G, unit), unit, -dot(force, slip), R


@routine
def bearing_record(slip: Vector, loss: Any, unit: Wrench, b: End) -> tuple[Any]:
    """Return what the record has of a bearing besides its load (`memory`): all but the sliding speed per normal force.

    slip, loss, unit: see `friction_of`.
    """
    return ((sqrt(dot(slip, slip)), loss, unit.about(site_motion(*b).p_WB)),)


@routine
def reaction_in_tree(
    second: int, rest: Resistance, a: Twist, with_known: int, passing: Sequence[Any], motion: Motion, b: End
) -> Wrench:
    """Return the wrench of a joint on its second body, about that frame's origin.

    second: 1 when the joint carries that body, else -1.  rest, a, motion: of the body that it carries.  with_known: 1
    with the wrench of the known motion.  passing: wrenches on that body and all beyond, and their sizes.
    """
    R = rest.I.of(a)
    if with_known:
        R = R + rest.F
    for wrenches, sizes in passing:
        for wrench, size in zip(wrenches, sizes, strict=True):
            R = R - wrench * size
    return R.about(motion.p_WB - site_motion(*b).p_WB) * float(second)


@routine
def reaction_in_loop(wrenches: Sequence[Wrench], multipliers: Numbers, more: Sequence[Wrench], b: End) -> Wrench:
    """Return the same of a joint that closes a loop; wrenches: of its rows on the second body.  more: its friction."""
    R = Wrench(ZERO, ZERO)
    for wrench, size in zip(wrenches, multipliers, strict=True):
        R = R + wrench * size
    R = R.about((b[0].R_WB @ b[1].p_BS) * -1.0)
    for wrench in more:
        R = R + wrench
    return R


def direction(v: Vector) -> tuple[Any, Vector]:
    """Return the magnitude of a vector and its direction, zero where it is zero."""
    size = sqrt(dot(v, v))
    return size, select(size > 0.0, 1.0 / size, 0.0) * v


def pressure(bearing: Any, numbers: Any, R_WB: Matrix, reaction: Wrench) -> Pressure:
    """Return the normal force of a bearing for the wrench of its joint."""
    M, F = reaction
    if bearing.kind == BALL:
        size, along_F = direction(F)
        return Pressure(size + numbers.preload, ZERO, along_F, [0.0] * 6)
    n, one, other = (R_WB.column((bearing.axis + k) % 3) for k in range(3))
    along, about = dot(n, F), dot(n, M)
    half, tilt = 0.5 * across(n, F), numbers.lever * cross(n, M)
    near, far = half - tilt, half + tilt
    (N_near, at_near), (N_far, at_far) = direction(near), direction(far)
    size = N_near + N_far + numbers.axial * abs(along) + numbers.torsion * abs(about) + numbers.preload
    by_M = numbers.lever * cross(at_far - at_near, n) + select(about >= 0.0, numbers.torsion, -numbers.torsion) * n
    by_F = 0.5 * (at_near + at_far) + select(along >= 0.0, numbers.axial, -numbers.axial) * n
    ends = [dot(axis, end) for end in (near, far) for axis in (one, other)]
    return Pressure(size, by_M, by_F, [numbers.axial * along, numbers.torsion * about, *ends])


@routine
def normal_force(
    bearing: Any, numbers: Any, R_WB: Matrix, smooth: Wrench, parts: Sequence[Wrench], loads: Numbers, share: Any
) -> Any:
    """Return the normal force of a bearing, its parts with kinks, and minus its slopes by the loads of all bearings.

    smooth: reaction of its joint without friction.  parts: per normal force of each bearing.  share: of friction.
    """
    reaction = smooth
    for part, load in zip(parts, loads, strict=True):
        reaction = reaction + part * (share * load)
    now = pressure(bearing, numbers, R_WB, reaction)
    slopes = [-(share * (dot(now.by_M, part.moment) + dot(now.by_F, part.force))) for part in parts]
    return now.size, now.bends, slopes


@routine
def excess(load: Any, size: Any) -> Any:
    """Return by how much a load exceeds the normal force that follows from it."""
    return load - size


@routine
def newton_step(
    corrections: Numbers,
    sign: Any,
    without: Numbers,
    loads: Numbers,
    share: Any,
    turns: Any,
    before: Any,
    strides: Any,
    _: Any,
) -> tuple[Any, Any]:
    """Return the state after an iteration of Newton's method, behind 1 where it goes on; where full friction fails,
    increase it in strides.

    sign: of the determinant of the slopes.  without: loads without friction.  The state are loads, share of friction,
    iterations with it, their last change, 1 for strides, and 1 where friction jams the bearings.
    """
    loads = [load - correction for load, correction in zip(loads, corrections, strict=True)]
    change = largest = 0.0
    for load, correction in zip(loads, corrections, strict=True):
        change, largest = larger(change, abs(correction)), larger(largest, abs(load))
    stalled = select(change <= ROUNDED * largest, select(change > 0.5 * before, FOUND, GOES_ON), GOES_ON)
    made = select(change <= CONVERGED * largest, FOUND, stalled)
    made = select(made == FOUND, select(sign > 0.0, FOUND, FAILED), select(turns < ITERATIONS - 1.0, made, FAILED))
    made = select(sign == 0.0, FAILED, select(largest < inf, made, FAILED))
    goes_on, failed = made == GOES_ON, made == FAILED
    loads = [select(failed, one, load) for one, load in zip(without, loads, strict=True)]
    jammed = select(failed, strides, 0.0)
    following = select(failed, 0.0, share) + 1.0 / STRIDES
    more = select(failed, 1.0 - strides, select(following <= 1.0, 1.0, 0.0))
    return select(goes_on, 1.0, more), (
        loads,
        select(goes_on, share, following),
        select(goes_on, turns + 1.0, 0.0),
        select(goes_on, change, inf),
        select(failed, 1.0, strides),
        jammed,
    )


@routine
def lost_power(load: Any, loss: Any) -> Any:
    """Return the power that friction of a bearing takes [W], from that per normal force."""
    return load * loss


@routine
def exchange_rows(above: Numbers, below: Numbers, sign: Any) -> tuple[Numbers, Numbers, Any]:
    """Return two rows with the larger pivot in the first one, and the sign of the determinant."""
    exchange, both = abs(below[0]) > abs(above[0]), list(zip(above, below, strict=True))
    return (
        [select(exchange, other, one) for one, other in both],
        [select(exchange, one, other) for one, other in both],
        select(exchange, -sign, sign),
    )


@routine
def determinant_sign(pivot: Any, sign: Any) -> Any:
    """Return the sign of the determinant with a pivot, 0 where that counts as zero."""
    return select(abs(pivot) > SINGULAR, select(pivot > 0.0, sign, -sign), 0.0)


@routine
def remove_unknown(above: Numbers, below: Numbers) -> Numbers:
    """Return what remains of a row without its first unknown."""
    factor = below[0] / above[0]
    return [one - factor * other for one, other in zip(below[1:], above[1:], strict=True)]


@routine
def first_unknown(row: Numbers, known: Numbers) -> Any:
    """Return the first unknown of a row from the others."""
    rest = row[-1]
    for factor, one in zip(row[1:-1], known, strict=True):
        rest = rest - factor * one
    return rest / row[0]


def solution(rows: Sequence[Numbers]) -> tuple[list[Any], Any]:
    """Return x of A x = b by elimination with the largest pivots, and the sign of det A, 0 where it counts as zero.

    rows: of A, each followed by its entry of b.
    """
    waiting, above, sign = list(rows), list[Numbers](), 1.0
    while waiting:
        first = waiting.pop(0)
        for i, row in enumerate(waiting):
            first, waiting[i], sign = exchange_rows(first, row, sign)
        sign = determinant_sign(first[0], sign)
        waiting = [remove_unknown(first, row) for row in waiting]
        above.append(first)
    x: list[Any] = []
    for row in reversed(above):
        x.insert(0, first_unknown(row, x))
    return x, sign
