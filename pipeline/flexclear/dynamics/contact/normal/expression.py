"""A normal law of one's own: the checks of its expression, and the restitution that it delivers.

Damping is what the force at a rate exceeds that at rest. `impact_rate` is the rate at which this contact began.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from flexclear.dynamics.contact.expression import composed, zeros
from flexclear.dynamics.contact.form.expression import KINKS, form_of
from flexclear.dynamics.contact.law import RESTITUTION_ERROR, Numbers, Resolved
from flexclear.scene.law_expressions import NormalExpression

#: most kinks of the elastic force, and a penetration that none reaches
MOST_KINKS, NEVER = 2, 1e300
#: approach speeds of the free impacts that are tried [m/s or rad/s], the reported one in the middle
SPEEDS = (0.01, 0.1, 1.0)
#: excess of a rebound over the approach that is an error of its computation
ROUNDING = 1e-4


def resolve(law: NormalExpression, mass: float | None, reach: float) -> Resolved:
    """Return the law with its values; raise ValueError, in words, for a force that no contact has.

    mass: that rebounds, if known.  reach: largest penetration that a contact may have [m or rad].
    """
    kind, values = law.encoded
    whole, text = composed(kind), f"force = '{law.force}'"
    damped = _damped(whole, values, reach, text)
    if law.restitution not in (None, 1.0) and not damped:
        raise ValueError(
            f"{text} has no damping, as it does not depend on rate, but a restitution of {law.restitution:g} is asked; "
            "give it a damping, or leave out restitution"
        )
    bends = kinks(kind, values, reach)
    if len(bends) > MOST_KINKS:
        raise ValueError(f"{text} has {len(bends)} kinks at rest, at most {MOST_KINKS}: write fewer max, min and abs")
    numbers = Numbers(
        0.0, 1.0, float(damped), ((*values, *(0.0,) * KINKS)[:KINKS] + (*bends, NEVER, NEVER)[:MOST_KINKS])
    )
    found = [rebound(kind, numbers.values, 1.0 if mass is None else mass, speed) for speed in SPEEDS]
    for speed, e in zip(SPEEDS, found, strict=True):
        if e > 1.0 + ROUNDING:
            raise ValueError(
                f"{text} feeds energy: a free impact at {speed:g} m/s or rad/s rebounds with {e:.4g} of it; damping "
                "is positive where rate is"
            )
    delivered = found[1] if damped else 1.0
    known = mass is not None or abs(rebound(kind, numbers.values, 10.0, SPEEDS[1]) - delivered) < ROUNDING
    warning = None
    if known and law.restitution is not None and abs(delivered - law.restitution) > RESTITUTION_ERROR:
        warning = (
            f"the expression with restitution = {law.restitution:g} delivers {delivered:.4g}, at an approach of "
            f"{SPEEDS[1]:g} m/s"
        )
    return Resolved(kind, numbers, law.restitution, delivered if known else None, warning)


def _damped(whole: Callable, values: tuple[float, ...], reach: float, text: str) -> bool:
    """Return whether the force depends on the rate; raise ValueError for a force that pulls, or is no number."""
    damped = False
    with np.errstate(all="ignore"):
        for depth in (0.0, *(reach * np.geomspace(1e-7, 1.0, 29)).tolist()):
            at_rest = [float(whole(np.float64(depth), np.float64(0.0), v, values)) for v in SPEEDS]
            if at_rest[0] < 0.0:
                raise ValueError(f"{text} pulls: it is {at_rest[0]:.4g} N at rest at depth = {depth:.3g}")
            if max(at_rest) - min(at_rest) > 1e-9 * max(at_rest):
                raise ValueError(f"{text} depends on impact_rate at rest (rate = 0), where the contact stores energy")
            for v, share in product(SPEEDS, (1.0, -0.5)):
                force = float(whole(np.float64(depth), np.float64(share * v), v, values))
                if not np.isfinite(force) or not np.isfinite(at_rest[0]):
                    raise ValueError(f"{text} is no number at depth = {depth:.3g}, rate = {share * v:g}")
                damped |= abs(force - at_rest[0]) > 1e-12 * at_rest[0]
    return damped


def kinks(kind: str, values: tuple[float, ...], reach: float) -> list[float]:
    """Return the penetrations up to `reach` at which the slope of the elastic force jumps."""
    bends = list[Callable]()
    composed(kind, bends)
    return zeros(bends, 1e-7 * reach, 10.0 * reach, 0.0, 1.0, values)


@lru_cache(maxsize=1024)
def rebound(kind: str, values: tuple[float, ...], mass: float, speed: float) -> float:
    """Return rebound over approach speed of a free impact, to some four digits.

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
        return -max(0.0, whole(max(0.0, d), v, speed, values)) / mass

    for _ in range(5_000):
        k1 = slope(d, v)
        if v < 0.0 and (k1 == 0.0 or d <= 0.0):
            pull = min(0.0, whole(max(0.0, d), v, speed, values)) / mass
            share = before[0] / (before[0] - pull) if before[0] > pull else 1.0  # of the step in which the force ended
            return float(-(before[1] + share * (v - before[1])) / speed)
        before = (-k1, v)
        k2 = slope(d + 0.5 * h * v, v + 0.5 * h * k1)
        k3 = slope(d + 0.5 * h * v + 0.25 * h * h * k1, v + 0.5 * h * k2)
        k4 = slope(d + h * v + 0.5 * h * h * k2, v + h * k3)
        d, v = d + h * v + h * h * (k1 + k2 + k3) / 6.0, v + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return 0.0
