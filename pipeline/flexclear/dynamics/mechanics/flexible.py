r"""Modally reduced bodies in the floating frame of reference, without neglected coupling terms.

A point is at :math:`r = X + S q + \tfrac12 q^T G q` in the body frame B. The quadratic part is the motion of sections
that turn, and in solids that of the stresses of a spin; it counts where it multiplies rigid motion, as
:math:`L_{kl} = \int\rho X_k G_l`. All terms follow from two families of vectors that are linear in the state,

.. math:: P_{kl} = \int\rho\, r_k \frac{\partial r_l}{\partial q} = E_{kl} + (F_{kl} + L_{kl}) q, \qquad
          V_{kl} = \int\rho\, \dot r_k S_l = F_{kl}\dot q .

They come from a Lagrangian, so power and energy agree to rounding. Where loads stiffen the body, the quadratic part
also moves its centre and its frames. A frame S turns by the rotation vector of its modes, fully as exp(theta).

The modes are eliminated before the coordinates of the body's joint, in the shapes of the interface basis,
:math:`q = T p`: held ones, which move no frame, come first. With the inertia I of the body, P of the shapes' momenta
and their mass m = LL^T, K = P L^-T, and I becomes I - K K^T. A shape that moves the joint's frame in the body moves the
body, and all that it carries, by a twist. All is about the origin of B, in axes of the world W where not said.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5; Wang & Wang (2019), eqs. (2), (7)-(15). Stiffening: Kane, Ryan
& Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151; Wallrapp & Schwertassek (1991), International Journal
for Numerical Methods in Engineering 32, 1833-1850. Held shapes: Craig & Bampton (1968), AIAA Journal 6, 1313-1319.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.joints.rotation_vector import rotation, series
from flexclear.dynamics.mechanics.closures import Rows, Wrenches
from flexclear.dynamics.mechanics.trees import (
    Columns,
    Numbers,
    Site,
    Step,
    carrying,
)
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.vectors import (
    ZERO,
    Inertia,
    Matrix,
    Motion,
    Symmetric,
    Twist,
    Vector,
    Wrench,
    cross,
    dot,
    skew,
)

Places = Sequence[tuple[int, ...]]
Vectors = Sequence[Vector]


class Shapes(NamedTuple):
    """Displacement S q + q^T G q / 2. linear: a row of S per axis.  second: rows of G per axis; none where it is 0."""

    linear: Rows
    second: Sequence[Rows]


class Port(NamedTuple):
    """A frame S on a flexible body, undeformed, and its displacement and rotation vector by moving shapes."""

    p_BS: Vector
    R_BS: Matrix
    moves: Shapes
    turns: Shapes


class Modal(NamedTuple):
    """A flexible body of n modes: its invariants.

    first, second: int rho X, int rho X X^T.  untilted: inertia of sections that only twist.  moves: first moment, int
    rho S.  E: nine rows.  stiffness, damping: diagonal.  moments: F + L and F, where they are not zero.  T: entries of
    the basis that are not zero.  moved: int rho S in that basis.  mass: there, rows up to the diagonal.
    """

    mass: Any
    first: Vector
    second: Matrix
    untilted: Symmetric
    moves: Shapes
    E: Rows
    stiffness: Numbers
    damping: Numbers
    moments: Sequence[tuple[Any, Any]]
    T: Numbers
    moved: Rows
    mass_of_shapes: Rows


class Need(NamedTuple):
    """What a body needs alone: inertia I and wrench F of its known motion; the same of its shapes: per unit of their
    accelerations wrenches P and forces m (rows up to the diagonal), and forces of the known motion.

    sums: over its modes.
    """

    I: Inertia
    F: Wrench
    P: Wrenches
    m: Any
    forces: Numbers
    sums: Any = ()


class Known(NamedTuple):
    """Known motion of a body, in its axes."""

    R_WB: Matrix
    omega: Vector
    alpha: Vector
    a: Vector


class Share(NamedTuple):
    """Of some modes: E, nine rows, what the moments add to these by the coordinates (P = E + bent) and by the rates
    (bending), and V."""

    E: Rows
    bent: Rows
    bending: Rows
    V: Rows


# Displacements --------------------------------------------------------------------------------------------------------
class Displacement(NamedTuple):
    """A displacement by modes, its rate, and its second rate without modal accelerations."""

    by: Vector = ZERO
    rate: Vector = ZERO
    bias: Vector = ZERO


class Sums(NamedTuple):
    """Sums over modes: displacement of the first moment; int rho r r^T, of which only the symmetric part counts;
    D = int rho r r'^T; and int rho r (q'^T G q')^T."""

    moved: Displacement
    Q: Numbers
    D: Matrix
    drift: Matrix


@routine
def displace_modes(
    before: Displacement, linear: Rows, bent: Vectors, bending: Vectors, q: Numbers, u: Numbers
) -> tuple[Displacement, list[Vector]]:
    """Add the displacement by some modes, and return its derivatives by them; bent, bending: their G q and G u."""
    both = list(zip(by_mode(linear), bent, strict=True))
    slopes, halfway = ([s + share * g for s, g in both] for share in (1.0, 0.5))
    sums = (halfway, q, before.by), (slopes, u, before.rate), (bending, u, before.bias)
    return Displacement(*(weighted_sum(*one) for one in sums)), slopes


def displacement(shapes: Shapes, q: Numbers, u: Numbers) -> tuple[Displacement, list[Vector]]:
    """Return a displacement at modal coordinates and rates, and its derivatives by modes."""
    return displace_modes(Displacement(), shapes.linear, *(curved(shapes.second, by) for by in (q, u)), q, u)


@routine
def curved(second: Sequence[Rows], q: Numbers) -> list[Vector]:
    """Return G q, a vector per mode."""
    return by_mode([[scalar(row, q) for row in form] for form in second]) if second else [ZERO] * len(q)


def by_mode(rows: Iterable[Numbers]) -> list[Vector]:
    """Return the columns of three rows."""
    return [Vector(column) for column in zip(*rows, strict=True)]


def weighted_sum(vectors: Iterable[Any], factors: Iterable[Any], start: Any = ZERO) -> Any:
    """Return the sum of vectors, each times its factor."""
    return sum((factor * vector for vector, factor in zip(vectors, factors, strict=True)), start)


def scalar(a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Return the sum of products."""
    return weighted_sum(a, b, 0.0)


# Interface basis ------------------------------------------------------------------------------------------------------
@routine
def moving(basis: Places, T: Numbers, held: int, q: Numbers) -> list[Any]:
    """Return the coordinates, or rates, of the moving shapes."""
    moved = [(mode, shape, t) for (mode, shape), t in zip(basis, T, strict=True) if shape >= held]
    p = [0.0] * (len(q) - held)
    for mode, shape, t in moved:
        p[shape - held] = p[shape - held] + t * q[mode]
    return p


@routine
def in_shapes(basis: Places, T: Numbers, values: Sequence[Any], nothing: Any = 0.0) -> list[Any]:
    """Return T^T values: forces on shapes from those on modes."""
    out = [nothing] * len(values)
    for (mode, shape), t in zip(basis, T, strict=True):
        out[shape] = out[shape] + t * values[mode]
    return out


@routine
def in_modes(basis: Places, T: Numbers, values: Sequence[Any]) -> list[Any]:
    """Return T values: rates of modes from those of shapes."""
    return in_shapes([(shape, mode) for mode, shape in basis], T, values)


# Frames ---------------------------------------------------------------------------------------------------------------
@routine
def deformed(port: Port, moved: Displacement, turned: Displacement) -> tuple[Site, Matrix]:
    """Return the site of a port on the deformed body, and T, which maps rates of its rotation vector to turning."""
    R, T, bias = rotation(turned.by, turned.rate, series(dot(turned.by, turned.by)))
    velocity, acceleration = Twist(T @ turned.rate, moved.rate), Twist(bias + T @ turned.bias, moved.bias)
    return Site(port.p_BS + moved.by, R @ port.R_BS, velocity, acceleration), T


@routine
def columns_at(motion: Motion, twists: Columns, site: Site, T: Matrix, moves: Vectors, turns: Vectors) -> list[Twist]:
    """Return the motion of a port about the origin of its body per rate of some shapes.

    twists: of the body frame per rate of each shape.  moves, turns: derivatives of the port's displacement and rotation
    vector by those shapes that move it, which are the last ones.
    """
    R, arm = motion.R_WB, motion.R_WB @ site.p_BS
    columns = [Twist(T @ psi, phi).seen(R).at(-arm) for phi, psi in zip(moves, turns, strict=True)]
    held = len(twists) - len(columns)
    return [*twists[:held], *(twist + column for twist, column in zip(twists[held:], columns, strict=True))]


@routine
def at_port(motion: Motion, twists: Columns, port: Port, p: Numbers, rates: Numbers) -> tuple[Site, Columns]:
    """Return the site of a port on the deformed body, and its motion per rate of each shape (`columns_at`).

    p, rates: of moving shapes.  Source: Wang & Wang (2019), eqs. (2), (7), (8).
    """
    (moved, moves), (turned, turns) = (displacement(shapes, p, rates) for shapes in (port.moves, port.turns))
    site, T = deformed(port, moved, turned)
    return site, columns_at(motion, twists, site, T, moves, turns)


@routine
def place_body(joint: Motion, step: Step, site: Site) -> tuple[Motion, Step]:
    """Return the motion of a body from that of its joint's frame, which is a site on it, and the step to the body."""
    body = carrying(joint, site)
    arm = body.R_WB @ site.p_BS
    return body, Step([s.at(-arm) for s in step.S], step.p_PB - arm)


@routine
def opposite(twists: Columns) -> list[Twist]:
    """Return the opposite of twists: of a body frame, by the shapes that move the frame of its joint in the body."""
    return [twist * -1.0 for twist in twists]


@routine
def body_of(joint: Motion, step: Step, port: Port, p: Numbers, rates: Numbers, still: Columns) -> Any:
    """Return the motion of a body from that of its joint's frame, which shapes may move in the body; the step to the
    body; and the twist of the body per rate of each shape. still: per shape a twist that is zero."""
    (moved, moves), (turned, turns) = (displacement(shapes, p, rates) for shapes in (port.moves, port.turns))
    site, T = deformed(port, moved, turned)
    body, step = place_body(joint, step, site)
    return body, step, opposite(columns_at(body, still, site, T, moves, turns))


# Inertia --------------------------------------------------------------------------------------------------------------
@routine
def need(
    places: Places, basis: Places, motion: Motion, twists: Columns, body: Modal, q: Numbers, u: Numbers, more: Numbers
) -> Need:
    """Return what a body needs, at modal coordinates q and rates u.

    places: of the moments: row 3k + l, mode of q, mode.  basis: mode and shape of the entries of T.  more: further
    forces that the modes need, of the elastic energy.
    """
    bent, bending, V = ([[0.0] * len(q) for _ in range(9)] for _ in range(3))
    for (row, i, j), (position, rate) in zip(places, body.moments, strict=True):
        bent[row][j] = bent[row][j] + position * q[i]
        bending[row][j] = bending[row][j] + position * u[i]
        V[row][j] = V[row][j] + rate * u[i]
    share, curves = Share(body.E, bent, bending, V), [curved(body.moves.second, by) for by in (q, u)]
    sums, slopes = add_modes(nothing(body.second), share, body.moves.linear, *curves, q, u)
    known, I, F = whole(motion, body.mass, body.first, body.untilted, sums)
    forces, spins = on_modes(known, share, slopes, body.stiffness, body.damping, q, u, more)
    forces, spins = in_shapes(basis, body.T, forces), in_shapes(basis, body.T, spins, ZERO)
    alone, P, forces = momenta(motion.R_WB, I, F, spins, body.moved, curves[0], twists, forces)
    return Need(I, F, P, mass_block(body.mass_of_shapes, alone, P, twists, twists), forces, sums)


def nothing(second: Numbers) -> Sums:
    """Return the sums over no modes; second: int rho X X^T."""
    return Sums(Displacement(), second, *[Matrix([0.0] * 9)] * 2)


@routine
def add_modes(
    before: Sums, share: Share, linear: Rows, bent: Vectors, bending: Vectors, q: Numbers, u: Numbers
) -> tuple[Sums, list[Vector]]:
    """Add the parts of some modes to sums, and return the derivatives of the first moment by these modes.

    The arguments are those of `displace_modes`, of the first moment.
    """
    (moved, slopes), (P, E) = displace_modes(before.moved, linear, bent, bending, q, u), (momenta_of(share), share.E)
    Q = [before.Q[r] + scalar(E[3 * (r % 3) + r // 3], q) + scalar(P[r], q) for r in range(9)]
    both = (before.D, P), (before.drift, share.bending)
    D, drift = (Matrix([one + scalar(row, u) for one, row in zip(old, rows, strict=True)]) for old, rows in both)
    return Sums(moved, Q, D, drift), slopes


def momenta_of(share: Share) -> list[list[Any]]:
    """Return P, nine rows."""
    return [[e + more for e, more in zip(*rows, strict=True)] for rows in zip(share.E, share.bent, strict=True)]


@routine
def whole(motion: Motion, mass: Any, first: Vector, untilted: Symmetric, sums: Sums) -> tuple[Known, Inertia, Wrench]:
    """Return the motion of a body in its axes, its inertia, and the wrench that the motion needs.

    Source: Wang & Wang (2019), eqs. (9), (14), (15).
    """
    R, D, J, moved = motion.R_WB, sums.D, tensor(sums.Q), sums.moved
    omega, alpha, a = (R.T @ v for v in (motion.omega, motion.alpha, motion.a))
    c, v = first + moved.by, moved.rate
    force = mass * a + cross(alpha, c) + cross(omega, cross(omega, c) + 2.0 * v) + moved.bias
    moment = cross(c, a) + J @ alpha + cross(omega, J @ omega - untilted @ omega) + axial(sums.drift)
    moment = moment + 2.0 * ((D[0] + D[4] + D[8]) * omega - D.T @ omega)
    I = Inertia((R @ J @ R.T).symmetric, skew(R @ c), Symmetric([mass] * 3 + [0.0] * 3))
    return Known(R, omega, alpha, a), I, Wrench(R @ moment, R @ force)


@routine
def on_modes(
    known: Known, share: Share, slopes: Vectors, stiffness: Numbers, damping: Numbers, q: Numbers, u: Numbers,
    more: Numbers,
) -> tuple[list[Any], list[Vector]]:  # fmt: skip
    """Return the forces that some modes need in the known motion, and int rho r x S of each.

    Source: Wang & Wang (2019), eqs. (9), (14), (15).
    """
    P, turning = momenta_of(share), skew(known.omega) @ skew(known.omega)
    spins = [axial(column) for column in zip(*P, strict=True)]
    forces = [
        dot(slopes[j], known.a) + dot(spins[j], known.alpha) + scalar(turning, [row[j] for row in P])
        + 2.0 * dot(axial([row[j] for row in share.V]), known.omega) + stiffness[j] * q[j] + damping[j] * u[j] + more[j]
        for j in range(len(q))
    ]  # fmt: skip
    return forces, spins


@routine
def momenta(
    R: Matrix, I: Inertia, F: Wrench, spins: Vectors, moved: Rows, bent: Vectors, twists: Columns, forces: Numbers
) -> tuple[Wrenches, Wrenches, list[Any]]:
    """Return the momenta per rate of some shapes, alone and with the body that they move, and the forces on them.

    forces: without those of F.
    """
    slopes = [s + g for s, g in zip(by_mode(moved), bent, strict=True)]
    alone = [Wrench(R @ spin, R @ slope) for spin, slope in zip(spins, slopes, strict=True)]
    both = [momentum + I.of(twist) for momentum, twist in zip(alone, twists, strict=True)]
    return alone, both, [one + F.on(twist) for one, twist in zip(forces, twists, strict=True)]


@routine
def mass_block(mass: Rows, alone: Wrenches, momenta: Wrenches, twists: Columns, others: Columns) -> list[list[Any]]:
    """Return a block of the mass matrix of shapes; of a diagonal block, as of `mass`, the rows up to the diagonal.

    alone, twists: of the shapes of its rows.  momenta, others: of its columns, with the body that these move.
    """
    made = []
    for row, momentum, twist in zip(mass, alone, twists, strict=False):
        columns = zip(row, momenta, others, strict=False)
        made.append([one + momentum.on(other) + moving.on(twist) for one, moving, other in columns])
    return made


def tensor(Q: Numbers) -> Symmetric:
    """Return the inertia tensor tr(Q) 1 - Q of a second moment, of which only the symmetric part counts."""
    across = (-0.5 * (Q[1] + Q[3]), -0.5 * (Q[2] + Q[6]), -0.5 * (Q[5] + Q[7]))
    return Symmetric([Q[4] + Q[8], Q[0] + Q[8], Q[0] + Q[4], *across])


def axial(M: Numbers) -> Vector:
    """Return int rho r x s from the nine int rho r_k s_l."""
    return Vector([M[5] - M[7], M[6] - M[2], M[1] - M[3]])


@routine
def energies(
    motion: Motion, mass: Any, first: Vector, sums: Sums, gravity: Vector, kinetic: Any, potential: Any
) -> tuple[Any, Any]:
    """Return sums with the kinetic energy of a body, without that of its shapes' masses, and its potential energy of
    gravity."""
    R, J, moved = motion.R_WB, tensor(sums.Q), sums.moved
    omega, v, c = R.T @ motion.omega, R.T @ motion.v, first + moved.by
    speeding = cross(omega, c) + moved.rate
    moving = 0.5 * mass * dot(v, v) + dot(v, speeding) + 0.5 * dot(omega, J @ omega) + dot(omega, axial(sums.D))
    return kinetic + moving, potential - dot(gravity, mass * motion.p_WB + R @ c)


@routine
def energy_of_shapes(diagonal: int, mass: Rows, rates: Numbers, others: Numbers, kinetic: Any) -> Any:
    """Return the sum with the kinetic energy of a block of the mass of shapes, of a `diagonal` one the lower part."""
    for i, row in enumerate(mass):
        halves = [0.5 if diagonal and i == j else 1.0 for j in range(len(row))]
        kinetic = kinetic + rates[i] * sum((h * m * p for h, m, p in zip(halves, row, others, strict=False)), 0.0)
    return kinetic


@routine
def elastic_energy(stiffness: Numbers, q: Numbers, elastic: Any) -> Any:
    """Return the sum with the energy of the modal stiffness."""
    return elastic + 0.5 * scalar(stiffness, [one * one for one in q])


@routine
def damping_power(damping: Numbers, u: Numbers) -> Any:
    """Return the power that is lost to damping [W]."""
    return scalar(damping, [rate * rate for rate in u])
