"""What the steps of an integration evaluate with: code for the closure rows that it has met, alone or with others.

Members of an ensemble are evaluated several at once (`record.ensemble`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.straight_code import address, made

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.run.evaluation.batched_evaluation import LaneGroup, Place

#: selections of closure rows for which the steps have code of their own, of one integration
SELECTIONS = 4


def settle(engine: Engine, progress: Progress) -> None:
    """Let the steps from here on evaluate with code of their own for the closure rows that are solved for, and at a
    place together with others.

    That is decided by what the integration has met, so one that was interrupted continues as it would, with the code
    for all rows that it has met before.
    """
    straight, rows = engine.straight, engine.selected.tobytes()
    if engine.has_straight_code or engine.h[m.N_CHANGES]:
        if straight.place is not None and straight.group is None and side_by_side(engine):
            straight.group = _group(engine, rows, straight.place, progress)
        if rows not in straight.rows and (len(straight.rows) < SELECTIONS or engine.h[m.N_CHANGES]):
            straight.rows.append(rows)
        for met in straight.rows:
            address(engine.model, engine.h, straight, met, progress=progress)
    engine.connect()


def side_by_side(engine: Engine) -> bool:
    """Whether its attempts can be made together with those of others."""
    return bool(engine.method.staged and engine.has_straight_code)


def _group(engine: Engine, rows: bytes, place: Place, progress: Progress) -> LaneGroup | None:
    """What takes the steps at a place, with the closure rows that the first integration there begins with."""
    where = made(engine.model, engine.h, rows, progress, lanes=place.width, exact=engine.straight.exact)
    return place.group(rows, where, len(engine.model.arrays.f)) if where else None
