"""Normal laws with their numbers, and the family of laws with hysteretic damping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, NamedTuple

from flexclear.dynamics.contact import restitution as closed_form
from flexclear.dynamics.contact.form import FORMS
from flexclear.scene.clearance import Hysteretic

#: largest deviation of the delivered from the requested restitution within a law's range
RESTITUTION_ERROR = 0.05


class Numbers(NamedTuple):
    """Numbers of a normal law for its form; CONTACT_NUMBERS has the same fields.

    stiffness: K [N/m^n].  damping: C [N s/m], or the hysteresis factor; 0 for a law without loss.  values: further ones
    of the form, then those of its tables.
    """

    stiffness: float
    exponent: float
    damping: float
    values: tuple[Any, ...] = (0.0,) * 12


@dataclass(frozen=True)
class Resolved:
    """A normal law, resolved: form and numbers, and the restitution of a free impact.

    parameter: the law's own coefficient of restitution, or None.  delivered: the rebound over the
    approach speed of a free impact, None where it depends on a mass that is unknown.  warning: in words, when the law
    is used outside its range.  deepest: penetration up to which the elastic force holds [m or rad].
    """

    form: str
    numbers: Numbers
    parameter: float | None
    delivered: float | None
    warning: str | None = None
    deepest: float = inf

    def shared(self, share: float) -> Resolved:
        """Return the law of one of several contacts that have it together, each a share of its force.

        An expression is the law of each contact.
        """
        if share == 1.0 or self.form not in FORMS:
            return self
        stiffness, exponent, damping, values = self.numbers
        damped = damping * share if self.form == "linear-damper" else damping
        return replace(self, numbers=Numbers(stiffness * share, exponent, damped, (values[0] * share, *values[1:])))

    def depth(self, force: float) -> float:
        """Return the penetration [m or rad] whose elastic force is `force` [N or N m], >= 0."""
        depth: float = FORMS[self.form].depth(force, self.numbers)
        return depth


@dataclass(frozen=True)
class Hysteresis:
    """A law F = K d^n (1 + a d'/d'0); `factor` gives a for the requested coefficient of restitution.

    valid: range of restitutions that the law delivers within RESTITUTION_ERROR.
    """

    factor: Callable[[float], float]
    valid: tuple[float, float]

    def resolve(self, law: Hysteretic, stiffness: float, mass: float | None) -> Resolved:
        """Return the law for the scene's numbers; raise ValueError, in words, when it cannot deliver them."""
        parameter = delivered = float(law.given_restitution or 0.0)  # its keys demand one
        if law.restitution is None:
            a = closed_form.factor(delivered)
            parameter = self._parameter(law.law, a)
        else:
            a = self._factor(law.law, parameter)
            delivered = closed_form.delivered(a)
        numbers = Numbers(stiffness, law.exponent, a)
        return Resolved("hysteretic", numbers, parameter, delivered, self._warning(law, delivered))

    def _factor(self, name: str, parameter: float) -> float:
        a = self._at(parameter)
        if not isfinite(a):
            raise ValueError(f"the law '{name}' has no finite damping for a restitution of 0; request 0.01 or so")
        return a

    def _at(self, parameter: float) -> float:
        try:
            return self.factor(parameter)
        except ZeroDivisionError:
            return inf

    def _parameter(self, name: str, a: float) -> float:
        """Return the parameter whose factor is a; the factors of all these laws decrease with the parameter."""
        if a == 0.0:
            return 1.0
        least = 0.0 if isfinite(self._at(0.0)) else 1e-300
        if self.factor(least) < a:
            lowest = closed_form.delivered(self.factor(least))
            raise ValueError(
                f"the law '{name}' delivers no restitution below {lowest:.4g}; request more, or choose "
                "'gonthier', 'hu-guo' or 'flores', which cover all restitutions"
            )
        return closed_form.root(lambda c: self.factor(c) - a, least, 1.0)

    def _warning(self, law: Hysteretic, delivered: float) -> str | None:
        if law.restitution is None or abs(delivered - law.restitution) <= RESTITUTION_ERROR:
            return None
        low, high = self.valid
        return (
            f"'{law.law}' with restitution = {law.restitution:g} delivers {delivered:.4g} "
            f"(meant for {low:g} to {high:g}); delivered_restitution = {law.restitution:g} gives the rebound itself"
        )
