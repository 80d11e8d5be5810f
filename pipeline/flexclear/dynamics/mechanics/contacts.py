"""Contacts of two surfaces, and stops at the ends of joint coordinates: their forces, and what steps read of them.

Both forces act at one point Q on the inner surface, so that they conserve angular momentum; the sliding velocity is
that of the material points at Q, so that rolling is no sliding. A stop's gap is one along the coordinate.

What steps read is a row of `memory.TOUCH`, followed by the rates of the books: power of damping, power of friction,
impulse; of contacts with wear sliding distance and load path (Archard 1953, Journal of Applied Physics 24, 981-988).
Source: Wang & Wang (2019), eqs. (23), (24).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexclear.dynamics.contact.form import FORMS
from flexclear.dynamics.contact.friction import FRICTION_LAWS
from flexclear.dynamics.contact.surfaces import SURFACES
from flexclear.dynamics.contact.surfaces.profile import separate
from flexclear.dynamics.contact.surfaces.separation import across
from flexclear.dynamics.joints.conditions import along
from flexclear.dynamics.mechanics.trees import End, Numbers, moving, on_both, site_motion
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import branch, larger, sqrt
from flexclear.dynamics.vectors import ZERO, Vector, Wrench, cross, dot


def push(form: str, numbers: Any, depth: Any, approach: Any, latched: Any) -> tuple[Any, Any, Any]:
    """Return the normal force of a law [N or N m], the power that its damping takes, and the energy that it stores.

    depth: penetration.  latched: the rate at which this contact began.
    """
    law, depth = FORMS[form], larger(0.0, depth)
    elastic, damping = law.force(depth, approach, larger(latched, numbers.floor), numbers)
    return larger(0.0, elastic + damping), damping * approach, law.stored(depth, numbers)


def rub(law: str, numbers: Numbers, bristle: Numbers, slip: Vector, N: Any) -> tuple[Vector, Any, Any, Vector]:
    """Return the friction of a law (none: "") on the inner body, the power that it takes, the energy that its bristles
    store, and their rate; slip: sliding velocity."""
    if not law:
        return ZERO, 0.0, 0.0, ZERO
    traction: tuple[Vector, Any, Any, Vector] = FRICTION_LAWS[law].traction(Vector(bristle or ZERO), slip, N, numbers)
    return traction


@routine
def touch(
    surfaces: str,
    laws: tuple[str, str],
    worn: int,
    profile: Any,
    numbers: Any,
    closed: Any,
    latched: Any,
    bristle: Numbers,
    *ends: End,
) -> Any:
    """Return what steps read of a contact, the rates of its books and bristles; then the wrenches on both bodies.

    laws: form of its normal force, friction law or "".  worn: 1 with wear, else 0.  profile: of worn surfaces, see
    `contact.surfaces.profile.separate`, or ().  closed: 1 where the surfaces touch.  bristle: deflection, in axes of
    the outer frame, of a law that has some.  ends: of the outer and the inner surface.
    Source: Wang & Wang (2019), eqs. (23), (24).
    """
    A, B = (site_motion(*end) for end in ends)
    p = B.p_WB - A.p_WB
    v = B.v - A.v - cross(A.omega, p)
    near = SURFACES[surfaces].separation(numbers, A.R_WB, p, v)
    shaped = separate(profile, numbers, (A, B), near, v) if profile else None
    gap, approach, n, turning, offset = shaped.separation if shaped else near
    z = across(n, A.R_WB @ Vector(bristle)) if bristle else ZERO

    def forces() -> Any:
        N, taken, stored = push(laws[0], numbers, -gap, approach, latched)
        N = shaped.steepness * N if shaped else N
        Q = B.p_WB + (shaped.arm if shaped else numbers.radius * n)
        slip = across(n, moving(B, Q) - moving(A, Q))
        speed = sqrt(dot(slip, slip))
        friction, lost, bent, z_rate = rub(laws[1], numbers.friction_law, z, slip, N)
        rate = A.R_WB.T @ (across(n, z_rate) - dot(turning, z) * n)
        read = N, -lost, taken, stored, bent, speed if laws[1] else 0.0
        return read, friction - N * n, Q, (taken, -dot(friction, slip), N, speed, speed * N), rate

    apart = (0.0,) * 6, ZERO, ZERO, (0.0,) * 5, ZERO
    read, F, Q, books, rate = branch(closed == 1, forces, lambda: apart)
    stored = gap, approach, read, F, A.R_WB.T @ offset, Q, books[: 5 if worn else 3], rate if bristle else ()
    moment = cross(Q - B.p_WB, F)
    moment = moment + read[0] * shaped.moment if shaped else moment
    return stored, on_both(ends, B, Wrench(moment, F)), ()


@routine
def stop(
    form: str, gauges: Sequence[Any], numbers: Any, closed: Any, latched: Any, turns: Sequence[Numbers], *ends: End
) -> Any:
    """Return the same of the end of a joint coordinate, and the rates of turns; the force acts along it.

    gauges, turns, ends: of the coordinate; then, if there is one, of that which is subtracted from it, ratio times.
    """
    sites, (limit, sense, ratio) = [site_motion(*end) for end in ends], numbers.shape
    first, *others = (along(*one) for one in zip(gauges, turns, sites[::2], sites[1::2], strict=True))
    value, rate = first.value, first.rate
    for other in others:
        value, rate = value - ratio * other.value, rate - ratio * other.rate
    gap, approach = sense * (limit - value), sense * rate
    law = branch(closed == 1, lambda: push(form, numbers, -gap, approach, latched), lambda: (0.0, 0.0, 0.0))
    N, taken, stored = law
    wrench = first.unit * (-sense * N)
    force = wrench.moment if gauges[0].turning else wrench.force
    wrenches: tuple[Wrench, ...] = on_both(ends[:2], sites[1], wrench)
    for other in others:
        wrenches = *wrenches, *on_both(ends[2:], sites[3], other.unit * (ratio * sense * N))
    counted = [one.rate for one, before in zip((first, *others), turns, strict=True) for _ in before]
    read = gap, approach, (N, 0.0, taken, stored, 0.0, 0.0), force, (numbers.clearance - gap, 0.0, 0.0), ZERO
    return (read, (taken, 0.0, N), counted), wrenches, ()
