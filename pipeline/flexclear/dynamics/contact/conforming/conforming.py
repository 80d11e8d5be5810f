"""What all elastic forces of tight fits return, and those of logarithmic formulas."""

from __future__ import annotations

from dataclasses import dataclass
from math import e, exp, inf, pi
from typing import Any

from flexclear.dynamics.contact.form.logarithmic import LIMIT_DEPTH
from flexclear.dynamics.contact.hertz import compliance


@dataclass(frozen=True)
class Conforming:
    """An elastic force: a form with its values, or, without form, a power of the penetration.

    deepest: penetration [m] up to which it holds.
    """

    form: str = ""
    values: tuple[float, ...] = ()
    stiffness: float = 0.0
    exponent: float = 1.5
    deepest: float = inf


def effective_modulus(joint: Any) -> float:
    """Return Hertz's modulus E* [Pa] of both surfaces."""
    return 1.0 / (pi * compliance(joint))


def require_journal(joint: Any) -> None:
    """Raise ValueError for a joint that is no pin in a round journal."""
    if joint.type != "clearance-revolute":
        raise ValueError(
            f"the form '{joint.normal.form}' is of a pin in a round journal (clearance-revolute), not of "
            f"{joint.type}; leave out form for Hertz's contact"
        )


def logarithmic(joint: Any, argument: float, constant: float) -> Conforming:
    """Return the force of delta = F/(pi E* L) [ln(argument/F) + constant]; argument [N]."""
    force = argument * exp(constant) / e  # where the formula ends
    deepest = force * compliance(joint) / joint.length
    return Conforming("logarithmic", (force, deepest), deepest=LIMIT_DEPTH * deepest)


def by_clearance(joint: Any, factor: float, constant: float) -> Conforming:
    """Return the force of `logarithmic` for a pin in a journal, whose argument is factor E* L c, c the clearance."""
    require_journal(joint)
    return logarithmic(joint, factor * effective_modulus(joint) * joint.length * joint.clearance, constant)
