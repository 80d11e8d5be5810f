"""A normal law of one's own: the checks of its expression, and the restitution that it delivers.

Damping is what the force at a rate exceeds that at rest. `impact_rate` is the rate at which this contact began.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise, product
from math import nan
from typing import Any

import numpy as np

from flexclear.dynamics.contact.expression import Look, composed, left, numbers_of, zeros
from flexclear.dynamics.contact.form.energy import integral
from flexclear.dynamics.contact.form.expression import VALUES, form_of, pieces
from flexclear.dynamics.contact.law import RESTITUTION_ERROR, Numbers, Resolved
from flexclear.dynamics.lookup import NOWHERE
from flexclear.scene.law_expressions import NormalExpression

#: approach speeds of the free impacts that are tried [m/s or rad/s], the reported one in the middle
SPEEDS = (0.01, 0.1, 1.0)
#: excess of a rebound over the approach that is an error of its computation
ROUNDING = 1e-4


def resolve(law: NormalExpression, mass: float | None, reach: float) -> Resolved:
    """Return the law with its values; raise ValueError, in words, for a force that no contact has.

    mass: that rebounds, if known.  reach: largest penetration that a contact may have [m or rad].
    """
    kind, constants = law.encoded
    text, looked_up = f"force = '{law.force}'", numbers_of(law)
    values = *(*constants, *(0.0,) * VALUES)[:VALUES], *looked_up
    damped = _damped(law, values, reach, text)
    if law.restitution not in (None, 1.0) and not damped:
        raise ValueError(
            f"{text} has no damping, as it does not depend on rate, but a restitution of {law.restitution:g} is asked; "
            "give it a damping, or leave out restitution"
        )
    numbers = Numbers(0.0, 1.0, float(damped), (*values[:VALUES], *_pieces(law, values, reach, text), *looked_up))
    found = [rebound(kind, numbers.values, 1.0 if mass is None else mass, speed) for speed in SPEEDS]
    for speed, e in zip(SPEEDS, found, strict=True):
        if e > 1.0 + ROUNDING:
            raise ValueError(
                f"{text} feeds energy: a free impact at {speed:g} m/s or rad/s rebounds with {e:.4g} of it; damping "
                "is positive where rate is"
            )
    delivered = found[1] if damped else 1.0
    known = delivered == delivered and (
        mass is not None or abs(rebound(kind, numbers.values, 10.0, SPEEDS[1]) - delivered) < ROUNDING
    )
    warning = None
    if known and law.restitution is not None and abs(delivered - law.restitution) > RESTITUTION_ERROR:
        warning = (
            f"the expression with restitution = {law.restitution:g} delivers {delivered:.4g}, at an approach of "
            f"{SPEEDS[1]:g} m/s"
        )
    return Resolved(kind, numbers, law.restitution, delivered if known else None, warning)


def _damped(law: NormalExpression, values: tuple[Any, ...], reach: float, text: str) -> bool:
    """Return whether the force depends on the rate; raise ValueError for a force that pulls, or is no number.

    States that its tables do not have are left out, but for depth and rate zero, at which each contact ends.
    """
    whole, damped = composed(law.kind), False
    if start := left(law, 0.0, 0.0, SPEEDS[1], values):
        raise ValueError(f"{text} has no value at depth = 0 at rest: {start}")
    with np.errstate(all="ignore"):
        for depth in (0.0, *(reach * np.geomspace(1e-7, 1.0, 29)).tolist()):
            if left(law, depth, 0.0, SPEEDS[1], values):
                break
            at_rest = [float(whole(np.float64(depth), np.float64(0.0), v, values)) for v in SPEEDS]
            if at_rest[0] < 0.0:
                raise ValueError(f"{text} pulls: it is {at_rest[0]:.4g} N at rest at depth = {depth:.3g}")
            if max(at_rest) - min(at_rest) > 1e-9 * max(at_rest):
                raise ValueError(f"{text} depends on impact_rate at rest (rate = 0), where the contact stores energy")
            for v, share in product(SPEEDS, (1.0, -0.5)):
                if left(law, depth, share * v, v, values):
                    continue
                force = float(whole(np.float64(depth), np.float64(share * v), v, values))
                if not np.isfinite(force) or not np.isfinite(at_rest[0]):
                    raise ValueError(f"{text} is no number at depth = {depth:.3g}, rate = {share * v:g}")
                damped |= abs(force - at_rest[0]) > 1e-12 * at_rest[0]
    return damped


def kinks(law: NormalExpression, values: tuple[Any, ...], reach: float) -> list[float]:
    """Return the penetrations up to some `reach` at which a derivative of the elastic force jumps."""
    bends, looks, at = list[Callable](), list[Look](), (1e-7 * reach, 10.0 * reach, 0.0, 1.0, values)
    composed(law.kind, bends, looks)
    found, tables = set(zeros(bends, *at)), list(law.tables.values())
    for number, operands in looks:
        for axis, operand in zip(tables[number].axes(), operands, strict=True):
            if all(operand(x, *at[2:]) == x for x in axis):  # depth itself
                found |= {x for x in axis if x > 0.0}
            else:
                found |= set(zeros([operand], *at, levels=axis))
    return sorted(found)


def _pieces(law: NormalExpression, values: tuple[Any, ...], reach: float, text: str) -> tuple[tuple[float, ...], ...]:
    """Return where pieces of the elastic force begin, then the energies stored there; none without kinks."""
    levels = pieces(law.kind)
    starts, count = [0.0, *kinks(law, values, reach)], 1 << levels
    if len(starts) > count:
        raise ValueError(f"{text} has {len(starts) - 1} kinks at rest, at most {count - 1}: write a simpler expression")
    if not levels:
        return ()
    whole, energies = composed(law.kind), [0.0]
    over = integral(lambda depth, _: whole(depth, 0.0, 1.0, values))
    for begin, end in pairwise(starts):
        energies.append(energies[-1] + float(over(begin, end, None)))
    room = count - len(starts)
    return ((*starts, *(NOWHERE,) * room, *energies, *(0.0,) * room),)


@lru_cache(maxsize=1024)
def rebound(kind: str, values: tuple[Any, ...], mass: float, speed: float) -> float:
    """Return rebound over approach speed of a free impact, to some four digits; nan where it leaves a table.

    Runge-Kutta steps of a fraction of the time that an elastic impact of this speed takes.
    """
    whole, form = composed(kind), form_of(kind)
    law = type("Law", (), {"values": values})
    deepest = 1e-12
    while form.stored(np.float64(deepest), law) < 0.5 * mass * speed**2:
        deepest *= 1.5
        if deepest > 1e9:
            return 0.0  # nothing stops it
    h, d, v, before = 0.02 * deepest / speed, np.float64(0.0), np.float64(speed), (0.0, speed)

    def slope(d: Any, v: Any) -> Any:
        return -max(whole(max(0.0, d), v, speed, values), 0.0) / mass

    for _ in range(5_000):
        k1 = slope(d, v)
        if v < 0.0 and (k1 == 0.0 or d <= 0.0):
            pull = min(0.0, whole(max(0.0, d), v, speed, values)) / mass
            share = before[0] / (before[0] - pull) if before[0] > pull else 1.0  # of the step in which the force ended
            return float(-(before[1] + share * (v - before[1])) / speed)
        before = (-k1, v)
        if k1 != k1:
            return nan
        k2 = slope(d + 0.5 * h * v, v + 0.5 * h * k1)
        k3 = slope(d + 0.5 * h * v + 0.25 * h * h * k1, v + 0.5 * h * k2)
        k4 = slope(d + h * v + 0.5 * h * h * k2, v + h * k3)
        d, v = d + h * v + h * h * (k1 + k2 + k3) / 6.0, v + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return 0.0
