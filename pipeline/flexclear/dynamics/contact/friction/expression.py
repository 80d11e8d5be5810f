"""Friction by an expression: the coefficient as a function of the sliding speed and the normal force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics.contact.expression import composed, left, numbers_of, zeros
from flexclear.dynamics.contact.friction.law import Friction, sliding_under

#: sliding speeds [m/s] and normal forces [N] at which a coefficient is tried
SPEEDS, FORCES = np.geomspace(1e-9, 1e3, 61), (1e-3, 1.0, 1e3, 1e6)
#: coefficient at the least speed that counts as one at rest
AT_REST = 1e-3


def law_of(kind: str) -> Friction:
    """Return the friction law of an expression for its coefficient."""
    bends = list[Callable]()
    coefficient = composed(kind, bends)

    def kinks(law: Any) -> tuple[float, float]:
        """Return the first two speeds at which the coefficient has kinks."""
        p = *law.encoded[1], *numbers_of(law)
        found = zeros(bends, SPEEDS[0], SPEEDS[-1], 1.0, 0.0, p)
        first, second, *_ = (*found, 0.0, 0.0)
        return first, second

    return Friction(sliding_under(coefficient), constants=lambda law: law.encoded[1], kinks=kinks)


def check(law: Any) -> None:
    """Raise ValueError, in words, for a coefficient that is negative, no number, or not zero at rest."""
    kind, values = law.kind, (*law.encoded[1], *numbers_of(law))
    coefficient, text = composed(kind), f"coefficient = '{law.coefficient}'"
    with np.errstate(all="ignore"):
        if start := left(law, SPEEDS[0], FORCES[0], 0.0, values):
            raise ValueError(f"{text} has no value at rest without force, at which contacts begin: {start}")
        for force in FORCES:
            if left(law, SPEEDS[0], force, 0.0, values):
                break
            found = [float(coefficient(v, np.float64(force), 0.0, values)) for v in SPEEDS]
            for v, mu in zip(SPEEDS, found, strict=True):
                if left(law, v, force, 0.0, values):
                    break
                if not 0.0 <= mu < np.inf:
                    why = "would drive the sliding" if mu < 0.0 else "is no number"
                    raise ValueError(f"{text} {why}: it is {mu:.4g} at a slip of {v:.3g} m/s under {force:g} N")
            if found[0] > AT_REST:
                raise ValueError(
                    f"{text} is {found[0]:.3g} at rest, where friction would jump: it must fall to zero there, as "
                    "mu*tanh(slip/v) with a small speed v"
                )
