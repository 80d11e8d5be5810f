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
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics.closures import Rows, Wrenches, backward, forward
from flexclear.dynamics.mechanics.trees import (
    MASSLESS,
    Beyond,
    Columns,
    Motion,
    Numbers,
    Resistance,
    Site,
    Step,
    carrying,
)
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import cos, select, sin
from flexclear.dynamics.vectors import (
    AT_REST,
    WITHOUT,
    ZERO,
    Inertia,
    Matrix,
    Symmetric,
    Twist,
    Vector,
    Wrench,
    cross,
    dot,
    skew,
    total,
)

Places = Sequence[tuple[int, ...]]


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


class Station(NamedTuple):
    """A section of a rod: rotation and curvature per mode, a row per axis; stiffness of twist and bending."""

    rotation: Rows
    curvature: Rows
    stiffness: Symmetric


class Need(NamedTuple):
    """What a body needs alone: inertia I and wrench F of its known motion; the same of its shapes: per unit of their
    accelerations wrenches P and forces m (rows up to the diagonal), and forces of the known motion."""

    I: Inertia
    F: Wrench
    P: Wrenches
    m: Rows
    forces: Numbers


class Gains(NamedTuple):
    """Of the shapes' rows of the factor of the mass matrix."""

    L: Rows
    K: Wrenches


# Displacements --------------------------------------------------------------------------------------------------------
class Displacement(NamedTuple):
    """A displacement by modes, its rate, its second rate without modal accelerations, and its derivatives by modes."""

    by: Vector
    rate: Vector
    bias: Vector
    slopes: Sequence[Vector]


def displacement(shapes: Shapes, q: Numbers, u: Numbers) -> Displacement:
    """Return a displacement at modal coordinates and rates."""
    bent, bending = (curved(shapes.second, by) for by in (q, u))
    slopes = [s + g for s, g in zip(by_mode(shapes.linear), bent, strict=True)]
    halfway = [s + 0.5 * g for s, g in zip(by_mode(shapes.linear), bent, strict=True)]
    return Displacement(weighted(halfway, q), weighted(slopes, u), weighted(bending, u), slopes)


def curved(second: Sequence[Rows], q: Numbers) -> list[Vector]:
    """Return G q, a vector per mode."""
    return by_mode([[_dot(row, q) for row in form] for form in second]) if second else [ZERO] * len(q)


def by_mode(rows: Iterable[Numbers]) -> list[Vector]:
    """Return the columns of three rows."""
    return [Vector(column) for column in zip(*rows, strict=True)]


def weighted(vectors: Iterable[Any], factors: Iterable[Any], start: Any = ZERO) -> Any:
    """Return the sum of vectors, each times its factor."""
    return sum((factor * vector for vector, factor in zip(vectors, factors, strict=True)), start)


def _dot(a: Iterable[Any], b: Iterable[Any]) -> Any:
    return weighted(a, b, 0.0)


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
def deformed(held: int, port: Port | Site, p: Numbers, rates: Numbers) -> tuple[Site, Columns]:
    """Return the site of a port on the deformed body, and its motion there per rate of each shape, in axes of B."""
    if isinstance(port, Site):  # no shape moves it
        return port, [AT_REST] * (held + len(p))
    moved, turned = (displacement(shapes, p, rates) for shapes in (port.moves, port.turns))
    R, T, bias = rotation(turned.by, turned.rate, series(dot(turned.by, turned.by)))
    velocity, acceleration = Twist(T @ turned.rate, moved.rate), Twist(bias + T @ turned.bias, moved.bias)
    columns = [Twist(T @ psi, phi) for psi, phi in zip(turned.slopes, moved.slopes, strict=True)]
    return Site(port.p_BS + moved.by, R @ port.R_BS, velocity, acceleration), [AT_REST] * held + columns


@routine
def at_port(held: int, motion: Motion, twists: Columns, port: Port, p: Numbers, rates: Numbers) -> Any:
    """Return the site of a port on the deformed body, and its motion per rate of each shape, about the origin of B.

    twists: of the body frame per rate of each shape.  p, rates: of moving shapes.
    """
    site, columns = deformed(held, port, p, rates)
    R, arm = motion.R_WB, motion.R_WB @ site.p_BS
    return site, [twist + column.seen(R).at(-arm) for twist, column in zip(twists, columns, strict=True)]


@routine
def body_of(held: int, joint: Motion, step: Step, port: Port | Site, p: Numbers, rates: Numbers) -> Any:
    """Return the motion of a body from that of its joint's frame, which shapes may move in the body; the step to the
    body; and the twist of the body per rate of each shape."""
    site, columns = deformed(held, port, p, rates)
    body = carrying(joint, site)
    arm = body.R_WB @ site.p_BS
    step = Step([s.at(-arm) for s in step.S], step.p_PB - arm)
    return body, step, [column.seen(body.R_WB).at(-arm) * -1.0 for column in columns]


# Elimination ----------------------------------------------------------------------------------------------------------
@routine
def need(
    places: Places, basis: Places, motion: Motion, twists: Columns, body: Modal, q: Numbers, u: Numbers, more: Numbers
) -> Need:
    """Return what a body needs, at modal coordinates q and rates u.

    places: of the moments: row 3k + l, mode of q, mode.  basis: mode and shape of the entries of T.  more: further
    forces that the modes need, of the elastic energy.
    """
    n, R = len(q), motion.R_WB
    V, bent = ([[0.0] * n for _ in range(9)] for _ in range(2))
    for (row, i, j), (position, rate) in zip(places, body.moments, strict=True):
        V[row][j] = V[row][j] + rate * u[i]
        bent[row][j] = bent[row][j] + position * u[i]
    (P, J), moved = bulk(places, body, q), displacement(body.moves, q, u)
    D, drift = (Matrix([_dot(row, u) for row in rows]) for rows in (P, bent))
    spins = [axial(column) for column in zip(*P, strict=True)]

    omega, alpha, a = (R.T @ v for v in (motion.omega, motion.alpha, motion.a))
    c, v = body.first + moved.by, moved.rate
    force = body.mass * a + cross(alpha, c) + cross(omega, cross(omega, c) + 2.0 * v) + moved.bias
    moment = cross(c, a) + J @ alpha + cross(omega, J @ omega - body.untilted @ omega) + axial(drift)
    moment = moment + 2.0 * ((D[0] + D[4] + D[8]) * omega - D.T @ omega)
    F, turning = Wrench(R @ moment, R @ force), skew(omega) @ skew(omega)
    forces = [
        dot(moved.slopes[j], a) + dot(spins[j], alpha) + _dot(turning, [row[j] for row in P])
        + 2.0 * dot(axial([row[j] for row in V]), omega) + body.stiffness[j] * q[j] + body.damping[j] * u[j] + more[j]
        for j in range(n)
    ]  # fmt: skip

    I = Inertia((R @ J @ R.T).symmetric, skew(R @ c), Symmetric([body.mass] * 3 + [0.0] * 3))
    spins = in_shapes(basis, body.T, spins, ZERO)
    slopes = [s + g for s, g in zip(by_mode(body.moved), curved(body.moves.second, q), strict=True)]
    alone = [Wrench(R @ spin, R @ slope) for spin, slope in zip(spins, slopes, strict=True)]
    moving = [momentum + I.of(twist) for momentum, twist in zip(alone, twists, strict=True)]
    m = [
        [body.mass_of_shapes[i][j] + alone[i].on(twists[j]) + moving[j].on(twists[i]) for j in range(i + 1)]
        for i in range(n)
    ]
    forces = [one + F.on(twist) for one, twist in zip(in_shapes(basis, body.T, forces), twists, strict=True)]
    return Need(I, F, moving, m, forces)


def bulk(places: Places, body: Modal, q: Numbers) -> tuple[Rows, Symmetric]:
    """Return P, nine rows, and the inertia tensor about the origin of the body; places: see `need`."""
    P = [list(row) for row in body.E]
    for (row, i, j), (position, _) in zip(places, body.moments, strict=True):
        P[row][j] = P[row][j] + position * q[i]
    return P, tensor([body.second[r] + _dot(body.E[3 * (r % 3) + r // 3], q) + _dot(P[r], q) for r in range(9)])


def tensor(Q: Numbers) -> Symmetric:
    """Return the inertia tensor tr(Q) 1 - Q of a second moment, of which only the symmetric part counts."""
    across = (-0.5 * (Q[1] + Q[3]), -0.5 * (Q[2] + Q[6]), -0.5 * (Q[5] + Q[7]))
    return Symmetric([Q[4] + Q[8], Q[0] + Q[8], Q[0] + Q[4], *across])


def axial(M: Numbers) -> Vector:
    """Return int rho r x s from the nine int rho r_k s_l."""
    return Vector([M[5] - M[7], M[6] - M[2], M[1] - M[3]])


def section(station: Station, q: Numbers) -> tuple[Vector, Vector, Any, Any, Vector]:
    """Return rotation and curvature at a station, cosine and sine of its twist, and the strain in twisted axes."""
    theta, kappa = (weighted(by_mode(rows), q) for rows in (station.rotation, station.curvature))
    c, s = cos(theta[0]), sin(theta[0])
    twist = kappa[0] - 0.5 * (theta[1] * kappa[2] - theta[2] * kappa[1])
    return theta, kappa, c, s, Vector([twist, c * kappa[1] + s * kappa[2], c * kappa[2] - s * kappa[1]])


@routine
def bend(forces: Numbers, station: Station, q: Numbers) -> list[Any]:
    """Add the forces of a rod's elastic energy beyond that of its modal stiffness, at a station, to those on modes.

    Rods resist bending in the axes of their twisted sections, and bending across bending twists them.
    """
    theta, kappa, c, s, strain = section(station, q)
    torque, m2, m3 = station.stiffness @ strain
    half = 0.5 * torque
    on_rotation = Vector([m2 * strain[2] - m3 * strain[1], -half * kappa[2], half * kappa[1]])
    on_curvature = Vector([torque, c * m2 - s * m3 + half * theta[2], s * m2 + c * m3 - half * theta[1]])
    on_curvature = on_curvature - station.stiffness @ kappa
    both = zip(forces, by_mode(station.rotation), by_mode(station.curvature), strict=True)
    return [f + dot(on_rotation, turn) + dot(on_curvature, curve) for f, turn, curve in both]


@routine
def stiffened(mass: Rows, stiffness: Rows, share: float) -> list[Any]:
    """Return the mass of shapes with a share [s^2] of their stiffness, rows up to the diagonal."""
    return [[a + share * b for a, b in zip(*rows, strict=True)] for rows in zip(mass, stiffness, strict=True)]


@routine
def held(body: Need, beyond: Sequence[Beyond]) -> tuple[list[Any], Resistance]:
    """Return the forces on the shapes of a body that hold them, and what its joint must resist then: a wrench."""
    F, forces = body.F, list(body.forces)
    for (_, wrench), columns in beyond:
        F = F + wrench
        for i, column in enumerate(columns):
            forces[i] = forces[i] + wrench.on(column)
    return forces, Resistance(WITHOUT, F)


@routine
def eliminate(body: Need, beyond: Sequence[Beyond], sound: Any) -> tuple[Gains, list[Any], Resistance, Any]:
    """Eliminate the shapes of a body from its inertia with all that it carries.

    Returns their gains; L^-1 of the forces on them; with what the body resists while they move freely; and `sound`,
    which becomes 0 when a shape moves no mass.
    """
    I, F, P, m, needed = body.I, body.F, list(body.P), [list(row) for row in body.m], list(body.forces)
    for (inertia, wrench), columns in beyond:
        I, F = I + inertia, F + wrench
        for i, column in enumerate(columns):
            momentum = inertia.of(column)
            P[i], needed[i] = P[i] + momentum, needed[i] + wrench.on(column)
            m[i] = [one + momentum.on(other) for one, other in zip(m[i], columns, strict=False)]
    diagonal = [row[i] for i, row in enumerate(m)]
    _, L, least = c.cholesky(m, diagonal, diagonal, 1.0)
    forces, K = forward(L, [-one for one in needed]), list[Wrench]()
    for row, momentum, force in zip(L, P, forces, strict=True):
        for factor, k in zip(row, K, strict=False):
            momentum = momentum - k * factor
        K.append(momentum * row[len(K)])
        I, F = I.without(K[-1], 1.0), F + K[-1] * force
    return Gains(L, K), forces, Resistance(I, F), select(least > MASSLESS, sound, 0.0)


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
    shapes = backward(gains.L, [force - k.on(a) for force, k in zip(forces, gains.K, strict=True)])
    return [*u, *in_modes(basis, T, shapes)], shapes


@routine
def follow(a: Twist, columns: Columns, accelerations: Numbers) -> Twist:
    """Return the acceleration at a port, from that of the body as if rigid, with the part of its shapes."""
    return a + total(columns, accelerations)


@routine
def energies(
    places: Places,
    basis: Places,
    motion: Motion,
    body: Modal,
    q: Numbers,
    u: Numbers,
    gravity: Vector,
    kinetic: Any,
    potential: Any,
    elastic: Any,
) -> tuple[Any, Any, Any]:
    """Return sums with the kinetic energy of a body, its potential energy of gravity, and that of its modal stiffness.

    The arguments are those of `need`.
    """
    (P, J), moved, R, p = (
        bulk(places, body, q),
        displacement(body.moves, q, u),
        motion.R_WB,
        in_shapes(basis, body.T, u),
    )
    omega, v, c = R.T @ motion.omega, R.T @ motion.v, body.first + moved.by
    speeding = cross(omega, c) + moved.rate
    moving = 0.5 * body.mass * dot(v, v) + dot(v, speeding) + 0.5 * dot(omega, J @ omega)
    moving = moving + dot(omega, axial([_dot(row, u) for row in P]))
    for i, row in enumerate(body.mass_of_shapes):
        moving = moving + p[i] * (_dot(row[:i], p[:i]) + 0.5 * row[i] * p[i])
    bent = 0.5 * _dot(body.stiffness, [one * one for one in q])
    return kinetic + moving, potential - dot(gravity, body.mass * motion.p_WB + R @ c), elastic + bent


@routine
def bending_energy(station: Station, q: Numbers, elastic: Any) -> Any:
    """Return the sum with a rod's elastic energy beyond that of its modal stiffness, at a station; see `bend`."""
    _, kappa, _, _, strain = section(station, q)
    return elastic + 0.5 * (dot(strain, station.stiffness @ strain) - dot(kappa, station.stiffness @ kappa))


@routine
def damping_power(damping: Numbers, u: Numbers) -> Any:
    """Return the power that is lost to damping [W]."""
    return _dot(damping, [rate * rate for rate in u])
