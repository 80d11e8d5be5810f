"""Normal force by an expression: what it is at rate 0 is the elastic force, and the rest is damping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexclear.dynamics.contact.expression import composed
from flexclear.dynamics.contact.form.damped import inverse
from flexclear.dynamics.contact.form.energy import integral, stored_by
from flexclear.dynamics.specialise.symbols import larger, smaller

#: place of the first kink of the elastic force among the law's values
KINKS = 10


class Form(NamedTuple):
    """A normal force, with the members of a module of `contact.form`."""

    force: Callable
    stored: Callable
    depth: Callable


def form_of(kind: str) -> Form:
    """Return the form of a normal force by an expression."""
    bends = list[Callable]()
    whole = composed(kind, bends)

    def force(depth: Any, rate: Any, impact_rate: Any, law: Any) -> tuple[Any, Any]:
        elastic = whole(depth, 0.0, impact_rate, law.values)
        return elastic, larger(-elastic, whole(depth, rate, impact_rate, law.values) - elastic)

    def at_rest(depth: Any, law: Any) -> Any:
        return whole(depth, 0.0, 1.0, law.values)

    up_to = integral(at_rest)

    def in_pieces(depth: Any, law: Any) -> Any:
        first, second = smaller(depth, law.values[KINKS]), smaller(depth, law.values[KINKS + 1])
        return up_to(0.0, first, law) + up_to(first, second, law) + up_to(second, depth, law)

    return Form(force, in_pieces if bends else stored_by(at_rest), inverse(at_rest))
