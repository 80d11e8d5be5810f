"""Normal force by an expression: what it is at rate 0 is the elastic force, and the rest is damping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexclear.dynamics import lookup
from flexclear.dynamics.contact import expression
from flexclear.dynamics.contact.expression import composed, halvings
from flexclear.dynamics.contact.form.damped import inverse
from flexclear.dynamics.contact.form.energy import integral, stored_by
from flexclear.dynamics.specialise.symbols import larger
from flexclear.scene.expression import BENT

#: most values of an expression; those of its pieces follow, then those of its tables
VALUES = 12


class Form(NamedTuple):
    """A normal force, with the members of a module of `contact.form`."""

    force: Callable
    stored: Callable
    depth: Callable


def pieces(kind: str) -> int:
    """Return the room for pieces of the elastic force of an expression, as halvings: between kinks and table points."""
    bends = sum(token in BENT for token in kind.split(","))
    return (bends + sum(2**n for levels in halvings(kind) for n in levels)).bit_length()


def sizes(kind: str) -> list[int]:
    """Return how many numbers the pieces of an expression have, if any, and each of its tables, the last one first."""
    return [2 << pieces(kind)][: pieces(kind)] + expression.sizes(kind)


def form_of(kind: str) -> Form:
    """Return the form of a normal force by an expression."""
    whole, levels = composed(kind), pieces(kind)

    def force(depth: Any, rate: Any, impact_rate: Any, law: Any) -> tuple[Any, Any]:
        elastic = whole(depth, 0.0, impact_rate, law.values)
        return elastic, larger(-elastic, whole(depth, rate, impact_rate, law.values) - elastic)

    def at_rest(depth: Any, law: Any) -> Any:
        return whole(depth, 0.0, 1.0, law.values)

    up_to = integral(at_rest)

    def in_pieces(depth: Any, law: Any) -> Any:
        """Count from the start of its piece, at which the energy is known."""
        known = law.values[VALUES]
        k = lookup.interval(known, 0, levels, depth)
        return known[(1 << levels) + k] + up_to(known[k], depth, law)

    return Form(force, in_pieces if levels else stored_by(at_rest), inverse(at_rest))
