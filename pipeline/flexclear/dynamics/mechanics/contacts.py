"""Contacts of two surfaces, and stops at the ends of joint coordinates: their forces, and what steps read of them.

Both forces act at one point Q on the inner surface, so that they conserve angular momentum; the sliding velocity is
that of the material points at Q, so that rolling is no sliding. A stop's gap is one along the coordinate.
Source: Wang & Wang (2019), eqs. (23), (24).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexclear.dynamics.effects import FORMS, FRICTION_LAWS
from flexclear.dynamics.mechanics.coordinates import Gauge, along
from flexclear.dynamics.mechanics.surfaces import SURFACES, across
from flexclear.dynamics.mechanics.trees import End, Numbers, carried, moving, on_both
from flexclear.dynamics.mechanics.vectors import ZERO, Vector, Wrench, cross, dot
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.routines.symbols import branch, larger, shared, sqrt
from flexclear.scene.registry import lookup


class ContactNumbers(NamedTuple):
    """Numbers of a contact; see `memory.CONTACT_NUMBERS`."""

    clearance: Any
    radius: Any
    floor: Any
    stick_speed: Any
    stiffness: Any
    exponent: Any
    damping: Any
    friction_law: Numbers
    shape: Numbers
    length: Any


class Push(NamedTuple):
    """Normal force of a contact [N or N m], power [W] that its damping takes, energy [J] that it stores."""

    size: Any
    lost: Any
    stored: Any


class Rub(NamedTuple):
    """Friction on the inner body [N], power [W] that it takes, energy [J] in bristles, and the rate of these [m/s]."""

    force: Vector = ZERO
    lost: Any = 0.0
    stored: Any = 0.0
    rate: Vector = ZERO


class Touch(NamedTuple):
    """What steps read of a contact; see `memory.TOUCH`. The other defaults are those of an open one."""

    gap: Any
    approach: Any
    normal_force: Any = 0.0
    friction_power: Any = 0.0
    damping_power: Any = 0.0
    stored: Any = 0.0
    bent: Any = 0.0
    slip: Any = 0.0
    force: Vector = ZERO
    offset: Vector = ZERO
    point: Vector = ZERO


class Kinds(NamedTuple):
    """Surfaces of a contact, form of its normal force, its friction law or "", and whether it wears (1) or not (0)."""

    surfaces: str
    form: str
    friction: str
    worn: int


def push(form: str, numbers: ContactNumbers, depth: Any, approach: Any, latched: Any) -> Push:
    """Return the normal force at a penetration; latched: the rate at which this contact began."""
    law, depth = lookup(FORMS, form, where="contact"), larger(0.0, depth)
    elastic, damping = shared(law.force)(depth, approach, larger(latched, numbers.floor), numbers)
    return Push(larger(0.0, elastic + damping), damping * approach, shared(law.stored)(depth, numbers))


def rub(law: str, numbers: Numbers, bristle: Vector, slip: Vector, normal_force: Any) -> Rub:
    """Return the friction of a law at a sliding velocity."""
    traction = shared(lookup(FRICTION_LAWS, law, where="contact").traction)
    force, lost, stored, rate = traction(bristle, slip, normal_force, numbers)
    return Rub(Vector(force), lost, stored, Vector(rate))


@routine
def touch(
    kinds: Kinds, numbers: ContactNumbers, closed: Any, latched: Any, bristle: Numbers, outer: End, inner: End
) -> Any:
    """Return `Touch` with the rates of a contact's books, wear and bristles; then the wrenches on both bodies.

    closed: 1 where the surfaces touch.  bristle: deflection, in axes of the outer frame, of a law that has some.
    """
    A, B = carried(*outer), carried(*inner)
    p = B.p_WB - A.p_WB
    gap, approach, n, turning, offset = SURFACES[kinds.surfaces](numbers, A.R_WB, p, B.v - A.v - cross(A.omega, p))
    z = across(n, A.R_WB @ Vector(bristle)) if bristle else ZERO
    apart = Touch(gap, approach, offset=A.R_WB.T @ offset)

    def forces() -> tuple[Touch, Numbers, Vector]:
        normal = push(kinds.form, numbers, -gap, approach, latched)
        Q = B.p_WB + numbers.radius * n
        slip = across(n, moving(B, Q) - moving(A, Q))
        speed = sqrt(dot(slip, slip))
        friction = rub(kinds.friction, numbers.friction_law, z, slip, normal.size) if kinds.friction else Rub()
        now = apart._replace(
            normal_force=normal.size,
            friction_power=-friction.lost,
            damping_power=normal.lost,
            stored=normal.stored,
            bent=friction.stored,
            slip=speed if kinds.friction else 0.0,
            force=friction.force - normal.size * n,
            point=Q,
        )
        books = normal.lost, -dot(friction.force, slip), normal.size, speed, speed * normal.size
        return now, books, A.R_WB.T @ (across(n, friction.rate) - dot(turning, z) * n)

    now, books, rate = branch(closed == 1, forces, lambda: (apart, (0.0,) * 5, ZERO))
    wrench = Wrench(cross(now.point - B.p_WB, now.force), now.force)
    return (now, books[: 5 if kinds.worn else 3], rate if bristle else ()), on_both(outer, inner, B, wrench), ()


@routine
def stop(
    form: str, gauge: Gauge, numbers: ContactNumbers, closed: Any, latched: Any, turns: Numbers, a: End, b: End
) -> Any:
    """Return the same as `touch` of the end of a joint coordinate, which pushes along that; and the rate of turns."""
    F, G = carried(*a), carried(*b)
    value, rate, unit = along(gauge, turns, F, G)
    limit, sense = numbers.shape
    gap = sense * (limit - value)
    apart = Touch(gap, sense * rate, offset=Vector([numbers.clearance - gap, 0.0, 0.0]))

    def force() -> tuple[Touch, Numbers, Any]:
        normal = push(form, numbers, -gap, sense * rate, latched)
        wrench = unit * (-sense * normal.size)
        now = apart._replace(
            normal_force=normal.size,
            damping_power=normal.lost,
            stored=normal.stored,
            force=wrench.moment if gauge.turning else wrench.force,
        )
        return now, (normal.lost, 0.0, normal.size), wrench

    now, books, wrench = branch(closed == 1, force, lambda: (apart, (0.0,) * 3, Wrench(ZERO, ZERO)))
    return (now, books, [rate for _ in turns]), on_both(a, b, G, wrench), ()
