"""Evaluation of a mechanism: the calls that compute the rates of its state, in their order."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.mechanics import closures as c
from flexclear.dynamics.mechanics.mechanism import (
    Mechanism,
    accelerated,
    acted,
    booked,
    closed,
    eliminated,
    placed,
    powers_of_links,
)
from flexclear.dynamics.mechanics.rubbing import rubbed
from flexclear.dynamics.routines.calls import RESULTS, CallList, Cell, routine
from flexclear.dynamics.routines.symbols import select


@routine
def status(sound: Any, least: Any, jammed: Any) -> tuple[Any]:
    """Return the report of an evaluation (`memory`), from those of `trees.eliminate`, `closures.cholesky` and
    `bearings.loads_of`."""
    free = select(jammed > 0.5, float(m.JAMMED), float(m.OK))
    regular = select(least > c.SINGULAR, free, float(m.SINGULAR))
    return (select(sound > 0.5, regular, float(m.NOT_POSITIVE)),)


def evaluation(mechanism: Mechanism) -> CallList:
    """Return the calls that store the rates of the state, and what steps read besides (`specialise.program.KEPT`)."""
    with CallList().building() as calls:
        placed(mechanism)
        supplied = acted(mechanism, calls)
        sound = eliminated(mechanism)
        loops, jammed = closed(mechanism, calls), 0.0
        if mechanism.rubbing:
            lost, jammed = rubbed(mechanism, loops, calls)
            supplied += lost
        accelerated(mechanism, calls)
        calls.write(list(mechanism.ledger.values()), booked(mechanism, [*supplied, *powers_of_links(mechanism)]))
        calls.store([Cell(RESULTS, 0)], status, sound, loops.least, jammed)
    return calls
