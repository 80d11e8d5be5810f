"""Loads on the bodies of a mechanism: what each of `loads.LOADS` does, with what steps and the record have of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexclear.dynamics.joints.conditions import along
from flexclear.dynamics.loads import LOADS
from flexclear.dynamics.loads.expressions import evaluated
from flexclear.dynamics.loads.given import Given, Law, line
from flexclear.dynamics.mechanics.trees import End, Numbers, on_both, site_motion
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import Indexed
from flexclear.dynamics.vectors import UNIT


def given_of(
    follows: int,
    numbers: Numbers,
    laws: Sequence[Law],
    states: Numbers,
    gauged: Sequence[tuple[Any, Numbers, int, int]],
    read: Sequence[tuple[int, int]],
    *ends: End,
) -> Given:
    """Return what a load may depend on; arguments: see `act`."""
    frames = [site_motion(*end) for end in ends]
    coordinates = [along(gauge, turns, frames[i], frames[j]) for gauge, turns, i, j in gauged]
    (F, G), named = frames[:2], [(frames, coordinates)[sort][k] for sort, k in read]
    own, tables = ([one for one in numbers if isinstance(one, Indexed) == looked_up] for looked_up in (False, True))
    return Given(own, laws, states, F, G, G.R_WB if follows else UNIT, coordinates, named, tables)


@routine
def act(
    kind: Sequence[str],
    follows: int,
    numbers: Numbers,
    laws: Sequence[Law],
    states: Numbers,
    gauged: Sequence[tuple[Any, Numbers, int, int]],
    read: Sequence[tuple[int, int]],
    shown: tuple[str, int] | tuple[()],
    *ends: End,
) -> Any:
    """Return the rates of a load's states and turns, and its bends; the wrenches on both bodies; its powers.

    kind: its type and, of an expression, the formula.  follows: 1 when its components are in axes of G.  gauged: of
    each coordinate the gauge, its turns, and the numbers of its frames among the ends.  read: (0, frame) or
    (1, coordinate) of each that an expression names.  shown: what the record, a row of `memory.LOAD` after the bends,
    has for its length: a "coordinate", the "distance" of the frames, or "nothing"; () without record.
    """
    given = given_of(follows, numbers, laws, states, gauged, read, *ends)
    load, G = LOADS[kind[0]].apply(given, *kind[1:]), given.G
    turning = [one.rate for one, (_, turns, _, _) in zip(given.coordinates, gauged, strict=True) if turns]
    stored = [load.states, turning, load.bends]
    if shown:
        (M, force), (what, k) = load.wrench.about(G.p_WB), shown
        value, rate = (
            given.coordinates[k][:2] if what == "coordinate" else line(given)[:2] if what == "distance" else (0.0, 0.0)
        )
        stored.append([force, M, value, rate, load.stored, load.power, load.lost])
    return stored, on_both(ends[:2], G, load.wrench), (load.power, load.lost)


@routine
def looked_up(
    kind: Sequence[str],
    follows: int,
    numbers: Numbers,
    laws: Sequence[Law],
    states: Numbers,
    gauged: Sequence[tuple[Any, Numbers, int, int]],
    read: Sequence[tuple[int, int]],
    _: Any,
    *ends: End,
) -> list[tuple[int, list[Any]]]:
    """Return the number of each table that the expressions of a load look up, and where; arguments: see `act`."""
    found = list[tuple[int, list[Any]]]()
    given = given_of(follows, numbers, laws, states, gauged, read, *ends)
    evaluated(given, kind[1], lambda table, at: found.append((table, at)))
    return found
