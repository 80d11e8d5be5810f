r"""Trees of bodies: motion from the ground outwards, elimination from the leaves inwards, accelerations outwards.

From the leaves to the ground, each body has the inertia I with which it resists while all bodies beyond it move freely,
and needs the wrench F. Each coordinate of its joint, whose motion is s, is eliminated from them:

.. math:: g = I s, \quad D = s\cdot g, \quad K = g/\sqrt{D}, \qquad I \leftarrow I - K K^T ,

so that M = L L^T with L_jk = s_j . K_k for k beyond j, without the mass matrix itself. All vectors of a body refer to
the origin of its own frame, since a distant point costs digits. W is the world, B the body, P the body that carries it.

Source: Rodriguez, Jain & Kreutz-Delgado (1991), International Journal of Robotics Research 10, 371-381; Featherstone
(2008), *Rigid Body Dynamics Algorithms*, ch. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.joints import JOINTS
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import select, sqrt
from flexclear.dynamics.vectors import (
    AT_REST,
    UNIT,
    WITHOUT,
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
    outer,
    skew,
    total,
)

#: pivots D at most this fraction of the largest that all inertia beyond could give in any pose mean a coordinate that
#: moves no mass; rounding leaves a few times 1e-16 of it
MASSLESS = 1e-14


Numbers = Sequence[Any]


class Site(NamedTuple):
    """A frame S on a body, in axes of that.

    velocity, acceleration: of S in the body as modes deform it; the latter without the part from their accelerations.
    """

    p_BS: Vector
    R_BS: Matrix
    velocity: Twist = AT_REST
    acceleration: Twist = AT_REST


class Bounds(NamedTuple):
    """Mass of a body and all beyond [kg], and a bound of their polar moment about its origin [kg m^2]."""

    borne: Any
    reaching: Any


#: where something acts: motion of a body, and a site on it
End = tuple[Motion, Site]


class Body(NamedTuple):
    """A rigid body. com [m], J: inertia about it [kg m^2], axes of the body."""

    mass: Any
    com: Vector
    J: Symmetric


class Coordinates(NamedTuple):
    """Positions and speeds of a joint, and the known part of the rates of the speeds."""

    x: Numbers
    u: Numbers
    du: Numbers


class Step(NamedTuple):
    """From a body to the one that its joint carries. S: motion of that per speed; p_PB: vector to its origin."""

    S: Sequence[Twist]
    p_PB: Vector


class Gain(NamedTuple):
    """Of a coordinate's row of the factor: 1/sqrt(D), and K = g/sqrt(D)."""

    root: Any
    K: Wrench


Gains = Sequence[Gain]


class Resistance(NamedTuple):
    """Inertia of a body with all beyond it, and the wrench that they need without unknown rates of speeds."""

    I: Inertia
    F: Wrench


#: motion of a frame about the origin of its body, per rate of each shape of that; none on a rigid body
Columns = Sequence[Twist]
#: what acts on a body through a frame, about the origin of the body
Beyond = tuple[Resistance, Columns]


def site_motion(body: Motion, site: Site) -> Motion:
    """Return the motion of a site on a body."""
    R, p_BS = body.R_WB, body.R_WB @ site.p_BS
    deforming, speeding = site.velocity.seen(R), site.acceleration.seen(R)
    swing = cross(body.omega, p_BS)
    v = body.v + swing + deforming.linear
    alpha = body.alpha + cross(body.omega, deforming.angular) + speeding.angular
    a = body.a + cross(body.alpha, p_BS) + cross(body.omega, swing + 2.0 * deforming.linear) + speeding.linear
    return Motion(R @ site.R_BS, body.p_WB + p_BS, body.omega + deforming.angular, v, alpha, a)


def carrying(frame: Motion, site: Site) -> Motion:
    """Return the motion of a body from that of a site on it: the reverse of `site_motion`."""
    R = frame.R_WB @ site.R_BS.T
    p_BS, deforming, speeding = R @ site.p_BS, site.velocity.seen(R), site.acceleration.seen(R)
    omega = frame.omega - deforming.angular
    alpha = frame.alpha - speeding.angular - cross(omega, deforming.angular)
    swing = cross(omega, p_BS)
    a = frame.a - cross(alpha, p_BS) - cross(omega, swing + 2.0 * deforming.linear) - speeding.linear
    return Motion(R, frame.p_WB - p_BS, omega, frame.v - swing - deforming.linear, alpha, a)


on_body = routine(site_motion)


def moving(frame: Motion, p: Vector) -> Vector:
    """Return the velocity of the point of a frame's body which is at p in the world."""
    return frame.v + cross(frame.omega, p - frame.p_WB)


def on_both(ends: Sequence[End], B: Motion, wrench: Wrench) -> tuple[Wrench, Wrench]:
    """Return the opposite of a wrench on the first of two bodies, and that on the second one, about their origins.

    wrench: about the site on the second one, whose motion is B.
    """
    a, b = ends
    return (wrench * -1.0).about(B.p_WB - a[0].p_WB), wrench.about(b[0].R_WB @ b[1].p_BS)


@routine
def ground(gravity: Any) -> Motion:
    """Return the motion of the ground; gravity is an upward acceleration of it."""
    return Motion(UNIT, ZERO, ZERO, ZERO, ZERO, -Vector(gravity))


@routine
def place(kind: str, parent: Motion, site: Site, coordinates: Coordinates) -> tuple[Motion, Step]:
    """Return a body's motion, from that of the body on which its joint sits at a site, and the step between them."""
    F = site_motion(parent, site)
    x, u, du = coordinates
    R_FG, p_FG, S, bias = JOINTS[kind].motion(x, u)
    p_FG = F.R_WB @ p_FG
    S = [s.seen(F.R_WB) for s in S]
    relative, growing = total(S, u), total(S, du) + bias.seen(F.R_WB)
    swing = cross(F.omega, p_FG)
    alpha = F.alpha + cross(F.omega, relative.angular) + growing.angular
    a = F.a + cross(F.alpha, p_FG) + cross(F.omega, swing + 2.0 * relative.linear) + growing.linear
    v = F.v + swing + relative.linear
    body = Motion(F.R_WB @ R_FG, F.p_WB + p_FG, F.omega + relative.angular, v, alpha, a)
    return body, Step(S, parent.R_WB @ site.p_BS + p_FG)


@routine
def push(wrench: Wrench) -> Resistance:
    """Return a wrench on a body as what it resists: a wrench without inertia, which the body need not be given."""
    return Resistance(WITHOUT, wrench * -1.0)


@routine
def pull(wrenches: Sequence[Wrench], sizes: Numbers) -> Resistance:
    """Return wrenches per unit, each times its size, in the same way."""
    parts = [wrench * size for wrench, size in zip(wrenches, sizes, strict=True)]
    return Resistance(WITHOUT, sum(parts, Wrench(ZERO, ZERO)) * -1.0)


def resistance(motion: Motion, body: Body, beyond: Sequence[Beyond]) -> Resistance:
    """Return the inertia of a body about its origin, and the wrench that its known acceleration needs.

    beyond: of the bodies that it carries, which move freely, and of wrenches on it.
    """
    c, m, w = motion.R_WB @ body.com, body.mass, motion.omega
    about_com = (motion.R_WB @ body.J @ motion.R_WB.T).symmetric
    away = ((m * dot(c, c)) * UNIT - m * outer(c, c)).symmetric
    I = Inertia(about_com + away, skew(m * c), Symmetric([m, m, m, 0.0, 0.0, 0.0]))
    a = motion.a + cross(motion.alpha, c) + cross(w, cross(w, c))
    spin = about_com @ motion.alpha + cross(w, about_com @ w)
    F = Wrench(spin, m * a).about(c)
    for one, _ in beyond:
        I, F = I + one.I, F + one.F
    return Resistance(I, F)


resist = routine(resistance)


@routine
def eliminate(
    carried_on: int, motion: Motion, body: Body, bounds: Bounds, step: Step, beyond: Sequence[Beyond], sound: Any
) -> Any:
    """Eliminate the coordinates of a rigid body's joint from the resistance of the body and all beyond."""
    return without_coordinates(carried_on, resistance(motion, body, beyond), bounds, step, sound)


def without_coordinates(carried_on: int, rest: Resistance, bounds: Bounds, step: Step, sound: Any) -> Any:
    """Eliminate the coordinates of a body's joint from the resistance of the body with all beyond.

    Returns what remains for the body that carries it, about that one's origin, if `carried_on` is 1; the coordinates'
    gains; L^-1 of the forces along them; and `sound`, which becomes 0 when a coordinate moves no mass.
    """
    (I, F), gains, forces = rest, list[Gain](), list[Any]()
    for s in step.S:
        g = I.of(s)
        D, needed = g.on(s), F.on(s)
        least = MASSLESS * (bounds.reaching * dot(s.angular, s.angular) + bounds.borne * dot(s.linear, s.linear))
        sound = select(least < D, sound, 0.0)  # also if D is not a number
        inverse = 1.0 / D
        root = sqrt(inverse)
        gains.append(Gain(root, g * root))
        forces.append(-root * needed)
        I, F = I.without(g, inverse), F - g * (inverse * needed)
    return carried_at(step, Resistance(I, F)) if carried_on else None, gains, forces, sound


free_joint = routine(without_coordinates)


@routine
def holding_forces(step: Step, rest: Resistance) -> tuple[list[Any], Resistance]:
    """Return the forces along the coordinates of a joint that hold what it carries, and what the body that carries it
    must resist of it then: a wrench."""
    return [rest.F.on(s) for s in step.S], Resistance(WITHOUT, rest.F.about(step.p_PB))


@routine
def add(one: Any, other: Any) -> Any:
    """Return the sum of two wrenches or numbers."""
    return one + other


def carried_at(step: Step, rest: Resistance) -> Resistance:
    """Return a resistance about the origin of the body that carries it."""
    return Resistance(rest.I.about(step.p_PB), rest.F.about(step.p_PB))


carry = routine(carried_at)


@routine
def accelerate(kind: str, coordinates: Coordinates, parent: Twist, step: Step, gains: Gains, forces: Numbers) -> Any:
    """Return the rates of a joint's positions and speeds, and the acceleration of the body, by L^-T.

    Accelerations are without the known part.  forces: L^-1 of those along the coordinates.
    """
    a, rates = parent.at(step.p_PB), list[Any]()
    for s, gain, force in reversed(list(zip(step.S, gains, forces, strict=True))):
        rates.insert(0, gain.root * (force - gain.K.on(a)))
        a = a + s * rates[0]
    return [*JOINTS[kind].position_rate(coordinates.x, coordinates.u), *rates], a


@routine
def position_rates(kind: str, x: Numbers, u: Numbers) -> list[Any]:
    """Return the rates of a joint's positions at speeds, or their change by a small displacement."""
    return list(JOINTS[kind].position_rate(x, u))


@routine
def move_positions(kind: str, x: Numbers, by: Numbers) -> list[Any]:
    """Return the positions of a joint after a displacement: at its constant speed, in one step of order 4.

    This is exact for translations and single angles, and for quaternions to 3e-4 times the fifth power of the angle,
    far below the error of a method of second order.
    """
    reached, slopes = list(x), list[Numbers]()
    for reach in (0.5, 0.5, 1.0, 0.0):
        slopes.append(JOINTS[kind].position_rate(reached, by))
        reached = [one + reach * slope for one, slope in zip(x, slopes[-1], strict=True)]
    first, second, third, fourth = slopes
    total = [a + 2.0 * (b + c) + d for a, b, c, d in zip(first, second, third, fourth, strict=True)]
    return [one + change / 6.0 for one, change in zip(x, total, strict=True)]


@routine
def follow(parent: Twist, step: Step) -> Twist:
    """Return the acceleration of a body whose coordinates are prescribed, without the known part."""
    return parent.at(step.p_PB)


@routine
def driving_power(step: Step, rest: Resistance, acceleration: Twist, closing: Sequence[Any], u: Numbers) -> Any:
    """Return the power [W] that the drives of a joint supply at its speeds; see `needed_wrench`."""
    return needed_wrench(rest, acceleration, closing).on(total(step.S, u))


def needed_wrench(rest: Resistance, acceleration: Twist, closing: Sequence[Any]) -> Wrench:
    """Return the wrench that a body with all beyond it needs through its joint.

    acceleration: without the known part.  closing: of each closure the wrenches of its rows on the body and all beyond,
    and its multipliers.
    """
    F = rest.F + rest.I.of(acceleration)
    for wrenches, multipliers in closing:
        for wrench, size in zip(wrenches, multipliers, strict=True):
            F = F - wrench * size
    return F


# What is recorded -----------------------------------------------------------------------------------------------------
@routine
def driving_forces(step: Step, rest: Resistance, acceleration: Twist, closing: Sequence[Any]) -> tuple[Any]:
    """Return the forces of the drives of a joint along its coordinates; see `needed_wrench`."""
    F = needed_wrench(rest, acceleration, closing)
    return ([F.on(s) for s in step.S],)


@routine
def joint_wrench(rest: Resistance, acceleration: Twist, closing: Sequence[Any], p_WB: Vector) -> tuple[Wrench]:
    """Return the wrench on a body through its joint about the origin of the world; see `needed_wrench`."""
    return (needed_wrench(rest, acceleration, closing).about(p_WB),)


@routine
def whole_motion(body: Motion, site: Site, acceleration: Twist) -> tuple[Any]:
    """Return the motion of a site on a body with its whole acceleration; acceleration: part that the body's lacks."""
    F, more = site_motion(body, site), acceleration.at(body.R_WB @ site.p_BS)
    return ((F.p_WB, F.R_WB, F.omega, F.v, F.alpha + more.angular, F.a + more.linear),)


@routine
def energies(motion: Motion, body: Body, gravity: Vector, kinetic: Any, potential: Any) -> tuple[Any, Any]:
    """Return sums with the kinetic energy of a rigid body, and its potential energy of gravity."""
    c, omega = motion.R_WB @ body.com, motion.R_WB.T @ motion.omega
    v = motion.v + cross(motion.omega, c)
    moving = 0.5 * (body.mass * dot(v, v) + dot(omega, body.J @ omega))
    return kinetic + moving, potential - body.mass * dot(gravity, motion.p_WB + c)
